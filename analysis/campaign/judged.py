"""Association of musicians' judgements of touch (soft, medium, hard) with measured quantities.

Each quantity is fitted alone by the proportional-odds model (McCullagh, J. R. Stat. Soc. B 42,
1980)

    P(touch <= k) = 1 / (1 + exp(b x - c_k)).

x is the logarithm of the quantity, or its value if not all values are positive, divided by its
standard deviation. exp(b) is the odds ratio of a harder judgement. Somers' D needs no model: it is
the fraction of pairs of different judgements that the quantity puts in the same order, minus the
fraction of pairs that it puts in the opposite order.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray
from scipy.stats import false_discovery_control, norm

from sautereau.analysis.campaign.row import LEVELS, TOUCH
from sautereau.analysis.campaign.shape import SHAPE
from sautereau.analysis.campaign.table import MOST_ROWS, Campaign
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.session.repeatability import COVERAGE, Spread
from sautereau.rig.csv_files import read_rows
from sautereau.rig.faults import fault_list
from sautereau.rig.units import shown
from sautereau.trajectory.motion import Floats

KEYS = ("path", "session", "plectrum", "rig")
"""Columns of a campaign by which a table of judgements may identify presses."""
JUDGED = "judged"  # Column of what a row of a table of judgements names; null of a press


def judgements(
    data: pd.DataFrame, columns: list[str]
) -> tuple[NDArray[np.intp], dict[str, Floats]]:
    """Return the level of each judgement, and the mean of each column over its presses.

    A row of `with_labels` that names a session, plectrum or rig is one judgement. Of others, if all
    presses of a session have the same judgement, they count as one, since they are not independent;
    otherwise each press of the session counts as one.

    Returns:
        Indices into `LEVELS`, shape (n_judgements,); and arrays of that shape, with NaN where no
        press has the quantity. Warm-up presses and presses without a pluck are excluded.
    """
    used: Any = data[data[TOUCH].notna() & (data["plucks"] > 0) & ~data["warm_up"].astype(bool)]
    levels = used[TOUCH].cat.codes
    sessions = used.groupby(["plectrum", "session"]).ngroup()
    several = levels.groupby(sessions).transform("nunique") > 1
    units = sessions.where(~several, len(used) + np.arange(len(used)))
    if JUDGED in used:
        rows = used[JUDGED].astype(object)
        units = units.where(rows.isna(), -1 - rows.groupby(rows).ngroup())
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
        raise AnalysisError(fault_list(origin, faults[:20]))
    before = table[TOUCH].to_pylist() if TOUCH in table.column_names else [None] * len(table)
    names = table[key].to_pylist()
    labels = [given.get(n, b) for n, b in zip(names, before, strict=True)]
    rows = [n if n in given and key != "path" else None for n in names]
    kept = table.select([name for name in table.column_names if name not in (TOUCH, JUDGED)])
    for name, values in ((TOUCH, labels), (JUDGED, rows)):
        kept = kept.append_column(name, pa.array(values, pa.string()))
    return replace(campaign, table=kept)


MEASURED = (
    "release_force",
    "force_slope",
    "force_drop",
    "contact_force",
    "peak_force",
    "held_work",
    "press_work",
    "pluck_duration",
    "held_deflection",
    "release_rise",
)  # Columns that are compared with the judgements; `sautereau.rig.quantities` defines them
DESCRIBED = ("jack_speed", *SHAPE, "plectrum_tip_compliance", "plectrum_contact_compliance")
"""Columns of the rig that are compared with them where they vary."""
FEW = 10  # Number of judgements below which intervals are not reliable
FEW_OF_A_LEVEL = 3  # Number of judgements of one level below which intervals are not reliable
LEAST = 4  # Number of judgements below which nothing is compared
RESAMPLES = 999  # Number of bootstrap samples for Somers' D, and of permutations of the judgements
INSTALL = "install statsmodels: pip install 'sautereau[ordinal]'"

Fit = Callable[[Floats, NDArray[np.intp]], Spread | None]


@dataclass(frozen=True)
class Association:
    """The association of one quantity with the judgements."""

    judgements: int
    """Number of judgements with this quantity."""
    means: dict[str, float]
    """Mean of each level, SI units; the geometric mean if all values are positive."""
    somers_d: Spread
    """From -1 to 1; 1 if the quantity orders all judgements from soft to hard."""
    p_value: float
    """Fraction of permuted judgements with a Somers' D of at least this magnitude."""
    q_value: float
    """False discovery rate over all quantities (Benjamini, Hochberg)."""
    odds_ratio: Spread | None
    """Odds ratio of a harder judgement per standard deviation; None without a fit."""
    separated: bool
    """Whether the levels do not overlap. The odds ratio then has no finite estimate."""


@dataclass(frozen=True)
class Judged:
    """Judgements of touch and their associations."""

    judgements: dict[str, int]
    """Number of judgements of each level: of a table, its rows; else a session with one judgement
    counts once."""
    quantities: dict[str, Association]
    """By the names of `MEASURED` and `DESCRIBED`, the strongest association first."""
    notes: tuple[str, ...]
    """Limitations of the result, and how to remove them."""


