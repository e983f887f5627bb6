"""Touch: the force at the key as a function of the plectrum's shape, and its repeatability.

The model is linear in the logarithms, because ratios of forces are what is perceived and what
varies:

    ln y = a + sum e_i ln(x_i) + plectrum + session + press.

x are the dimensions of the shape, the jack's speed and the string's stiffness; y increases by e_i
per cent if one of them increases by one per cent. Plectrum, session
and press are independent normal deviations (mixed model). The standard deviation of presses is the
repeatability within a session, and that of sessions is the effect of a new set-up. That of plectra
is estimated twice: without the shape, and with it.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.campaign.row import DESCRIBED, LEVELS
from sautereau.analysis.campaign.shape import (
    CONDITIONS,
    LEAST_RANGE,
    SHAPE,
    collinear,
    logs,
    not_identifiable,
)
from sautereau.analysis.campaign.table import Campaign
from sautereau.analysis.campaign.variance import Components, Nested, fit_nested, shared_by
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.press.features import FROM_REST, level_std
from sautereau.analysis.session.repeatability import Spread, interval_of
from sautereau.rig.faults import fault_list
from sautereau.trajectory.motion import Floats

if TYPE_CHECKING:
    import pandas as pd

FELT = ("release_force", "force_slope", "force_drop")  # Columns that describe touch
PLECTRA = 2  # Number of the stratum of what varies between plectra only; see `_stratum`
MOST_OMITTED = 0.05  # Largest fraction of presses without a quantity for which it has exponents


@dataclass(frozen=True)
class Plectrum:
    """The touch of one plectrum: geometric means with 95 % intervals."""

    name: str
    """Value of the campaign's column `plectrum`."""
    rig: str
    presses: int
    sessions: int
    string: int
    """Number of the string that it plucks; 1 if the campaign does not know it."""
    shape: dict[str, float]
    """By the columns of a plectrum's numbers, SI units; those that the campaign has."""
    tip_stiffness: float
    """N/m, force over displacement at the tip: 3 EI / length^3 for a uniform section."""
    felt: dict[str, Spread]
    """By the names of `FELT` that its presses have, SI units; at the campaign's geometric mean of
    the jack's speed, if that varies."""


@dataclass(frozen=True)
class Exponent(Spread):
    """Increase of a quantity in per cent if another one increases by one per cent."""

    std: float
    """Standard uncertainty."""
    degrees: float
    """Degrees of freedom of the interval: of presses, sessions or plectra, wherever the other
    quantity varies (containment); with errors of the fit by Welch and Satterthwaite."""


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
    """By the columns of `CONDITIONS` and `SHAPE` that vary; without those not identifiable."""


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
    hardness: dict[str, tuple[str, ...]]
    """Thirds of the plectra by `LEVELS`, each softest first, by the first of `felt`; empty for
    fewer than three."""
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
        positive = presses[name].to_numpy(float) > 0
        fitted = presses.loc[positive].reset_index(drop=True)
        omitted = presses.loc[~positive, "plectrum"].value_counts().to_dict()
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
    sessions = len(set(presses["session"]))
    count = len(set(presses["path"]))
    first = next(iter(felt))
    ranked = sorted((p.felt[first].value, p.name) for p in each if first in p.felt)
    thirds = np.array_split(np.array([name for _, name in ranked]), len(LEVELS))
    hard: dict[str, tuple[str, ...]] = {}
    if len(ranked) >= len(LEVELS):
        hard |= {level: tuple(own.tolist()) for level, own in zip(LEVELS, thirds, strict=True)}
    return Touch(bool(simulated.any()), count, sessions, tuple(each), felt, hard, tuple(notes))


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
    if "unseen_force" in kept and kept["unseen_force"].notna().any():
        notes.append(FROM_REST)
    if "string" in data and (unknown := int(data.loc[~warm_up, "plucks"].sum()) - len(kept)):
        notes.append(f"excluded plucks of an unknown string: {unknown}")
    if len(kept) < 2:
        excluded = f" ({'; '.join(notes)})" if notes else ""
        raise AnalysisError(
            f"touch of {campaign.path}: {len(kept)} plucks to compare{excluded}, and a spread"
            " needs 2 or more; make more presses"
        )
    return kept, notes


