"""Parquet files, of sautereau or of others."""

from pathlib import Path

import numpy as np

from sautereau.daq.convert.document import read_document
from sautereau.daq.convert.export import METADATA_KEY
from sautereau.daq.convert.source import Columns, Source
from sautereau.daq.errors import RecordingError


def open_parquet(path: Path) -> Source:
    """Open a Parquet file; a field's metadata ``unit`` is its unit.

    Raises:
        RecordingError: It is damaged, or no Parquet file.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        schema = pq.read_schema(path)
    except (pa.ArrowException, OSError) as error:
        raise RecordingError(f"it is no Parquet file, or damaged: {error}") from error
    metadata = schema.metadata or {}
    document = read_document(metadata[METADATA_KEY]) if METADATA_KEY in metadata else None
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
            raise RecordingError(f"it is damaged: {error}; take it from its copy") from error

    return Source("Parquet", tuple(schema.names), read, units=units, document=document)


def _floats(name: str, column) -> np.ndarray:
    import pyarrow as pa

    if not (pa.types.is_floating(column.type) or pa.types.is_integer(column.type)):
        raise RecordingError(f"its column {name!r} holds {column.type}, no numbers; give another")
    if column.null_count:
        first = column.is_null().to_pylist().index(True)
        raise RecordingError(
            f"its column {name!r} is empty in {column.null_count} rows, the first being"
            f" {first + 1}; a hole is never filled: cut the file there"
        )
    return column.to_numpy().astype(np.float64)
