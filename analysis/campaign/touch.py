"""Touch: the force at the key as a function of the plectrum's shape, and its repeatability.

The model is linear in the logarithms, because ratios of forces are what is perceived and what
varies:

    ln y = a + sum e_i ln(shape_i) + conditions + plectrum + session + press.

y increases by e_i per cent if a dimension of the shape increases by one per cent. Plectrum, session
and press are independent normal deviations (mixed model). The standard deviation of presses is the
repeatability within a session, and that of sessions is the effect of a new set-up. That of plectra
is estimated twice: without the shape, and with it.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.campaign.table import Campaign
from sautereau.analysis.campaign.variance import Components, Nested, fit_nested
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.session.repeatability import COVERAGE, Spread
from sautereau.rig.faults import fault_list
from sautereau.trajectory.motion import Floats

if TYPE_CHECKING:
    import pandas as pd

FELT = ("release_force", "force_slope", "force_drop")
"""Columns of a campaign that describe touch; `sautereau.rig.quantities` defines them."""
MOST_OMITTED = 0.05
"""Largest fraction of a plectrum's presses without a quantity for which exponents are estimated."""


@dataclass(frozen=True)
class Plectrum:
    """The touch of one plectrum: geometric means with 95 % intervals."""

    name: str
    """Value of the campaign's column `plectrum`."""
    rig: str
    presses: int
    sessions: int
    shape: dict[str, float]
    """By the columns of `SHAPE`, SI units."""
    tip_stiffness: float
    """N/m, 3 EI / length^3 for a uniform section."""
    felt: dict[str, Spread]
    """By the names of `FELT` that its presses have, SI units; all its presses are used, under any
    conditions."""


@dataclass(frozen=True)
class Exponent(Spread):
    """Increase of a quantity in per cent if another one increases by one per cent."""

    std: float
    """Standard uncertainty."""


@dataclass(frozen=True)
class Felt:
    """One quantity over all plectra; standard deviations relative to it, dimensionless."""

    presses: int
    """Number of presses in which it is above 0."""
    omitted: int
    """Number of other plucks. They are omitted for this quantity only."""
    press: Spread
    """Standard deviation of presses within a session: the repeatability."""
    session: Spread | None
    """Standard deviation of sessions with one plectrum; None if no plectrum has two sessions of
    several presses."""
    plectrum: Spread | None
    """Standard deviation of plectra; None for a single plectrum."""
    unexplained: Spread | None
    """Standard deviation of plectra that their shape does not explain; None without exponents."""
    exponents: dict[str, Exponent]
    """By the columns of `SHAPE` that vary; empty if they are not identifiable."""


@dataclass(frozen=True)
class Touch:
    """The touch of all plectra of a campaign."""

    simulated: bool
    """Whether the stand-in made any of the presses."""
    presses: int
    """Number of presses that were compared."""
    sessions: int
    plectra: tuple[Plectrum, ...]
    """Ordered by the stiffness of their tips."""
    felt: dict[str, Felt]
    """By the names of `FELT` that presses have."""
    notes: tuple[str, ...]
    """Excluded presses, and what is not identifiable and how to change that."""


def find_touch(campaign: Campaign) -> Touch:
    """Fit the force at the key as a function of the plectrum's shape, and divide its spread.

    Warm-up presses, presses without a pluck, and plucks of an unknown string are excluded. A pluck
    counts for the plectrum of its string; one whose quantity is missing or not above 0 is omitted
    for that quantity only.

    Raises:
        AnalysisError: Too few presses remain for a spread of any quantity.
    """
    presses, notes = _selected(campaign)
    felt: dict[str, Felt] = {}
    means: dict[str, dict[str, Spread]] = {}
    reasons: dict[str, list[str]] = {}
    few: list[str] = []
    for name in FELT:
        fitted, omitted = _with_positive(presses, name)
        number = len(set(fitted["plectrum"]))
        if len(fitted) < max(2, number + 1):
            few.append(
                f"{name}: {len(fitted)} presses of {number} plectra give no spread; press each"
                " plectrum several times"
            )
            continue
        felt[name], means[name], why = _fit(name, fitted, omitted)
        for reason in why:
            reasons.setdefault(reason, []).append(name)
    if not felt:
        raise AnalysisError(fault_list(f"touch of {campaign.path}", [*few, *notes]))
    notes += few
    for reason, names in reasons.items():
        everywhere = len(names) == len(felt)
        notes.append(reason if everywhere else f"{', '.join(names)}: {reason}")
    each = [_plectrum(own, means) for _, own in presses.groupby("plectrum")]
    each.sort(key=lambda plectrum: plectrum.tip_stiffness)
    simulated = presses["simulated"].to_numpy(bool)
    if 0 < simulated.sum() < len(presses):
        notes.append("this campaign mixes presses of the stand-in and of an instrument")
    sessions = sum(plectrum.sessions for plectrum in each)
    count = len(set(presses["path"]))
    return Touch(bool(simulated.any()), count, sessions, tuple(each), felt, tuple(notes))


