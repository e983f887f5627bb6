"""Import of Parquet files, exported by sautereau or by other programs."""

from pathlib import Path

import numpy as np

from sautereau.daq.convert.document import PARQUET_KEY, read_document
from sautereau.daq.convert.formats import Columns, ImportSource, refuse_missing
from sautereau.daq.errors import RecordingError


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
