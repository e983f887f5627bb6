"""A campaign's table on disk: one Parquet file, complete at any time.

A Parquet file ends with its index, so nothing can be appended to it. A larger table is written to a
temporary file, which replaces the old file when it is complete on the disk.
"""

import io
import json
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from sautereau.analysis.campaign.row import (
    KINDS,
    LEVELS,
    OF_STRING,
    TOUCH,
    Fault,
    Row,
    Source,
    column_faults,
    place_of,
    unit_of,
)
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.press.features import OF_PLUCK, split_column
from sautereau.rig.disk import make_folder, write_durably
from sautereau.rig.faults import fault_list

KEY = b"sautereau"  # Key of the file's metadata
MOST_ROWS = 1_000_000  # Largest number of presses in a table
MOST_BYTES = 2**29  # Largest unpacked size of a table's columns (byte)
SCHEMA = 5
"""Version of the columns. Tables of sautereau 0.1 have no version number and count as version 1.
Version 2 has no column `TOUCH`. Up to version 3 there is no column `string`, and the plectrum is
always that of the rig's first string. Up to version 4 there are no `DESCRIPTORS` of a shape."""
RENAMED = {
    "contact_duration": "pluck_duration",
    "peak_force": "release_force",
    "force_step": "force_drop",
}
"""Columns of version 1 with their names since version 2. Since then `peak_force` is the largest
force of the complete press."""


@dataclass(frozen=True)
class Campaign:
    """A table of presses, and the recordings that could not be read."""

    path: Path
    """Parquet file."""
    table: pa.Table
    """One row per press, ordered by `path`; null if a press has no value."""
    faults: tuple[Fault, ...]
    """Ordered by path."""
    made_by: str
    """What computed the features, see `sautereau.analysis.campaign.workers.computed_by`."""
    schema: int = SCHEMA
    """Version of the columns in the file. Those of `table` always have their present names."""

    @cached_property
    def data(self) -> pd.DataFrame:
        """The table as a pandas DataFrame, with NaN or None for null; `TOUCH` is ordered."""
        data = self.table.to_pandas()
        for field in self.table.schema:
            if pa.types.is_null(field.type) and field.name not in KINDS:
                data[field.name] = np.nan
        if TOUCH in data:
            data[TOUCH] = data[TOUCH].astype(pd.CategoricalDtype(LEVELS, ordered=True))
        return data

    @cached_property
    def plucks(self) -> pd.DataFrame:
        """One row for each pluck whose string is known, with the columns of a first pluck.

        Of a table without the column `string`, it has the first plucks.
        """
        data: Any = self.data
        parts = []
        if "string" not in data:
            return data.loc[data["plucks"] > 0].reset_index(drop=True)
        named = {str(name): split_column(str(name)) for name in data}
        others = [n for n, (name, _) in named.items() if name not in (*OF_PLUCK, *OF_STRING)]
        for pluck in range(1, int(data["plucks"].max()) + 1):
            own = {n: name for n, (name, k) in named.items() if k == pluck and n not in others}
            part = data[others].join(data[list(own)].set_axis(list(own.values()), axis=1))
            parts.append(part[part["string"].notna()])
        return pd.concat(parts or [data[:0]], ignore_index=True)

    @property
    def simulated(self) -> bool:
        """Whether the stand-in made any of the presses."""
        return any(self.table["simulated"].to_pylist())

    @property
    def sources(self) -> list[Source]:
        """Recording of each row."""
        columns = (self.table[name].to_pylist() for name in ("path", "size", "mtime"))
        return [Source(*row) for row in zip(*columns, strict=True)]

    def only(self, sources: set[Source]) -> "Campaign":
        """Return the campaign with only the rows of these recordings, and without faults."""
        kept = pa.array([source in sources for source in self.sources], pa.bool_())
        return Campaign(self.path, self.table.filter(kept), (), self.made_by)

    def grown(self, rows: Sequence[Row], faults: Sequence[Fault]) -> "Campaign":
        """Return the campaign with more rows and faults."""
        table = self.table
        if rows:
            both = [table, table_of(rows)] if len(table) else [table_of(rows)]
            table = pa.concat_tables(both, promote_options="permissive").sort_by("path")
            table = table.select(sorted(table.column_names, key=place_of))
        more = sorted((*self.faults, *faults), key=lambda fault: fault.source.path)
        return Campaign(self.path, table, tuple(more), self.made_by)

    def write(self) -> None:
        """Replace the file with this table in one step.

        Raises:
            OSError: The disk is full or not writable; the file is unchanged.
        """
        metadata = {
            "made_by": self.made_by,
            "schema": SCHEMA,
            "faults": [asdict(fault) for fault in self.faults],
        }
        fields = [f.with_metadata({"unit": unit_of(f.name)}) for f in self.table.schema]
        schema = pa.schema(fields, metadata={KEY: json.dumps(metadata)})
        file = io.BytesIO()
        pq.write_table(self.table.cast(schema), file, compression="zstd")
        make_folder(self.path.parent)
        write_durably(self.path, file.getvalue(), replace=True)