def _selected(campaign: Campaign) -> "tuple[pd.DataFrame, list[str]]":
    """Return the plucks that can be compared, and notes about the others."""
    data = campaign.data
    missing = [name for name in ("warm_up", "plucks", *FELT) if name not in data]
    if missing:
        raise AnalysisError(
            f"touch of {campaign.path}: no column {', '.join(missing)}, so no press with a pluck;"
            " give a campaign of presses that pluck a string"
        )
    warm_up = data["warm_up"].to_numpy(bool)
    plucked = data["plucks"].to_numpy() > 0
    notes = [
        f"excluded {what}: {int(which.sum())}"
        for which, what in (
            (warm_up, "warm-up presses"),
            (~warm_up & ~plucked, "presses without a pluck"),
        )
        if which.any()
    ]
    kept = campaign.plucks.loc[lambda each: ~each["warm_up"].astype(bool)].reset_index(drop=True)
    if "string" in data and (unknown := int(data.loc[~warm_up, "plucks"].sum()) - len(kept)):
        notes.append(f"excluded plucks of an unknown string: {unknown}")
    if len(kept) < 2:
        excluded = f" ({'; '.join(notes)})" if notes else ""
        raise AnalysisError(
            f"touch of {campaign.path}: {len(kept)} plucks to compare{excluded}, and a spread"
            " needs 2 or more; make more presses"
        )
    return kept, notes


def _with_positive(presses: "pd.DataFrame", name: str) -> "tuple[pd.DataFrame, dict[str, int]]":
    """Return the presses with a positive quantity, and the number of others by plectrum."""
    positive = presses[name].to_numpy(float) > 0
    without = presses.loc[~positive, "plectrum"].value_counts()
    return presses.loc[positive].reset_index(drop=True), without.to_dict()


def _fit(
    name: str, presses: "pd.DataFrame", omitted: dict[str, int]
) -> tuple[Felt, dict[str, Spread], list[str]]:
    """Return the fit of one quantity, its mean by plectrum, and notes on what is missing."""
    groups = _numbers(presses, ["plectrum"])
    subgroups = _numbers(presses, ["plectrum", "session"])
    plectra = int(groups.max()) + 1
    notes = []
    several = max(len(set(subgroups[groups == g])) for g in range(plectra)) > 1
    by_session = several and int(np.bincount(subgroups).max()) > 1
    if not by_session:
        subgroups = groups
        notes.append(
            "no plectrum has two sessions of several presses: the spread between plectra includes"
            " the effect of a new set-up; press some of them in a second session"
        )
    conditions = logs(presses, CONDITIONS)
    if collinear(conditions):
        conditions = {name: conditions[name] for name in CONDITIONS[:1]}
    shape = logs(presses, SHAPE)
    reason = not_identifiable(shape, conditions, plectra) or _selective(presses, omitted)
    if reason:
        shape = {}
        notes.append(reason)
    if omitted:
        notes.append(
            f"omitted from this quantity alone: {sum(omitted.values())} presses, in which it is"
            " missing or not above 0; look at their recordings"
        )
    regressors = np.column_stack([np.ones(len(presses)), *conditions.values()])
    values = np.log(presses[name].to_numpy(float))
    data = Nested(values - values.mean(), regressors, groups, subgroups)
    found = fit_nested(data, subgroups=by_session, groups=plectra > 1)
    names = sorted(presses["plectrum"].unique())  # in the order of the groups' numbers
    spreads = _means(values, found, groups, subgroups)
    parts = found.residual, found.subgroup, found.group
    unexplained = _exponents(data, shape, by_session, plectra)
    felt = Felt(len(set(presses["path"])), sum(omitted.values()), *parts, *unexplained)
    return felt, dict(zip(names, spreads, strict=True)), notes


def _selective(presses: "pd.DataFrame", omitted: dict[str, int]) -> str:
    """Return why the omitted presses would bias exponents; empty if they do not."""
    used = presses["plectrum"].value_counts().to_dict()
    most = max((n / (n + used.get(p, 0)) for p, n in omitted.items()), default=0.0)
    if most <= MOST_OMITTED:
        return ""
    return (
        f"{100 * most:.0f} % of the presses of a plectrum have no positive value; the others are"
        f" the larger ones, and exponents from them would be too large, so there are none above"
        f" {100 * MOST_OMITTED:.0f} %: reduce the noise of the force"
    )


