"""How plectra feel: the force at the key over their shape, and how alike their presses are.

Every quantity is compared by its logarithm, for forces are felt, and spread, by their ratios:

    ln y = a + sum e_i ln(shape_i) + conditions + plectrum + session + press,

where the exponent e_i says by how many per cent y grows with one per cent of a shape's number, and
plectrum, session and press are independent normal deviations. That of the press is the
repeatability within a session; that of the session what setting up anew changes; that of the
plectrum what tells one plectrum from another, told without the shape and once more beside it.
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
"""Columns of a campaign that describe the touch."""
SHAPE = (
    "plectrum_length",
    "plectrum_width",
    "plectrum_thickness",
    "plectrum_overlap",
    "plectrum_youngs_modulus",
)
"""Columns that make a plectrum's shape; those that vary are told of."""
CONDITIONS = ("jack_speed", "string_stiffness")
"""Columns that change the touch of one plectrum; taken into account where they vary."""
VARIES = 1e-6
"""1, of a column's range over its mean, below which it does not vary."""
LEAST_APART = 1e-3
"""1, of the smallest singular value of the shapes over the largest, each scaled to 1: below, some
of them vary together and cannot be told apart."""


@dataclass(frozen=True)
class Plectrum:
    """What one plectrum feels like: geometric means with intervals of 95 %."""

    name: str
    """Of the campaign's column `plectrum`."""
    rig: str
    presses: int
    sessions: int
    shape: dict[str, float]
    """SI, by the columns of `SHAPE`."""
    tip_stiffness: float
    """N/m, 3 EI / length^3 of a uniform section."""
    felt: dict[str, Spread]
    """SI, by the names of `FELT`; of its presses as they were made, whatever the conditions."""


@dataclass(frozen=True)
class Exponent:
    """By how many per cent a quantity grows with one per cent of another."""

    value: float
    std: float
    """Standard uncertainty."""
    low: float
    """Lower end of the 95 % interval."""
    high: float
    """Upper end of the 95 % interval."""


@dataclass(frozen=True)
class Felt:
    """One felt quantity over all plectra; standard deviations relative to it, 1."""

    press: Spread
    """Of presses within a session: the repeatability."""
    session: Spread | None
    """Of sessions of one plectrum; None where no plectrum has two sessions of several presses."""
    plectrum: Spread | None
    """Of plectra; None for a single one."""
    unexplained: Spread | None
    """Of plectra, beyond what the shape explains; None without exponents."""
    exponents: dict[str, Exponent]
    """By the columns of `SHAPE` that vary; empty where there are too few plectra."""


@dataclass(frozen=True)
class Touch:
    """What a campaign says about touch."""

    simulated: bool
    """Whether a stand-in made any of the presses."""
    presses: int
    """That were compared."""
    sessions: int
    plectra: tuple[Plectrum, ...]
    """In the order of their tips' stiffness."""
    felt: dict[str, Felt]
    """By the names of `FELT`."""
    notes: tuple[str, ...]
    """What was left out, and what cannot be told, with the remedy."""


def find_touch(campaign: Campaign) -> Touch:
    """Relate the force at the key to the plectrum, and part the spread into its sources.

    Warm-up presses and presses without a pluck are left out; of several plucks, the first counts.

    Raises:
        AnalysisError: Too few presses are left to tell a spread.
    """
    presses, notes = _selected(campaign)
    groups = _numbers(presses, ["plectrum"])
    subgroups = _numbers(presses, ["plectrum", "session"])
    plectra = int(groups.max()) + 1
    if len(presses) == plectra:
        raise AnalysisError(
            f"touch of {campaign.path}: {len(presses)} presses of {plectra} plectra, so no"
            " spread; press each plectrum several times"
        )
    sessions = [len(set(subgroups[groups == g])) for g in range(plectra)]
    by_session = max(sessions) > 1 and int(np.bincount(subgroups).max()) > 1
    if not by_session:
        subgroups = groups
        notes.append(
            "no plectrum has two sessions of several presses: what differs between plectra holds"
            " what setting up anew changes; press some of them in a second session"
        )
    conditions = _logs(presses, CONDITIONS)
    if not _apart(conditions):
        conditions = {name: conditions[name] for name in CONDITIONS[:1]}
    shape = _logs(presses, SHAPE)
    doubts = _doubts(shape, conditions, plectra)
    if doubts:
        shape = {}
    notes += doubts
    plain = np.column_stack([np.ones(len(presses)), *conditions.values()])
    felt, means = {}, {}
    for name in FELT:
        values = np.log(presses[name].to_numpy())
        data = Nested(values - values.mean(), plain, groups, subgroups)
        found = fit_nested(data, subgroups=by_session, groups=plectra > 1)
        means[name] = _means(values, found, groups, subgroups)
        felt[name] = _felt(data, found, shape, by_session, plectra)
    told = [_plectrum(presses, groups, g, sessions[g], means) for g in range(plectra)]
    told.sort(key=lambda plectrum: plectrum.tip_stiffness)
    simulated = presses["simulated"].to_numpy(bool)
    if 0 < simulated.sum() < len(presses):
        notes.append("presses of the stand-in and of an instrument are compared with each other")
    return Touch(
        bool(simulated.any()), len(presses), sum(sessions), tuple(told), felt, tuple(notes)
    )


