"""Touch: the force at the key as a function of the plectrum's shape, and its repeatability.

A mixed linear model of the logarithms, because forces are perceived, and spread, by their ratios:

    ln y = a + sum e_i ln(shape_i) + conditions + plectrum + session + press,

where y grows by e_i per cent with one per cent of a dimension of the shape, and plectrum, session
and press are independent normal deviations. The standard deviation of presses is the repeatability
within a session; that of sessions is the effect of a new set-up; that of plectra is estimated
twice, without the shape and with it.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.campaign.table import Campaign
from sautereau.analysis.campaign.variance import Components, Nested, fit_nested
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.session.repeatability import COVERAGE, Spread
from sautereau.trajectory.motion import Floats

if TYPE_CHECKING:
    import pandas as pd

FELT = ("release_force", "force_slope", "force_drop")
"""Columns of a campaign that describe touch; `sautereau.rig.quantities` defines them."""
SHAPE = (
    "plectrum_length",
    "plectrum_width",
    "plectrum_thickness",
    "plectrum_overlap",
    "plectrum_youngs_modulus",
)
"""Columns of a plectrum's shape and material; those that vary get an exponent."""
CONDITIONS = ("jack_speed", "string_stiffness")
"""Columns that change the touch of one plectrum; regressors of the model where they vary."""
LEAST_RANGE = 1e-6
"""1, range of a column's logarithm below which it counts as constant."""
LEAST_SINGULAR = 1e-3
"""1, ratio of smallest to largest singular value of the normalised regressors, below which they
are collinear and their exponents are not identifiable."""


@dataclass(frozen=True)
class Plectrum:
    """Touch of one plectrum: geometric means with 95 % intervals."""

    name: str
    """Value of the campaign's column `plectrum`."""
    rig: str
    presses: int
    sessions: int
    shape: dict[str, float]
    """SI units, by the columns of `SHAPE`."""
    tip_stiffness: float
    """N/m, 3 EI / length^3 of a uniform section."""
    felt: dict[str, Spread]
    """SI units, by the names of `FELT`; of all its presses, whatever their conditions."""


@dataclass(frozen=True)
class Exponent:
    """Growth of a quantity in per cent for one per cent of another."""

    value: float
    std: float
    """Standard uncertainty."""
    low: float
    """Lower end of the 95 % interval."""
    high: float
    """Upper end of the 95 % interval."""


@dataclass(frozen=True)
class Felt:
    """One quantity over all plectra; standard deviations relative to it, dimensionless."""

    press: Spread
    """Of presses within a session: the repeatability."""
    session: Spread | None
    """Of sessions of one plectrum; None where no plectrum has two sessions of several presses."""
    plectrum: Spread | None
    """Of plectra; None for a single plectrum."""
    unexplained: Spread | None
    """Of plectra, after the shape is taken into account; None without exponents."""
    exponents: dict[str, Exponent]
    """By the columns of `SHAPE` that vary; empty where they are not identifiable."""


@dataclass(frozen=True)
class Touch:
    """Touch of all plectra of a campaign."""

    simulated: bool
    """Whether the stand-in made any of the presses."""
    presses: int
    """Number of presses that were compared."""
    sessions: int
    plectra: tuple[Plectrum, ...]
    """Ordered by the stiffness of their tips."""
    felt: dict[str, Felt]
    """By the names of `FELT`."""
    notes: tuple[str, ...]
    """Excluded presses, and quantities that are not identifiable, with how to fix it."""


def find_touch(campaign: Campaign) -> Touch:
    """Fit the force at the key to the plectrum's shape, and split the spread by its sources.

    Warm-up presses and presses without a pluck are excluded; of several plucks, the first counts.

    Raises:
        AnalysisError: Too few presses remain for a spread.
    """
    presses, notes = _selected(campaign)
    groups = _numbers(presses, ["plectrum"])
    subgroups = _numbers(presses, ["plectrum", "session"])
    plectra = int(groups.max()) + 1
    if len(presses) == plectra:
        raise AnalysisError(
            f"touch of {campaign.path}: {len(presses)} presses of {plectra} plectra give no"
            " spread; press each plectrum several times"
        )
    sessions = [len(set(subgroups[groups == g])) for g in range(plectra)]
    by_session = max(sessions) > 1 and int(np.bincount(subgroups).max()) > 1
    if not by_session:
        subgroups = groups
        notes.append(
            "no plectrum has two sessions of several presses: the spread between plectra includes"
            " the effect of a new set-up; press some of them in a second session"
        )
    conditions = _logs(presses, CONDITIONS)
    if _collinear(conditions):
        conditions = {name: conditions[name] for name in CONDITIONS[:1]}
    shape = _logs(presses, SHAPE)
    reason = _not_identifiable(shape, conditions, plectra)
    if reason:
        shape = {}
        notes.append(reason)
    regressors = np.column_stack([np.ones(len(presses)), *conditions.values()])
    felt, means = {}, {}
    for name in FELT:
        values = np.log(presses[name].to_numpy())
        data = Nested(values - values.mean(), regressors, groups, subgroups)
        found = fit_nested(data, subgroups=by_session, groups=plectra > 1)
        means[name] = _means(values, found, groups, subgroups)
        felt[name] = _felt(data, found, shape, by_session, plectra)
    each = [_plectrum(presses, groups, g, sessions[g], means) for g in range(plectra)]
    each.sort(key=lambda plectrum: plectrum.tip_stiffness)
    simulated = presses["simulated"].to_numpy(bool)
    if 0 < simulated.sum() < len(presses):
        notes.append("this campaign mixes presses of the stand-in and of an instrument")
    return Touch(
        bool(simulated.any()), len(presses), sum(sessions), tuple(each), felt, tuple(notes)
    )