def _numbers(presses: "pd.DataFrame", columns: list[str]) -> NDArray[np.intp]:
    """Return the number, from 0, of each press's group. Values in these columns are equal in it."""
    return presses.groupby(columns).ngroup().to_numpy(np.intp)


def _exponents(
    data: Nested, shape: dict[str, Floats], by_session: bool, plectra: int
) -> tuple[Spread | None, dict[str, Exponent]]:
    """Return the spread of plectra that their shape does not explain, and the exponents."""
    from scipy.stats import t

    if not shape:
        return None, {}
    columns = np.column_stack([data.columns, *shape.values()])
    shaped = fit_nested(replace(data, columns=columns), subgroups=by_session, groups=True)
    values = shaped.coefficients[-len(shape) :].tolist()
    stds = np.sqrt(np.diag(shaped.covariance))[-len(shape) :].tolist()
    reach = float(t.ppf((1 + COVERAGE) / 2, plectra - len(shape) - 1))
    return shaped.group, {
        name: Exponent(value, value - reach * std, value + reach * std, std)
        for name, value, std in zip(shape, values, stds, strict=True)
    }


def _means(
    values: Floats, found: Components, groups: NDArray[np.intp], subgroups: NDArray[np.intp]
) -> list[Spread]:
    """Return the geometric mean of each group; its sessions are weighted by inverse variance.

    The interval is Student's, with the degrees of freedom of the spread that counts most: of the
    sessions if they differ, otherwise of the presses.
    """
    from scipy.stats import t

    counts = np.bincount(subgroups)
    between = found.subgroup.value if found.subgroup else 0.0
    weights = 1 / (between**2 + found.residual.value**2 / counts)
    means = np.bincount(subgroups, values) / counts
    parents = np.empty(len(counts), np.intp)
    parents[subgroups] = groups
    total = np.bincount(parents, weights)
    centre = np.bincount(parents, weights * means) / total
    free = len(counts) - len(total) if between else len(values) - len(counts)
    reach = float(t.ppf((1 + COVERAGE) / 2, free)) / np.sqrt(total)
    ends = np.exp([centre, centre - reach, centre + reach])
    return [Spread(*map(float, column)) for column in ends.T]


def _plectrum(own: "pd.DataFrame", means: dict[str, dict[str, Spread]]) -> Plectrum:
    """Return one plectrum from its presses and the means of each quantity by plectrum."""
    first = own.iloc[0]
    name = str(first["plectrum"])
    stiffness = float(first["plectrum_bending_stiffness"])
    return Plectrum(
        name=name,
        rig=str(first["rig"]),
        presses=len(own),
        sessions=len(set(own["session"])),
        shape={column: float(first[column]) for column in SHAPE},
        tip_stiffness=3 * stiffness / float(first["plectrum_length"]) ** 3,
        felt={felt: spreads[name] for felt, spreads in means.items() if name in spreads},
    )


if TYPE_CHECKING:
    import pandas as pd

SHAPE = (
    "plectrum_length",
    "plectrum_width",
    "plectrum_thickness",
    "plectrum_overlap",
    "plectrum_youngs_modulus",
)
"""Columns of a plectrum's shape and material. Those that vary get an exponent."""
CONDITIONS = ("jack_speed", "string_stiffness")
"""Columns that change the touch of a given plectrum. Those that vary are regressors."""
LEAST_RANGE = 1e-6  # Range of a column's logarithm below which the column counts as constant
LEAST_SINGULAR = 1e-3
"""Ratio of the smallest to the largest singular value of the normalised regressors below which they
are collinear. Their exponents are not identifiable then."""


def logs(presses: "pd.DataFrame", columns: tuple[str, ...]) -> dict[str, Floats]:
    """Return the logarithms of the columns that vary, each minus its mean."""
    found = {name: np.log(presses[name].to_numpy(float)) for name in columns}
    return {name: v - v.mean() for name, v in found.items() if np.ptp(v) > LEAST_RANGE}


def not_identifiable(shape: dict[str, Floats], conditions: dict[str, Floats], plectra: int) -> str:
    """Return why exponents of the shape are not identifiable; empty if they are."""
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
    if collinear(shape | conditions):
        return (
            f"{', '.join(shape | conditions)} vary together, so their exponents are not"
            " identifiable; press plectra that differ in one of them alone"
        )
    return ""


def collinear(columns: dict[str, Floats]) -> bool:
    """Return whether columns are linearly dependent."""
    if not columns:
        return False
    matrix = np.column_stack(list(columns.values()))
    singular = np.linalg.svd(matrix / np.linalg.norm(matrix, axis=0), compute_uv=False)
    return bool(singular[-1] <= LEAST_SINGULAR * singular[0])