def _selected(campaign: Campaign) -> "tuple[pd.DataFrame, list[str]]":
    """Return the presses that can be compared, and which were left out."""
    data = campaign.data
    lacking = [name for name in ("plucks", *FELT) if name not in data]
    if lacking:
        raise AnalysisError(
            f"touch of {campaign.path}: it has no {', '.join(lacking)}, so no press with a pluck;"
            " give a campaign of presses that sound"
        )
    warm_up = data["warm_up"].to_numpy(bool)
    mute = ~warm_up & (data["plucks"].to_numpy() == 0)
    felt = np.stack([data[column].to_numpy(float) for column in FELT])
    sound = ~warm_up & ~mute
    odd = sound & ~(felt > 0).all(axis=0)
    notes = [
        f"left out: {int(which.sum())} {what}"
        for which, what in (
            (warm_up, "warm-up presses"),
            (mute, "presses without a pluck"),
            (
                odd,
                "presses whose release force, force slope or force drop is not above 0",
            ),
        )
        if which.any()
    ]
    kept = data.loc[sound & ~odd].reset_index(drop=True)
    if len(kept) < 2:
        left = "; ".join(notes) or "it holds no more"
        raise AnalysisError(
            f"touch of {campaign.path}: {len(kept)} presses to compare, and a spread needs 2 or"
            f" more ({left}); press more often"
        )
    return kept, notes


def _numbers(presses: "pd.DataFrame", columns: list[str]) -> NDArray[np.intp]:
    """Return the number, from 0, of what each press is of."""
    return presses.groupby(columns).ngroup().to_numpy(np.intp)


def _logs(presses: "pd.DataFrame", columns: tuple[str, ...]) -> dict[str, Floats]:
    """Return the logarithms, about their mean, of the columns that vary."""
    logs = {name: np.log(presses[name].to_numpy(float)) for name in columns}
    return {name: v - v.mean() for name, v in logs.items() if np.ptp(v) > VARIES}


def _doubts(shape: dict[str, Floats], conditions: dict[str, Floats], plectra: int) -> list[str]:
    """Return why exponents of the shape cannot be told."""
    if not shape:
        return ["all plectra have one shape: nothing is told of its influence; press others"]
    if plectra < len(shape) + 2:
        return [
            f"{plectra} plectra that differ in {', '.join(shape)} are too few for exponents: it"
            f" takes {len(shape) + 2}; press more plectra"
        ]
    if not _apart(shape | conditions):
        return [
            f"{', '.join(shape | conditions)} vary together, so that their influences cannot be"
            " told apart; press plectra that differ in one of them alone"
        ]
    return []


def _apart(logs: dict[str, Floats]) -> bool:
    """Return whether columns vary each in a way of its own."""
    if not logs:
        return True
    matrix = np.column_stack(list(logs.values()))
    singular = np.linalg.svd(matrix / np.linalg.norm(matrix, axis=0), compute_uv=False)
    return bool(singular[-1] > LEAST_APART * singular[0])


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
            value = float(shaped.mean[place])
            std = float(np.sqrt(shaped.covariance[place, place]))
            exponents[name] = Exponent(value, std, value - reach * std, value + reach * std)
    return Felt(found.rest, found.subgroup, found.group, unexplained, exponents)


def _means(
    values: Floats, found: Components, groups: NDArray[np.intp], subgroups: NDArray[np.intp]
) -> list[Spread]:
    """Return the geometric mean of each group, its sessions weighted by what they tell."""
    from scipy.stats import norm

    counts = np.bincount(subgroups)
    between = found.subgroup.value if found.subgroup else 0.0
    weights = 1 / (between**2 + found.rest.value**2 / counts)
    means = np.bincount(subgroups, values) / counts
    parents = np.empty(len(counts), np.intp)
    parents[subgroups] = groups
    total = np.bincount(parents, weights)
    middle = np.bincount(parents, weights * means) / total
    reach = float(norm.ppf((1 + COVERAGE) / 2)) / np.sqrt(total)
    ends = np.exp([middle, middle - reach, middle + reach])
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
