"""Import of text tables and Parquet files, exported by sautereau or by other programs."""

import io
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from sautereau.daq.convert.document import PARQUET_KEY, read_document, read_sidecar
from sautereau.daq.convert.formats import (
    Columns,
    ImportSource,
    reading,
    refuse_missing,
    refuse_rows,
)
from sautereau.daq.convert.layout import Layout, find_layout
from sautereau.daq.convert.text import (
    GROUPED,
    NotANumberError,
    Numbers,
    cells_of,
    lines_of,
    nanoseconds_of,
    number_in,
)
from sautereau.daq.errors import RecordingError
from sautereau.rig.disk import open_regular
from sautereau.rig.units import shown

MOST_BYTES = 2**30  # Limit of the size of a text file, byte
LAST_LINE = "its last line has no line end, so its last number may be cut off"


def open_csv(
    path: Path, decimal: str = "", skip: int | None = None, columns: Sequence[str] = ()
) -> ImportSource:
    """Open a text table; `sautereau.daq.convert.layout` finds its names, units and first row.

    Columns without names are called 1, 2 and so on. A column of times of the clock becomes the
    time after the first of them.

    Args:
        path: The file.
        decimal: Decimal sign; empty if it must be found.
        skip: Lines before the first row; None if they must be found.
        columns: Columns that are imported; they decide between two ways to read the file.

    Raises:
        RecordingError: The file has no rows, is not text or can be read in two ways, or its
            metadata file cannot be read.
    """
    document = read_sidecar(path)
    if (size := path.stat().st_size) > MOST_BYTES:
        raise RecordingError(
            f"it has {size} bytes, more than the limit MOST_BYTES = {MOST_BYTES}; cut it into"
            " single presses"
        )
    layout = find_layout(path, "." if document else decimal, skip, columns)
    with open_regular(path) as file:
        file.seek(-1, io.SEEK_END)
        ends_a_line = file.read(1) in b"\r\n"

    def where(row: int) -> str:
        line, _ = next(islice(_rows(path, layout), row, None))
        return f"row {row + 1} (line {line})"

    every = layout.names
    clocks = [name for name, kind in zip(every, layout.kinds, strict=True) if kind == "t"]
    dated = layout.dates if len(layout.dates) == 1 else {}
    return ImportSource(
        "CSV",
        every,
        lambda names: _read(path, layout, names, where),
        units=layout.units | dict.fromkeys(clocks, "s"),
        rates={} if layout.rate is None else dict.fromkeys(every, layout.rate),
        starts={} if layout.start is None else dict.fromkeys(every, layout.start),
        started=next(iter(dated.values()), None),
        dates={} if dated else layout.dates,
        rows=layout.rows,
        guess=str(layout),
        document=document,
        where=where,
        cut="" if ends_a_line else LAST_LINE,
    )


def _rows(path: Path, layout: Layout) -> Iterator[tuple[int, list[str]]]:
    """Yield the number of each line that is a row, and its cells.

    Raises:
        RecordingError: A row has another number of cells, or an empty one is not the last.
    """
    width, empty = len(layout.names), None
    for number, line in enumerate(lines_of(path, layout.encoding), 1):
        if number <= layout.skip:
            continue
        cells = cells_of(line, layout.delimiter)
        if not any(cells):
            if width == 1 or line.strip():  # in other tables a line without delimiters is no row
                empty = empty or number
            continue
        if empty:
            raise RecordingError(
                f"line {empty} is empty, and rows follow; if no samples are missing there, delete"
                " the empty lines"
            )
        if len(cells) != width:
            raise RecordingError(
                f"line {number}, {shown(line.strip())}, has {len(cells)} cells, and the rows"
                f" have {width}; correct it, or give --skip {number} if the rows begin below it"
            )
        yield number, cells


def _read(
    path: Path, layout: Layout, names: list[str], where: Callable[[int], str]
) -> dict[str, np.ndarray]:
    """Return the named columns; the numbers and times in the others are checked too."""
    numbers = Numbers(layout.decimal, layout.sure)
    every = list(zip(layout.names, layout.kinds, layout.first, strict=True))
    kept = [(k, *one) for k, one in enumerate(every) if one[0] in names or one[1] in "nt"]
    found: dict[str, list[np.ndarray]] = {name: [] for name in names}
    empty: dict[str, list[int]] = {name: [] for name in names}
    rows, n = _rows(path, layout), 0
    while batch := list(islice(rows, 65_536)):
        refuse_rows(n + len(batch))
        for place, name, kind, first in kept:
            cells = [row[place] for _, row in batch]
            try:
                values = nanoseconds_of(cells, first) if kind == "t" else numbers.read(cells)
            except NotANumberError as error:
                line, cell = batch[error.at][0], error.cell
                fault = (
                    "has separators of thousands; write the file without them"
                    if GROUPED.fullmatch(cell)
                    else "is not a number; give a column of numbers, and as times one of s or of"
                    " ISO 8601 dates, or --rate and no --time"
                )
                raise RecordingError(
                    f"column {name!r}: {shown(cell)} in line {line} {fault}"
                ) from None
            if name in names:
                found[name].append(np.array(values))
                if "" in cells:
                    empty[name] += [n + k for k, cell in enumerate(cells) if not cell]
        n += len(batch)
    if doubt := numbers.doubt:
        sign = numbers.decimal
        raise RecordingError(
            f"{doubt!r} can be {number_in(doubt, sign)!r} or {doubt.replace(sign, '')}, and no"
            f" number in it shows which; give --decimal {sign!r}, or write it without separators of"
            " thousands"
        )
    for name in names:
        refuse_missing(name, np.isin(np.arange(n), empty[name]), where)
    columns = {name: np.concatenate(parts) for name, parts in found.items()}
    times = [name for name, kind, _ in every if kind == "t" and name in names]
    return columns | {name: (columns[name] - columns[name][0]) * 1e-9 for name in times}


def open_parquet(path: Path) -> ImportSource:
    """Open a Parquet file; the entry ``unit`` of a field's metadata is its unit.

    Raises:
        RecordingError: It is damaged, or not a Parquet file.
    """
    import pyarrow.parquet as pq

    with reading("Parquet"):
        file = pq.ParquetFile(path)
        schema, rows = file.schema_arrow, file.metadata.num_rows
        names, metadata = tuple(schema.names), schema.metadata or {}
        units = {
            field.name: field.metadata[b"unit"].decode()
            for field in schema
            if field.metadata and b"unit" in field.metadata
        }
    refuse_rows(rows)
    document = read_document(metadata[PARQUET_KEY]) if PARQUET_KEY in metadata else None

    def read(names: list[str]) -> Columns:
        with reading("Parquet"):
            table = pq.read_table(path, columns=names)
            return {name: _floats(name, table.column(name)) for name in names}

    return ImportSource("Parquet", names, read, units=units, document=document)


def _floats(name: str, column) -> np.ndarray:
    import pyarrow as pa

    if not (pa.types.is_floating(column.type) or pa.types.is_integer(column.type)):
        raise RecordingError(
            f"column {name!r} holds {column.type}, not numbers; give another column"
        )
    refuse_missing(name, column.is_null().to_numpy())
    return column.to_numpy().astype(np.float64)
