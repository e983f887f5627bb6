"""Import of text tables and Parquet files, exported by sautereau or by other programs."""

import io
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sautereau.daq.convert.document import PARQUET_KEY, read_document, read_sidecar
from sautereau.daq.convert.formats import (
    Columns,
    ImportSource,
    refuse_missing,
    refuse_rows,
)
from sautereau.daq.convert.layout import Layout, find_layout
from sautereau.daq.errors import RecordingError

if TYPE_CHECKING:
    import pyarrow as pa

MOST_BYTES = 2**30
"""Limit of the size of a text file, byte."""
LAST_LINE = "its last line has no line end, so its last number may be cut off"


def open_csv(path: Path) -> ImportSource:
    """Open a text table; `sautereau.daq.convert.layout` finds its names, units and first row.

    Columns without names are called 1, 2 and so on. A column of ISO 8601 dates becomes the time
    after the first of them.

    Raises:
        RecordingError: The file has no rows or is not text, or its metadata file cannot be read.
    """
    document = read_sidecar(path)
    if (size := path.stat().st_size) > MOST_BYTES:
        raise RecordingError(
            f"it has {size} bytes, more than the limit MOST_BYTES = {MOST_BYTES}; cut it into"
            " single presses"
        )
    layout = find_layout(path)
    with path.open("rb") as file:
        file.seek(-1, io.SEEK_END)
        ends_a_line = file.read(1) in b"\r\n"

    def read(names: list[str]) -> Columns:
        table = _read(path, layout, names)
        if layout.rows is not None and layout.rows != len(table):
            raise RecordingError(
                f"its first lines say {layout.rows} rows, but there are {len(table)}; use a"
                " complete copy, or delete that line if it means something else"
            )
        refuse_rows(len(table))
        for name in names:
            refuse_missing(name, table.column(name).is_null().to_numpy(), where)
        return {
            name: _seconds(name, table.column(name))
            if name in layout.dates
            else table.column(name).to_numpy()
            for name in names
        }

    def where(row: int) -> str:
        return f"row {row + 1} (line {_line_of(path, layout, row)})"

    rate = None if layout.interval is None else float(f"{1 / layout.interval:.9g}")
    every = layout.names
    return ImportSource(
        "CSV",
        every,
        read,
        units=layout.units | dict.fromkeys(layout.dates, "s"),
        rates={} if rate is None else dict.fromkeys(every, rate),
        starts={} if layout.start is None else dict.fromkeys(every, layout.start),
        started=next(iter(layout.dates.values()), None),
        document=document,
        where=where,
        cut="" if ends_a_line else LAST_LINE,
    )


def _read(path: Path, layout: Layout, names: list[str]) -> "pa.Table":
    """Return the named columns as the file has them, dates as text."""
    import pyarrow as pa
    from pyarrow import csv

    source, skip = path, layout.skip
    if layout.delimiter == " ":  # several of them between columns count as one
        lines = path.read_bytes().splitlines()[layout.skip :]
        source, skip = io.BytesIO(b"\n".join(b" ".join(line.split()) for line in lines)), 0
    for threads in (True, False):  # only without threads is the row of a fault known
        try:
            return csv.read_csv(
                source,
                csv.ReadOptions(
                    use_threads=threads,
                    skip_rows=skip,
                    column_names=layout.names,
                    encoding=layout.encoding.removesuffix("-sig"),
                ),
                csv.ParseOptions(delimiter=layout.delimiter),
                csv.ConvertOptions(
                    include_columns=names,
                    column_types={
                        name: pa.string() if name in layout.dates else pa.float64()
                        for name in names
                    },
                    decimal_point=layout.decimal,
                    null_values=[""],
                    strings_can_be_null=True,
                ),
            )
        except pa.ArrowException as error:
            fault = error
            if isinstance(source, io.BytesIO):
                source.seek(0)
    raise RecordingError(
        f"the rows cannot be read as numbers: {fault}; correct that row, or give another column"
    ) from fault


def _seconds(name: str, dates: "pa.ChunkedArray") -> np.ndarray:
    """Return ISO 8601 dates as seconds after the first of them."""
    import pandas as pd

    try:
        found = pd.to_datetime(dates.to_pandas(), format="ISO8601", utc=True)
    except ValueError as error:
        raise RecordingError(f"column {name!r}: {error}; correct that date") from error
    return (found - found.iloc[0]).dt.total_seconds().to_numpy(np.float64)


def _line_of(path: Path, layout: Layout, row: int) -> int:
    """Return the line, from 1, of a row, from 0: empty lines hold no row."""
    with path.open(encoding=layout.encoding) as file:
        filled = (n for n, line in enumerate(file, 1) if n > layout.skip and line.strip())
        return next(islice(filled, row, None), row + 1 + layout.skip)


def open_parquet(path: Path) -> ImportSource:
    """Open a Parquet file; the entry ``unit`` of a field's metadata is its unit.

    Raises:
        RecordingError: It is damaged, or not a Parquet file.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        file = pq.ParquetFile(path)
        schema, rows = file.schema_arrow, file.metadata.num_rows
        names, metadata = tuple(schema.names), schema.metadata or {}
        units = {
            field.name: field.metadata[b"unit"].decode()
            for field in schema
            if field.metadata and b"unit" in field.metadata
        }
    except (pa.ArrowException, OSError, ValueError) as error:
        raise RecordingError(f"it is damaged, or not a Parquet file: {error}") from error
    refuse_rows(rows)
    document = read_document(metadata[PARQUET_KEY]) if PARQUET_KEY in metadata else None

    def read(names: list[str]) -> Columns:
        try:
            table = pq.read_table(path, columns=names)
            return {name: _floats(name, table.column(name)) for name in names}
        except (pa.ArrowException, OSError, ValueError) as error:
            raise RecordingError(f"it is damaged: {error}; use a copy of it") from error

    return ImportSource("Parquet", names, read, units=units, document=document)


def _floats(name: str, column) -> np.ndarray:
    import pyarrow as pa

    if not (pa.types.is_floating(column.type) or pa.types.is_integer(column.type)):
        raise RecordingError(
            f"column {name!r} holds {column.type}, not numbers; give another column"
        )
    refuse_missing(name, column.is_null().to_numpy())
    return column.to_numpy().astype(np.float64)
