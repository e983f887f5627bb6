"""Import of CSV and Parquet files, exported by sautereau or by other programs."""

import csv as csv_dialects
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sautereau.daq.convert.formats import (
    PARQUET_KEY,
    Columns,
    Document,
    ImportSource,
    read_document,
    refuse_missing,
)
from sautereau.daq.errors import RecordingError

DELIMITERS = ";\t,"
"""Possible delimiters; the first of them that the line contains is used, since a comma may
also be a decimal one."""


@dataclass(frozen=True)
class _Layout:
    names: tuple[str, ...]
    skip: int
    """Lines before the first row."""
    delimiter: str
    decimal: str


def open_csv(path: Path) -> ImportSource:
    """Open a CSV file: comment lines after ``#``, a line of names, rows of numbers.

    Columns without names are called 1, 2 and so on. If the delimiter is ``;`` or a tab, commas
    are decimal commas.

    Raises:
        RecordingError: The file is empty or not text, or its metadata file cannot be read.
    """
    document = _document(path)
    layout = _layout(path)

    def read(names: list[str]) -> Columns:
        import pyarrow as pa
        from pyarrow import csv

        try:
            table = csv.read_csv(
                path,
                csv.ReadOptions(skip_rows=layout.skip, column_names=layout.names),
                csv.ParseOptions(delimiter=layout.delimiter),
                csv.ConvertOptions(
                    include_columns=names,
                    column_types={name: pa.float64() for name in names},
                    decimal_point=layout.decimal,
                    null_values=[""],
                ),
            )
        except pa.ArrowException as error:
            raise RecordingError(
                f"the rows cannot be read as numbers: {error}; correct that row, or give another"
                " column"
            ) from error
        for name in names:
            refuse_missing(name, table.column(name).is_null().to_numpy())
        return {name: table.column(name).to_numpy() for name in names}

    return ImportSource("CSV", layout.names, read, document=document)


def _document(path: Path) -> Document | None:
    """Return the metadata in ``NAME.csv.json``, if that file exists."""
    sidecar = path.with_name(path.name + ".json")
    return read_document(sidecar.read_bytes()) if sidecar.is_file() else None


def _layout(path: Path) -> _Layout:
    """Find the first row, the names of the columns, the delimiter and the decimal sign."""
    comments = 0
    lines: list[str] = []
    try:
        with path.open(encoding="utf-8-sig") as file:
            for line in file:
                if not lines and (line.startswith("#") or not line.strip()):
                    comments += 1
                    continue
                lines.append(line.rstrip("\r\n"))
                if len(lines) == 2:
                    break
    except UnicodeDecodeError as error:
        raise RecordingError(f"it is not UTF-8 text: {error}; save it as UTF-8") from error
    if not lines:
        raise RecordingError("it has no rows; give a CSV file with numbers")
    delimiter = next((sign for sign in DELIMITERS if sign in lines[0]), ",")
    decimal = "," if delimiter != "," and "," in lines[-1] else "."
    (cells,) = csv_dialects.reader([lines[0]], delimiter=delimiter)
    if all(_is_number(cell, decimal) for cell in cells):
        return _Layout(tuple(str(i + 1) for i in range(len(cells))), comments, delimiter, decimal)
    names = tuple(cell.strip() for cell in cells)
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise RecordingError(
            f"several columns are called {', '.join(map(repr, repeated))}; give each its own name"
        )
    return _Layout(names, comments + 1, delimiter, decimal)


def _is_number(cell: str, decimal: str) -> bool:
    try:
        float(cell.replace(decimal, "."))
    except ValueError:
        return False
    return True


def open_parquet(path: Path) -> ImportSource:
    """Open a Parquet file; the entry ``unit`` of a field's metadata is its unit.

    Raises:
        RecordingError: It is damaged, or not a Parquet file.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        schema = pq.read_schema(path)
    except (pa.ArrowException, OSError) as error:
        raise RecordingError(f"it is damaged, or not a Parquet file: {error}") from error
    metadata = schema.metadata or {}
    document = read_document(metadata[PARQUET_KEY]) if PARQUET_KEY in metadata else None
    units = {
        field.name: field.metadata[b"unit"].decode()
        for field in schema
        if field.metadata and b"unit" in field.metadata
    }

    def read(names: list[str]) -> Columns:
        try:
            table = pq.read_table(path, columns=names)
            return {name: _floats(name, table.column(name)) for name in names}
        except (pa.ArrowException, OSError) as error:
            raise RecordingError(f"it is damaged: {error}; use a copy of it") from error

    return ImportSource("Parquet", tuple(schema.names), read, units=units, document=document)


def _floats(name: str, column) -> np.ndarray:
    import pyarrow as pa

    if not (pa.types.is_floating(column.type) or pa.types.is_integer(column.type)):
        raise RecordingError(
            f"column {name!r} holds {column.type}, not numbers; give another column"
        )
    refuse_missing(name, column.is_null().to_numpy())
    return column.to_numpy().astype(np.float64)
