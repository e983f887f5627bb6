"""CSV files, of sautereau or of others."""

import csv as csv_dialects
from dataclasses import dataclass
from pathlib import Path

from sautereau.daq.convert.document import Document, read_document
from sautereau.daq.convert.source import Columns, Source
from sautereau.daq.errors import RecordingError

DELIMITERS = ";\t,"
"""That a line is split by; the first one in it. A comma may be a decimal one elsewhere."""


@dataclass(frozen=True)
class _Layout:
    names: tuple[str, ...]
    skip: int
    """Lines before the first row."""
    delimiter: str
    decimal: str


def open_csv(path: Path) -> Source:
    """Open a CSV file: lines of comment after ``#``, a line of names, rows of numbers.

    Columns without names are called 1, 2 and so on. Where the delimiter is ``;`` or a tab, a
    comma is a decimal one.

    Raises:
        RecordingError: It is empty or no text, or the metadata beside it cannot be read.
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
                f"its rows cannot be read as numbers: {error}; mend that row, or take another"
                " column"
            ) from error
        for name in names:
            column = table.column(name)
            if column.null_count:
                first = column.is_null().to_pylist().index(True)
                raise RecordingError(
                    f"its column {name!r} is empty in {column.null_count} rows, the first being"
                    f" row {first + 1}; a hole is never filled: cut the file there"
                )
        return {name: table.column(name).to_numpy() for name in names}

    return Source("CSV", layout.names, read, document=document)


def _document(path: Path) -> Document | None:
    beside = path.with_name(path.name + ".json")
    if not beside.is_file():
        return None
    return read_document(beside.read_bytes())


def _layout(path: Path) -> _Layout:
    """Find where the rows begin, what the columns are called and how numbers are written."""
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
        raise RecordingError(f"it is no text in UTF-8: {error}; save it as UTF-8") from error
    if not lines:
        raise RecordingError("it has no rows; give a CSV file with numbers")
    delimiter = next((mark for mark in DELIMITERS if mark in lines[0]), ",")
    decimal = "," if delimiter != "," and "," in lines[-1] else "."
    (cells,) = csv_dialects.reader([lines[0]], delimiter=delimiter)
    if all(_is_number(cell, decimal) for cell in cells):
        return _Layout(tuple(str(i + 1) for i in range(len(cells))), comments, delimiter, decimal)
    names = tuple(cell.strip() for cell in cells)
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise RecordingError(
            f"its columns {', '.join(map(repr, twice))} are there twice; give each its own name"
        )
    return _Layout(names, comments + 1, delimiter, decimal)


def _is_number(cell: str, decimal: str) -> bool:
    try:
        float(cell.replace(decimal, "."))
    except ValueError:
        return False
    return True