def find_judged(campaign: Campaign) -> Judged | None:
    """Compare the judgements of touch with each measured quantity; None without judgements.

    Warm-up presses and presses without a pluck of a known string are excluded. Of a press with
    several, the quantities are those of the string with the lowest number.
    """
    data = campaign.data
    if TOUCH not in data or "plucks" not in data or not len(data[TOUCH].dropna()):
        return None
    data = campaign.plucks
    if "string" in data:
        data = data.sort_values("string", kind="stable").drop_duplicates("path").sort_index()
    varying = [n for n in DESCRIBED if n in data and len(set(data[n])) > 1]
    columns = [*(name for name in MEASURED if name in data), *varying]
    codes, values = judgements(data, columns)
    counts = {level: int(np.count_nonzero(codes == k)) for k, level in enumerate(LEVELS)}
    shown = ", ".join(f"{count} {level}" for level, count in counts.items())
    if len(codes) < LEAST or len(set(codes)) < 2:
        few = (
            f"{shown}: too few judgements to compare, which takes {LEAST} of two levels; judge more"
            " sessions"
        )
        return Judged(counts, {}, (few,))
    notes = []
    if len(codes) < FEW or any(0 < count < FEW_OF_A_LEVEL for count in counts.values()):
        notes.append(
            f"{shown}: the intervals are not reliable below {FEW} judgements and {FEW_OF_A_LEVEL}"
            " of each level; judge more sessions"
        )
    fit = _fitter(notes)
    found = {}
    for name in columns:
        there = np.isfinite(values[name])
        own, x = codes[there], values[name][there]
        if len(x) < LEAST or len(set(own)) < 2 or np.ptp(x) == 0:
            notes.append(f"{name}: not compared, {len(x)} judgements have it")
        else:
            found[name] = _association(name, x, own, fit, notes)
    rates = false_discovery_control([one.p_value for one in found.values()]) if found else []
    rated = [
        (name, replace(one, q_value=float(rate)))
        for (name, one), rate in zip(found.items(), rates, strict=True)
    ]
    rated.sort(key=lambda item: -abs(item[1].somers_d.value))
    return Judged(counts, dict(rated), tuple(notes))


def _fitter(notes: list[str]) -> Fit | None:
    """Return a function that gives the odds ratio of a quantity, or None if its fit fails."""
    try:
        from statsmodels.miscmodels.ordinal_model import OrderedModel
    except ImportError:
        notes.append(f"no odds ratios, which need ordinal regression; {INSTALL}")
        return None

    def fit(scaled: Floats, codes: NDArray[np.intp]) -> Spread | None:
        present = np.unique(codes, return_inverse=True)[1]
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a fit that has not converged is discarded
            try:
                model = OrderedModel(present, scaled[:, None], distr="logit")
                result = model.fit(method="bfgs", maxiter=500, disp=False)
                slope, std = float(result.params[0]), float(result.bse[0])
                reach = float(norm.ppf((1 + COVERAGE) / 2)) * std
                ends = np.exp([slope, slope - reach, slope + reach])
            except (Warning, ValueError, ArithmeticError, np.linalg.LinAlgError):
                return None
        return Spread(*map(float, ends)) if np.isfinite(ends).all() else None

    return fit


def _association(
    name: str, values: Floats, codes: NDArray[np.intp], fit: Fit | None, notes: list[str]
) -> Association:
    positive = bool((values > 0).all())
    x = np.log(values) if positive else values
    means = {
        level: float(np.exp(x[codes == k].mean()) if positive else x[codes == k].mean())
        for k, level in enumerate(LEVELS)
        if (codes == k).any()
    }
    # Whether the quantity orders the levels completely, upwards or downwards.
    pairs = list(pairwise([x[codes == code] for code in np.unique(codes)]))
    separated = all(low.max() <= high.min() for low, high in pairs)
    separated = separated or all(low.min() >= high.max() for low, high in pairs)
    odds = None
    if separated:
        notes.append(
            f"{name}: the levels do not overlap, so the odds ratio has no finite estimate; judge"
            " more plectra between the levels"
        )
    elif fit is not None:
        odds = fit((x - x.mean()) / x.std(), codes)
        if odds is None:
            notes.append(f"{name}: no odds ratio, the regression diverged; judge more sessions")
    somers, p_value = _somers(x, codes)
    return Association(len(x), means, somers, p_value, p_value, odds, separated)


def _somers(x: Floats, codes: NDArray[np.intp]) -> tuple[Spread, float]:
    """Return Somers' D with its bootstrap interval, and the p-value of a permutation test."""
    random = np.random.default_rng(0)
    value = _somers_d(x, codes)
    drawn = random.integers(0, len(x), (RESAMPLES, len(x)))
    resampled = [d for i in drawn if np.isfinite(d := _somers_d(x[i], codes[i]))]
    permuted = [abs(_somers_d(x, random.permutation(codes))) for _ in range(RESAMPLES)]
    beyond = np.count_nonzero(np.array(permuted) >= abs(value) * (1 - 1e-12))
    tail = (1 - COVERAGE) / 2
    low, high = np.quantile(resampled, [tail, 1 - tail])
    return Spread(value, float(low), float(high)), (1 + beyond) / (1 + RESAMPLES)


def _somers_d(x: Floats, codes: NDArray[np.intp]) -> float:
    """Return Somers' D (Am. Sociol. Rev. 27, 1962); NaN for a single level."""
    levels = [np.sort(x[codes == code]) for code in np.unique(codes)]
    ordered = pairs = 0
    for low, high in combinations(levels, 2):
        below = np.searchsorted(low, high) + np.searchsorted(low, high, "right")
        ordered += int((below - len(low)).sum())
        pairs += len(low) * len(high)
    return ordered / pairs if pairs else float("nan")