def empty_campaign(path: Path, made_by: str) -> Campaign:
    """Return a campaign without rows and faults."""
    columns = {
        "path": pa.string(),
        "size": pa.int64(),
        "mtime": pa.int64(),
        "simulated": pa.bool_(),
    }
    return Campaign(path, pa.schema(columns.items()).empty_table(), (), made_by)


def read_campaign(path: str | Path) -> Campaign:
    """Read a campaign's table; columns of version 1 get their present names.

    Raises:
        AnalysisError: The file is missing, is not a table that `sautereau campaign` has written, or
            has columns of a later version.
    """
    path = Path(path)
    fix = "give the file that `sautereau campaign` has written"
    if not path.is_file():
        fault = "it is a folder" if path.is_dir() else "there is no such file"
        raise AnalysisError(f"campaign {path}: {fault}; {fix}")
    try:
        file = pq.ParquetFile(path)
        about = file.metadata
        groups = (about.row_group(k) for k in range(about.num_row_groups))
        rows, size = about.num_rows, sum(group.total_byte_size for group in groups)
        if rows > MOST_ROWS or size > MOST_BYTES:
            raise AnalysisError(
                f"campaign {path}: {rows} presses in {size} bytes, more than the limit MOST_ROWS ="
                f" {MOST_ROWS} or MOST_BYTES = {MOST_BYTES}; divide the recordings into folders"
            )
        table = file.read()
        table.validate(full=True)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise AnalysisError(
            f"campaign {path}: not a complete Parquet file ({error}); {fix}"
        ) from error
    try:
        metadata = json.loads((table.schema.metadata or {})[KEY])
        schema = int(metadata.get("schema", 1))
        faults = tuple(Fault(Source(**f["source"]), f["text"]) for f in metadata["faults"])
        made_by = str(metadata["made_by"])
    except (KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
        raise AnalysisError(
            f"campaign {path}: a Parquet file, but not a campaign's table; {fix}"
        ) from error
    if schema > SCHEMA:
        raise AnalysisError(
            f"campaign {path}: written by sautereau {made_by} with columns of version {schema}, and"
            f" this version reads up to {SCHEMA}; update sautereau, or make the table again with"
            " `sautereau campaign`"
        )
    table = table.replace_schema_metadata(None)
    if schema == 1:
        old = re.compile(rf"^({'|'.join(RENAMED)})(?=(_\d+)?$)")
        names = [old.sub(lambda found: RENAMED[found[1]], name) for name in table.column_names]
        table = table.rename_columns(names)
    if wrong := column_faults(table):
        raise AnalysisError(f"{fault_list(f'campaign {path}', wrong)}\n{fix}")
    return Campaign(path, table, faults, made_by, schema)


def table_of(rows: Sequence[Row]) -> pa.Table:
    """Return rows as a table; it has null where a row has no value."""
    names = dict.fromkeys(name for row in rows for name in row)
    return pa.table({name: [row.get(name) for row in rows] for name in names})
