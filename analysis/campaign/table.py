"""A campaign's table on the disk: one Parquet file, whole at every moment.

A Parquet file ends in its index and cannot be added to, so it is written anew as it grows, beside
itself, and takes its own name once it is on the disk.
"""

import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from sautereau.analysis.campaign.row import Fault, Row, Source, place_of, unit_of
from sautereau.analysis.errors import AnalysisError
from sautereau.rig.disk import sync_folder

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

KEY = b"sautereau"
"""Of what the file says beside its columns."""
PART = ".part"
"""End of the name of a file that is being written."""


@dataclass(frozen=True)
class Campaign:
    """A table of presses, and the recordings that gave none."""

    path: Path
    """Of the Parquet file."""
    table: "pa.Table"
    """One row a press, in the order of `path`; a column that a press has no value for is null."""
    faults: tuple[Fault, ...]
    """In the order of their paths."""
    made_by: str
    """Version of sautereau that found the features."""

    @cached_property
    def data(self) -> "pd.DataFrame":
        """The table in pandas; null is NaN or None there."""
        return self.table.to_pandas()

    @property
    def units(self) -> dict[str, str]:
        """Unit of each column; empty for text and truths."""
        return {name: unit_of(name) for name in self.table.column_names}

    @property
    def simulated(self) -> bool:
        """Whether a stand-in made any of the presses."""
        return any(self.table["simulated"].to_pylist())

    @property
    def sources(self) -> list[Source]:
        """Recording of each row."""
        columns = (self.table[name].to_pylist() for name in ("path", "size", "mtime"))
        return [Source(*row) for row in zip(*columns, strict=True)]

    def only(self, wanted: set[Source]) -> "Campaign":
        """Return the campaign without the rows that are not wanted, and without faults."""
        import pyarrow as pa

        kept = pa.array([source in wanted for source in self.sources], pa.bool_())
        return Campaign(self.path, self.table.filter(kept), (), self.made_by)

    def grown(self, rows: Sequence[Row], faults: Sequence[Fault]) -> "Campaign":
        """Return the campaign with more rows and faults."""
        import pyarrow as pa

        table = self.table
        if rows:
            both = [table, table_of(rows)] if len(table) else [table_of(rows)]
            table = pa.concat_tables(both, promote_options="permissive").sort_by("path")
            table = table.select(sorted(table.column_names, key=place_of))
        more = sorted((*self.faults, *faults), key=lambda fault: fault.source.path)
        return Campaign(self.path, table, tuple(more), self.made_by)

    def write(self) -> None:
        """Replace the file by this table, all at once.

        Raises:
            OSError: The disk refuses; the file is as it was.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        said = {"made_by": self.made_by, "faults": [asdict(fault) for fault in self.faults]}
        fields = [f.with_metadata({"unit": unit_of(f.name)}) for f in self.table.schema]
        schema = pa.schema(fields, metadata={KEY: json.dumps(said)})
        part = self.path.with_name(self.path.name + PART)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with part.open("wb") as file:
            pq.write_table(self.table.cast(schema), file, compression="zstd")
            file.flush()
            os.fsync(file.fileno())
        part.replace(self.path)
        sync_folder(self.path.parent)


def empty_campaign(path: Path, made_by: str) -> Campaign:
    """Return a campaign that has read nothing."""
    import pyarrow as pa

    columns = {
        "path": pa.string(),
        "size": pa.int64(),
        "mtime": pa.int64(),
        "simulated": pa.bool_(),
    }
    return Campaign(path, pa.schema(columns.items()).empty_table(), (), made_by)


def read_campaign(path: str | Path) -> Campaign:
    """Read a campaign's table.

    Raises:
        AnalysisError: It is missing, or not a table that `sautereau campaign` has written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = Path(path)
    remedy = "give the file that `sautereau campaign` has written"
    if not path.is_file():
        raise AnalysisError(f"campaign {path}: there is no such file; {remedy}")
    try:
        table = pq.ParquetFile(path).read()
    except pa.ArrowException as error:
        raise AnalysisError(
            f"campaign {path}: it is no whole Parquet file ({error}); {remedy}"
        ) from error
    try:
        said = json.loads((table.schema.metadata or {})[KEY])
        faults = tuple(Fault(Source(**f["source"]), f["text"]) for f in said["faults"])
        table = table.replace_schema_metadata(None)
        return Campaign(path, table, faults, said["made_by"])
    except (KeyError, TypeError, ValueError) as error:
        raise AnalysisError(
            f"campaign {path}: it is a Parquet file of something else; {remedy}"
        ) from error


def table_of(rows: Sequence[Row]) -> "pa.Table":
    """Return rows as a table; a value that a row does not have is null."""
    import pyarrow as pa

    names = dict.fromkeys(name for row in rows for name in row)
    return pa.table({name: [row.get(name) for row in rows] for name in names})
