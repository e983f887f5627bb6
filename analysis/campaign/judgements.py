"""Judgements of touch: those of a CSV file, and what counts as one of them."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray

from sautereau.analysis.campaign.labels import LEVELS, TOUCH
from sautereau.analysis.campaign.table import Campaign
from sautereau.analysis.errors import AnalysisError
from sautereau.rig.disk import read_limited
from sautereau.rig.faults import fault_list
from sautereau.rig.units import shown
from sautereau.trajectory.motion import Floats

KEYS = ("path", "session", "plectrum", "rig")
"""Columns of a campaign by which a table of judgements may name presses."""
MOST_LISTED = 20
"""Faults of such a table that the message lists."""


def judgements(
    data: pd.DataFrame, columns: list[str]
) -> tuple[NDArray[np.intp], dict[str, Floats]]:
    """Return the level of each judgement, and the mean of each column over its presses.

    The presses of a session that was judged once are one judgement, since they are not
    independent; each press of a session with several different judgements is one.

    Args:
        data: Of a campaign with the column `TOUCH`.
        columns: Of measured quantities.

    Returns:
        Indices into `LEVELS`, shape (n_judgements,); and arrays of that shape, with NaN where no
        press has the quantity. Warm-up presses and presses without a pluck are excluded.
    """
    levels = data[TOUCH].cat.codes.to_numpy(np.intp)
    plucked = data["plucks"].to_numpy(float) > 0
    used = np.flatnonzero((levels >= 0) & plucked & ~data["warm_up"].to_numpy(bool))
    levels = levels[used]
    names = [f"{data['plectrum'].iloc[i]} {data['session'].iloc[i]}" for i in used]
    _, sessions = np.unique(names, return_inverse=True)
    lowest = np.full(len(names), len(LEVELS), np.intp)
    highest = np.full(len(names), -1, np.intp)
    np.minimum.at(lowest, sessions, levels)
    np.maximum.at(highest, sessions, levels)
    alone = len(names) + np.arange(len(names))
    _, first, units = np.unique(
        np.where((lowest < highest)[sessions], alone, sessions),
        return_index=True,
        return_inverse=True,
    )
    means = {}
    for name in columns:
        values = data[name].to_numpy(float)[used]
        there = np.isfinite(values)
        counts = np.bincount(units[there], minlength=len(first))
        sums = np.bincount(units[there], values[there], minlength=len(first))
        means[name] = np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)
    return levels[first], means


def with_labels(campaign: Campaign, path: Path) -> Campaign:
    """Return a campaign with the judgements of a CSV file, which replace those in the notes.

    Args:
        campaign: The table.
        path: CSV with the column `TOUCH` and one of `KEYS`.

    Raises:
        AnalysisError: It cannot be read; lists every row with an unknown judgement or key.
    """
    origin = f"judgements {path}"
    try:
        text = io.BytesIO(read_limited(path))
        rows = pd.read_csv(text, dtype=str, keep_default_na=False, skipinitialspace=True)
    except (OSError, ValueError) as error:  # pandas' own errors are ValueErrors
        raise AnalysisError(f"{origin}: {error}; give a CSV file") from error
    keys = [key for key in KEYS if key in rows and key in campaign.table.column_names]
    if len(keys) != 1 or TOUCH not in rows:
        raise AnalysisError(
            f"{origin}: it has the columns {', '.join(rows)}; give {TOUCH} and one of"
            f" {', '.join(KEYS)}"
        )
    (key,) = keys
    known = set(campaign.table[key].to_pylist())
    given: dict[str, str] = {}
    faults = []
    for line, (name, text) in enumerate(zip(rows[key], rows[TOUCH], strict=True), 2):
        label = text.strip().lower()
        if label not in LEVELS:
            faults.append(f"row {line}: {shown(text)} is none of {', '.join(LEVELS)}")
        if name not in known:
            faults.append(f"row {line}: the campaign has no {key} {shown(name)}")
        if given.setdefault(name, label) != label:
            faults.append(f"row {line}: {key} {shown(name)} has two judgements; give one")
    if faults:
        raise AnalysisError(fault_list(origin, faults[:MOST_LISTED]))
    table = campaign.table
    before = table[TOUCH].to_pylist() if TOUCH in table.column_names else [None] * len(table)
    labels = [given.get(n, b) for n, b in zip(table[key].to_pylist(), before, strict=True)]
    kept = table.select([name for name in table.column_names if name != TOUCH])
    return replace(campaign, table=kept.append_column(TOUCH, pa.array(labels, pa.string())))
