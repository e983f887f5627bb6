"""Judgements of touch: read from a CSV file, and counted."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray

from sautereau.analysis.campaign.labels import LEVELS, TOUCH
from sautereau.analysis.campaign.table import MOST_ROWS, Campaign
from sautereau.analysis.errors import AnalysisError
from sautereau.rig.csv_files import read_rows
from sautereau.rig.faults import fault_list
from sautereau.rig.units import shown
from sautereau.trajectory.motion import Floats

KEYS = ("path", "session", "plectrum", "rig")
"""Columns of a campaign by which a table of judgements may identify presses."""
MOST_LISTED = 20  # Largest number of faults that a message lists


def judgements(
    data: pd.DataFrame, columns: list[str]
) -> tuple[NDArray[np.intp], dict[str, Floats]]:
    """Return the level of each judgement, and the mean of each column over its presses.

    If all presses of a session have the same judgement, they count as one judgement, since they are
    not independent. Otherwise each press of the session counts as one.

    Returns:
        Indices into `LEVELS`, shape (n_judgements,); and arrays of that shape, with NaN where no
        press has the quantity. Warm-up presses and presses without a pluck are excluded.
    """
    used: Any = data[data[TOUCH].notna() & (data["plucks"] > 0) & ~data["warm_up"].astype(bool)]
    levels = used[TOUCH].cat.codes
    sessions = used.groupby(["plectrum", "session"]).ngroup()
    several = levels.groupby(sessions).transform("nunique") > 1
    units = sessions.where(~several, len(used) + np.arange(len(used)))
    means = used[columns].astype(float).groupby(units).mean()
    first = levels.groupby(units).first()
    return first.to_numpy(np.intp), {name: means[name].to_numpy() for name in columns}


def with_labels(campaign: Campaign, path: Path) -> Campaign:
    """Return a campaign with the judgements of a CSV file; they replace those in the notes.

    Args:
        path: CSV with the column `TOUCH` and one of `KEYS`.

    Raises:
        AnalysisError: It cannot be read; lists every row with an unknown judgement or key.
    """
    origin = f"judgements {path}"
    rows, _ = read_rows(path, origin, AnalysisError, MOST_ROWS)
    head, *lines = rows or [[]]
    table = campaign.table
    keys = [key for key in KEYS if key in head and key in table.column_names]
    if len(keys) != 1 or TOUCH not in head:
        raise AnalysisError(
            f"{origin}: it has the columns {', '.join(head)}; give {TOUCH} and one of"
            f" {', '.join(KEYS)}"
        )
    (key,) = keys
    known = set(table[key].to_pylist())
    given: dict[str, str] = {}
    faults = []
    for line, cells in enumerate(lines, 2):
        if not any(cells):
            continue
        if len(cells) != len(head):
            faults.append(f"row {line}: {len(cells)} cells under {len(head)} columns")
            continue
        name, text = cells[head.index(key)], cells[head.index(TOUCH)]
        label = text.strip().lower()
        if label not in LEVELS:
            faults.append(f"row {line}: {shown(text)} is none of {', '.join(LEVELS)}")
        if name not in known:
            faults.append(f"row {line}: the campaign has no {key} {shown(name)}")
        if given.setdefault(name, label) != label:
            faults.append(f"row {line}: {key} {shown(name)} has two judgements; give one")
    if faults:
        raise AnalysisError(fault_list(origin, faults[:MOST_LISTED]))
    before = table[TOUCH].to_pylist() if TOUCH in table.column_names else [None] * len(table)
    labels = [given.get(n, b) for n, b in zip(table[key].to_pylist(), before, strict=True)]
    kept = table.select([name for name in table.column_names if name != TOUCH])
    return replace(campaign, table=kept.append_column(TOUCH, pa.array(labels, pa.string())))
