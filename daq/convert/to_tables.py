"""Export as a table of one row for each sample: Parquet and CSV."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from sautereau.daq.convert.columns import Column
from sautereau.daq.convert.document import PARQUET_KEY, SIDECAR, Parts
from sautereau.daq.file.recorded import Recorded

if TYPE_CHECKING:
    import pyarrow as pa


def to_parquet(recorded: Recorded, columns: Sequence[Column], document: str) -> Parts:
    """Return a Parquet file; its schema's metadata hold the document."""
    import pyarrow.parquet as pq

    table = _table(recorded, columns).replace_schema_metadata({PARQUET_KEY: document.encode()})
    return {"": lambda stream: pq.write_table(table, stream, compression="zstd")}


def to_csv(recorded: Recorded, columns: Sequence[Column], document: str) -> Parts:
    """Return a plain table, and the document beside it."""
    from pyarrow import csv

    table, options = _table(recorded, columns), csv.WriteOptions(quoting_style="needed")
    return {
        "": lambda stream: csv.write_csv(table, stream, options),
        SIDECAR: lambda stream: stream.write(document.encode()),
    }


def _table(recorded: Recorded, columns: Sequence[Column]) -> "pa.Table":
    """Return the columns, empty where they have no value."""
    import pyarrow as pa

    arrays, fields = [], []
    for column in columns:
        values = pa.array(column.values)
        after = recorded.n_samples - column.start - len(values)
        before, behind = (pa.nulls(m, values.type) for m in (column.start, after))
        arrays.append(pa.concat_arrays([before, values, behind]))
        fields.append(pa.field(column.name, values.type, metadata=column.about))
    return pa.table(arrays, schema=pa.schema(fields))
