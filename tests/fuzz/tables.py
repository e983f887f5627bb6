"""A campaign's table of made-up presses, and what is hostile in one."""

import io
import json
import random
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from sautereau.analysis.campaign.judged import find_judged
from sautereau.analysis.campaign.run import run_campaign
from sautereau.analysis.campaign.table import KEY, Campaign, read_campaign
from sautereau.analysis.campaign.touch import find_touch
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.results.touch import JudgedTouch
from sautereau.commands.output import json_text
from tests.fuzz import mutate

PRESSES = 24


def rows() -> dict[str, list[Any]]:
    """Return columns of a campaign, of two plectra with two sessions each."""
    dice = random.Random(1)
    number = range(PRESSES)
    return {
        "path": [f"s{k // 6}/press-{k:04d}.mcap" for k in number],
        "size": [1000 + k for k in number],
        "mtime": [10**18 + k for k in number],
        "simulated": [True] * PRESSES,
        "session": [f"s {k // 6}" for k in number],
        "rig": ["paper"] * PRESSES,
        "plectrum": [f"p {k // 12}" for k in number],
        "warm_up": [k % 6 == 0 for k in number],
        "plucks": [1] * PRESSES,
        "touch": [("soft", "hard")[k // 12] for k in number],
        "plectrum_length": [(7e-3, 8e-3)[k // 12] for k in number],
        "plectrum_width": [3e-3] * PRESSES,
        "plectrum_thickness": [(3e-4, 4e-4)[k // 12] for k in number],
        "plectrum_tip_thickness": [(3e-4, 2e-4)[k // 12] for k in number],
        "plectrum_tip_compliance": [(3e-3, 2e-3)[k // 12] for k in number],
        "plectrum_overlap": [6e-4] * PRESSES,
        "plectrum_youngs_modulus": [2.9e9] * PRESSES,
        "plectrum_bending_stiffness": [2e-5] * PRESSES,
        "string_stiffness": [900.0] * PRESSES,
        "jack_speed": [0.07] * PRESSES,
        **{
            name: [(1 + k // 12) * size * dice.uniform(0.9, 1.1) for k in number]
            for name, size in (("release_force", 0.7), ("force_slope", 900.0), ("force_drop", 0.3))
        },
        "pluck_duration": [0.04 + 1e-4 * k for k in number],
    }


def campaign_of(path: Path) -> Campaign:
    """Write the table of `rows` and return it."""
    made = Campaign(path, pa.table(rows()), (), "0.2")
    made.write()
    return read_campaign(path)


class Campaigns:
    """Tables with other columns, types, values and metadata, or with other bytes."""

    def __init__(self, folder: Path):
        self._folder = folder
        self._path = folder / "campaign.parquet"
        self._columns = rows()
        self._names = [*campaign_of(self._path).table.column_names]
        self._bytes = self._path.read_bytes()
        (folder / "empty").mkdir(exist_ok=True)

    def case(self, dice: random.Random) -> str:
        self._path.write_bytes(self._changed(dice))
        table = read_campaign(self._path)
        if dice.random() < 0.3:
            run_campaign(self._folder / "empty", self._path, 1)
            return "continued"
        judged = find_judged(table)
        try:
            json_text(JudgedTouch(find_touch(table), judged).document)
        except AnalysisError:
            return "read"
        return "compared"

    def _changed(self, dice: random.Random) -> bytes:
        if dice.random() < 0.3:
            return mutate.of_bytes(self._bytes, dice)
        table = pq.read_table(io.BytesIO(self._bytes))
        metadata = json.loads(table.schema.metadata[KEY])
        table = table.replace_schema_metadata(None)
        for _ in range(dice.choice((1, 2))):
            table, metadata = self._change(table, metadata, dice)
        file = io.BytesIO()
        pq.write_table(table.replace_schema_metadata({KEY: mutate.json_text(metadata)}), file)
        return file.getvalue()

    def _change(self, table: pa.Table, metadata: Any, dice: random.Random) -> tuple[pa.Table, Any]:
        name = dice.choice(table.column_names) if table.num_columns else ""
        at = table.schema.get_field_index(name)
        n = table.num_rows
        match dice.randrange(7):
            case 0 if at >= 0:
                return table.remove_column(at), metadata
            case 1:
                return table, mutate.of_tree(metadata, dice)
            case 2:
                return table.slice(0, dice.choice((0, 1, 2, 5))), metadata
            case 3 if at >= 0:
                names = [dice.choice((c, c, "path", "touch", "x")) for c in table.column_names]
                return table.rename_columns(names), metadata
            case 4 if at >= 0:
                column = table.column(at)
                new = column.to_pylist()
                for k in range(len(new)):
                    if dice.random() < 0.5:
                        new[k] = dice.choice((None, new[0], new[-1]))
                return table.set_column(at, name, pa.array(new, column.type)), metadata
            case _ if at >= 0:
                value = dice.choice((
                    None, 0.0, -1.0, 1e308, 5e-324, float("nan"), float("inf"), 2**62, "x", "",
                    "\x1b[2J", b"x", True, [1], {"a": 1}, "=1+1",
                ))  # fmt: skip
                return table.set_column(at, name, pa.array([value] * n)), metadata
            case _:
                return table, metadata