def _selected(campaign: Campaign) -> "tuple[pd.DataFrame, list[str]]":
    """Return the presses that can be compared, and notes on those that cannot."""
    data = campaign.data
    missing = [name for name in ("plucks", *FELT) if name not in data]
    if missing:
        raise AnalysisError(
            f"touch of {campaign.path}: no column {', '.join(missing)}, so no press with a pluck;"
            " give a campaign of presses that pluck a string"
        )
    warm_up = data["warm_up"].to_numpy(bool)
    plucked = data["plucks"].to_numpy() > 0
    positive = (data[list(FELT)].to_numpy(float) > 0).all(axis=1)
    notes = [
        f"excluded: {int(which.sum())} {what}"
        for which, what in (
            (warm_up, "warm-up presses"),
            (~warm_up & ~plucked, "presses without a pluck"),
            (
                ~warm_up & plucked & ~positive,
                "presses whose release force, force slope or force drop is not above 0;"
                " look at their recordings",
            ),
        )
        if which.any()
    ]
    kept = data.loc[~warm_up & plucked & positive].reset_index(drop=True)
    if len(kept) < 2:
        excluded = f" ({'; '.join(notes)})" if notes else ""
        raise AnalysisError(
            f"touch of {campaign.path}: {len(kept)} presses to compare{excluded}, and a spread"
            " needs 2 or more; make more presses"
        )
    return kept, notes


def _numbers(presses: "pd.DataFrame", columns: list[str]) -> NDArray[np.intp]:
    """Return the number, from 0, of each press's group of equal values in these columns."""
    return presses.groupby(columns).ngroup().to_numpy(np.intp)


def _logs(presses: "pd.DataFrame", columns: tuple[str, ...]) -> dict[str, Floats]:
    """Return the logarithms, minus their mean, of the columns that vary."""
    logs = {name: np.log(presses[name].to_numpy(float)) for name in columns}
    return {name: v - v.mean() for name, v in logs.items() if np.ptp(v) > LEAST_RANGE}


def _not_identifiable(shape: dict[str, Floats], conditions: dict[str, Floats], plectra: int) -> str:
    """Return why exponents of the shape are not identifiable; empty where they are."""
    if not shape:
        return (
            "all plectra have the same shape, so its exponents are not identifiable; press plectra"
            " of other shapes"
        )
    if plectra < len(shape) + 2:
        return (
            f"{plectra} plectra that differ in {', '.join(shape)} are too few for exponents, which"
            f" need {len(shape) + 2}; press more plectra"
        )
    if _collinear(shape | conditions):
        return (
            f"{', '.join(shape | conditions)} vary together, so their exponents are not"
            " identifiable; press plectra that differ in one of them alone"
        )
    return ""


def _collinear(logs: dict[str, Floats]) -> bool:
    """Return whether columns depend on each other linearly."""
    if not logs:
        return False
    matrix = np.column_stack(list(logs.values()))
    singular = np.linalg.svd(matrix / np.linalg.norm(matrix, axis=0), compute_uv=False)
    return bool(singular[-1] <= LEAST_SINGULAR * singular[0])


def _felt(
    data: Nested, found: Components, shape: dict[str, Floats], by_session: bool, plectra: int
) -> Felt:
    """Return one quantity's spreads and exponents."""
    from scipy.stats import t

    exponents: dict[str, Exponent] = {}
    unexplained = None
    if shape:
        columns = np.column_stack([data.columns, *shape.values()])
        shaped = fit_nested(
            Nested(data.values, columns, data.groups, data.subgroups),
            subgroups=by_session,
            groups=True,
        )
        unexplained = shaped.group
        reach = float(t.ppf((1 + COVERAGE) / 2, plectra - len(shape) - 1))
        places = range(data.columns.shape[1], columns.shape[1])
        for name, place in zip(shape, places, strict=True):
            value = float(shaped.coefficients[place])
            std = float(np.sqrt(shaped.covariance[place, place]))
            exponents[name] = Exponent(value, std, value - reach * std, value + reach * std)
    return Felt(found.residual, found.subgroup, found.group, unexplained, exponents)


def _means(
    values: Floats, found: Components, groups: NDArray[np.intp], subgroups: NDArray[np.intp]
) -> list[Spread]:
    """Return the geometric mean of each group, its sessions weighted by inverse variance."""
    from scipy.stats import norm

    counts = np.bincount(subgroups)
    between = found.subgroup.value if found.subgroup else 0.0
    weights = 1 / (between**2 + found.residual.value**2 / counts)
    means = np.bincount(subgroups, values) / counts
    parents = np.empty(len(counts), np.intp)
    parents[subgroups] = groups
    total = np.bincount(parents, weights)
    centre = np.bincount(parents, weights * means) / total
    reach = float(norm.ppf((1 + COVERAGE) / 2)) / np.sqrt(total)
    ends = np.exp([centre, centre - reach, centre + reach])
    return [Spread(*map(float, column)) for column in ends.T]


def _plectrum(
    presses: "pd.DataFrame",
    groups: NDArray[np.intp],
    number: int,
    sessions: int,
    means: dict[str, list[Spread]],
) -> Plectrum:
    own = presses[groups == number]
    first = own.iloc[0]
    stiffness = float(first["plectrum_bending_stiffness"])
    return Plectrum(
        name=str(first["plectrum"]),
        rig=str(first["rig"]),
        presses=len(own),
        sessions=sessions,
        shape={name: float(first[name]) for name in SHAPE},
        tip_stiffness=3 * stiffness / float(first["plectrum_length"]) ** 3,
        felt={name: spreads[number] for name, spreads in means.items()},
    )