def _fit(
    name: str, presses: "pd.DataFrame", omitted: dict[str, int]
) -> tuple[Felt, dict[str, Spread], list[str]]:
    """Return the fit of one quantity, its mean by plectrum, and notes on what is missing."""
    groups, subgroups = (
        presses.groupby(own).ngroup().to_numpy(np.intp)
        for own in (["plectrum"], ["plectrum", "session"])
    )
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
    between = [v for v in conditions.values() if _stratum(v, groups, subgroups) == PLECTRA]
    selective = _selective(presses, omitted)
    reason = not_identifiable(shape, conditions, plectra - len(between)) or selective
    if reason:
        shape = {}
        notes.append(reason)
    if omitted:
        notes.append(
            f"omitted from this quantity alone: {sum(omitted.values())} presses, in which it is"
            " missing or not above 0; look at their recordings"
        )
    of_fit = "release_std" if name == "release_force" else f"{name}_std"
    if of_fit not in presses or bool(presses[of_fit].isna().to_numpy().any()):
        notes.append(
            f"presses without {of_fit}, whose instants were set by hand or whose table is of an"
            " earlier version, have no error of the fit: intervals may be too narrow"
        )
    regressors = np.column_stack([np.ones(len(presses)), *conditions.values()])
    values = np.log(presses[name].to_numpy(float))
    each = presses.to_dict("records")
    stds = np.nan_to_num([level_std(row, name) for row in each]) / presses[name].to_numpy(float)
    data = Nested(values - values.mean(), regressors, groups, subgroups)
    found = fit_nested(data, subgroups=by_session, groups=plectra > 1)
    names = sorted(presses["plectrum"].unique())  # in the order of the groups' numbers
    at_mean = values
    if "jack_speed" in conditions:  # the others belong to a plectrum's string
        place = 1 + list(conditions).index("jack_speed")
        at_mean = values - found.coefficients[place] * regressors[:, place]
    spreads = _means(at_mean, stds, found, groups, subgroups)
    parts = found.residual, found.subgroup, found.group
    shaped = found
    if shape:
        columns = np.column_stack([regressors, *shape.values()])
        shaped = fit_nested(replace(data, columns=columns), subgroups=by_session, groups=True)
    exponents = {} if selective else _exponents(shaped, conditions | shape, stds)
    unexplained = shaped.group if shape else None
    count = len(set(presses["path"]))
    felt = Felt(count, sum(omitted.values()), *parts, unexplained, exponents)
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


def _stratum(column: Floats, groups: NDArray[np.intp], subgroups: NDArray[np.intp]) -> int:
    """Return where a column varies: between the presses of a session, sessions, or plectra."""
    for stratum, numbers in enumerate((subgroups, groups)):
        low, high = np.full(numbers.max() + 1, np.inf), np.full(numbers.max() + 1, -np.inf)
        np.minimum.at(low, numbers, column)
        np.maximum.at(high, numbers, column)
        if (high - low).max() > LEAST_RANGE:
            return stratum
    return PLECTRA


def _exponents(fitted: Components, columns: dict[str, Floats], stds: Floats) -> dict[str, Exponent]:
    """Return the exponents of regressors, which stand in the fit behind its column of ones.

    Args:
        stds: Relative standard uncertainty of each press by an error that all presses at one value
            of a regressor may share.
    """
    groups, subgroups = fitted.data.groups, fitted.data.subgroups
    strata = [_stratum(column, groups, subgroups) for column in columns.values()]
    counts = [len(groups), int(subgroups.max()) + 1, int(groups.max()) + 1, 1]
    found = {}
    for place, ((name, column), stratum) in enumerate(zip(columns.items(), strata, strict=True), 1):
        free = counts[stratum] - counts[stratum + 1] - strata.count(stratum)
        if free > 0:
            shared = shared_by(fitted, stds, column.round(6).tolist())[:, place]
            value, variance = fitted.coefficients[place], fitted.covariance[place, place]
            ends, std, degrees = interval_of(float(value), float(variance), shared, free)
            found[name] = Exponent(*ends, std, degrees)
    return found


def _means(
    values: Floats,
    stds: Floats,
    found: Components,
    groups: NDArray[np.intp],
    subgroups: NDArray[np.intp],
) -> list[Spread]:
    """Return the geometric mean of each group; its sessions are weighted by inverse variance.

    The interval is Student's, with the degrees of freedom of the spread that counts most: of the
    sessions if they differ, otherwise of the presses; and with the mean of `stds`, the error that
    all presses of a plectrum may share.
    """
    counts = np.bincount(subgroups)
    between = found.subgroup.value if found.subgroup else 0.0
    weights = 1 / (between**2 + found.residual.value**2 / counts)
    means = np.bincount(subgroups, values) / counts
    parents = np.empty(len(counts), np.intp)
    parents[subgroups] = groups
    total = np.bincount(parents, weights)
    centre = np.bincount(parents, weights * means) / total
    free = len(counts) - len(total) if between else len(values) - len(counts)
    shared = np.bincount(groups, stds) / np.bincount(groups)
    each = zip(centre.tolist(), (1 / total).tolist(), shared, strict=True)
    return [Spread(*np.exp(interval_of(*own, free)[0]).tolist()) for own in each]


def _plectrum(own: "pd.DataFrame", means: dict[str, dict[str, Spread]]) -> Plectrum:
    """Return one plectrum from its presses and the means of each quantity by plectrum."""
    first = own.iloc[0]
    name = str(first["plectrum"])
    stiffness = (
        3 * float(first["plectrum_bending_stiffness"]) / float(first["plectrum_length"]) ** 3
    )
    if "plectrum_tip_compliance" in own:  # which a table of an earlier version lacks
        stiffness = 1 / float(first["plectrum_tip_compliance"])
    columns = [*SHAPE, *DESCRIBED]
    return Plectrum(
        name=name,
        rig=str(first["rig"]),
        presses=len(own),
        sessions=len(set(own["session"])),
        string=int(first.get("string") or 1),
        shape={c: float(first[c]) for c in dict.fromkeys(columns) if c in own},
        tip_stiffness=stiffness,
        felt={felt: spreads[name] for felt, spreads in means.items() if name in spreads},
    )
