"""The result of a fit: values, uncertainties and identifiability.

The right singular vectors of the scaled Jacobian are combinations of parameters. The singular
values are the inverses of their standard uncertainties.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.identify.compliant import fit_presses
from sautereau.analysis.identify.elastic import doubtful_modes, mode_names
from sautereau.analysis.identify.fit import Fit, informative, rms
from sautereau.analysis.identify.fixed import (
    SUGGESTED,
    Sensitivity,
    Suggestion,
    sensitivities,
    suggestions,
)
from sautereau.analysis.identify.parameter_names import CONTACT, FRICTION, INERTIA
from sautereau.analysis.identify.parameters import Parameter, Prior, with_parameters
from sautereau.analysis.identify.problem import AT_BOUND, Problem
from sautereau.analysis.identify.quality import Quality, quality
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

INTERVAL = 1.96
"""Half width of a 95 % interval, in standard uncertainties."""
UNDETERMINED = 1e-7
"""A combination is undetermined if its singular value is below this fraction of the largest."""
IDENTIFIABLE = 0.025
"""A parameter is identifiable if its standard uncertainty, divided by its scale, is below this. The
ends of its 95 % interval are then at most 5 % of the scale from the value."""
SIGNIFICANT = 3.0
"""A hidden friction is reported as a result if it differs from the rig's value by this number of
standard uncertainties."""
NEAR_BOUND = 1.02
"""Ratio of a compliant key's inertia to a bound up to which it counts as being at the bound."""
LEAST_WEIGHT = 0.1
"""Smallest weight of a parameter that is listed in a combination."""


@dataclass(frozen=True)
class Estimate:
    """A fitted value; SI."""

    name: str
    unit: str
    value: float
    start: float
    """Value at which the fit started, usually the rig's."""
    std: float | None
    """Standard uncertainty from data and prior; None if undetermined."""
    low: float | None
    """Lower end of the 95 % interval; None if undetermined, or if the model does not fit."""
    high: float | None
    """Upper end of the 95 % interval; None as for `low`."""
    at_bound: bool
    """Whether the value is at a bound. The interval then describes the bound and not the data."""
    identifiable: bool
    """Whether the data determine it without its prior while all others are free; see
    `IDENTIFIABLE`."""


@dataclass(frozen=True)
class Combination:
    """A combination of the scaled parameters."""

    weights: dict[str, float]
    """Weight of each parameter's scaled change. The squares sum to 1; small weights are omitted."""
    std: float | None
    """Standard uncertainty of the combination, dimensionless; None if undetermined."""
    identifiable: bool
    """Whether the uncertainty is below `IDENTIFIABLE`."""

    def __str__(self) -> str:
        parts = [f"{'-' if w < 0 else '+'} {abs(w):.2f} {n}" for n, w in self.weights.items()]
        return " ".join(parts).removeprefix("+ ")


@dataclass(frozen=True)
class FittedMode:
    """A fitted elastic mode of the key and the parts that move with it."""

    frequency: float
    """Hz."""
    frequency_std: float | None
    """Hz, standard uncertainty; None if undetermined."""
    damping: float
    """Damping ratio."""
    damping_std: float | None
    """Standard uncertainty of the damping ratio; None if undetermined."""


@dataclass(frozen=True)
class Identified:
    """The identified parameters of presses."""

    rig: Rig
    """The bench with the fitted values."""
    estimates: tuple[Estimate, ...]
    correlation: Floats
    """Correlation coefficients of the estimates, shape (parameters, parameters)."""
    combinations: tuple[Combination, ...]
    """Combinations of parameters, the best determined first; the priors are not used."""
    presses: tuple[str, ...]
    """Names of the recordings."""
    releases: int
    """Number of releases in the recordings."""
    level: str
    """Plectrum model."""
    residual: float
    """N, RMS force residual with the fitted values."""
    residual_before: float
    """N, RMS force residual with the values of the rig."""
    rise_residual: float | None
    """m, RMS residual of the rises at release; None if no press has a release."""
    force_offsets: tuple[float, ...]
    """N, fitted zero of the force in each press; 0 if it was not fitted."""
    modes: tuple[FittedMode, ...]
    """Elastic modes of the key; empty for a rigid key."""
    quality: Quality
    """Goodness of the fit."""
    sensitivity: tuple[Sensitivity, ...]
    """Effects of the fixed numbers on the results, the largest effect first."""
    suggested: tuple[Suggestion, ...]
    """Fixed numbers that should be freed, the best first; empty if the model fits."""
    warnings: tuple[str, ...]


def identify(
    presses: Sequence[Press],
    phases: Sequence[Phases],
    names: Sequence[str],
    priors: Mapping[str, Prior] | None = None,
    *,
    level: str = "elastica",
    starts: int = 3,
    robust: bool = False,
) -> Identified:
    """Fit parameters of a rig to the forces and motions of recorded presses of it.

    Args:
        presses: Recordings of one instrument.
        phases: Phases of these presses, in the same order.
        names: Free parameters, from `parameter_names.NAMES`.
        priors: Prior knowledge of parameters, by name.
        level: Plectrum model.
        starts: Number of starting points: the rig's values, and points between the bounds.
        robust: Weight large residuals linearly instead of quadratically.

    Raises:
        AnalysisError: There is no press or no parameter, or the presses have different rigs.
        ModelError: The model has no solution for the rig's values.
    """
    return evaluate(fit_presses(presses, phases, names, priors, level, starts, robust))


def evaluate(fitted: Fit) -> Identified:
    """Return the result of a fit with its uncertainties."""
    found, values, good = fitted.problem, fitted.values, quality(fitted)
    point = values / found.scales
    data, prior = found.jacobian(point, found.data), found.prior_jacobian(point)
    rows = informative(fitted, data) / np.sqrt(good.repetition)
    lacking = np.zeros((len(values), len(values)))
    if fitted.moved is not None:
        lacking = np.outer(fitted.moved, fitted.moved)
    covariance, known = _covariance(np.vstack([rows, prior]))
    covariance += lacking
    stds = np.where(known, np.sqrt(np.diag(covariance)), np.inf)
    fitted = _with_found_friction(fitted, stds * found.scales)
    found, dynamics = fitted.problem, fitted.problem.dynamics
    suggested = suggestions(fitted, good.scale)
    doubts = (*_hidden_by_fit(suggested), *doubtful_modes(found.free, values, dynamics.presses))
    if fitted.moved is not None:
        doubts += tuple(_inertia_at_bound(found.free, values))
    good = replace(good, reasons=(*good.reasons, *doubts))
    alone, seen = _covariance(np.vstack([rows, prior[found.nuisances]]))
    seen &= np.sqrt(np.diag(alone + lacking)) < IDENTIFIABLE
    shown = [k for k, p in enumerate(found.free) if not p.hidden]
    free = [found.free[k] for k in shown]
    estimates = [
        _estimate(
            found.free[k],
            float(values[k]),
            float(stds[k] * found.scales[k]),
            identifiable=bool(seen[k]),
            fits=good.fits,
        )
        for k in shown
    ]
    forces, rises = dynamics.residuals(values)
    offsets = [float(w.trend(f).mean()) for f, w in zip(forces, found.whitenings, strict=True)]
    deviations = np.outer(stds, stds)
    within = np.isfinite(deviations) & (deviations > 0)
    correlation = np.divide(covariance, deviations, out=np.eye(len(stds)), where=within)
    return Identified(
        rig=with_parameters(dynamics.rig, {e.name: e.value for e in estimates}),
        estimates=tuple(estimates),
        correlation=correlation[np.ix_(shown, shown)],
        combinations=tuple(combinations(_apart(rows, found, shown), [p.name for p in free])),
        presses=tuple(press.name for press in dynamics.presses),
        releases=len(rises),
        level=dynamics.level,
        residual=rms([f - w.trend(f) for f, w in zip(forces, found.whitenings, strict=True)]),
        residual_before=fitted.residual_before,
        rise_residual=rms([rises * dynamics.rise_stds]) if len(rises) else None,
        force_offsets=tuple(offsets),
        modes=_modes(found, values, stds),
        quality=good,
        sensitivity=sensitivities(fitted, data, fitted.excess * good.repetition),
        suggested=() if good.fits else suggested,
        warnings=_warnings(estimates, dynamics),
    )


def _with_found_friction(fitted: Fit, stds: Floats) -> Fit:
    """Return the fit; the plectrum's friction is no longer hidden if it differs from the rig's."""
    dynamics = fitted.problem.dynamics
    free = tuple(
        replace(
            p,
            hidden=p.hidden and (p.name != FRICTION or abs(v - p.start) < SIGNIFICANT * std),
        )
        for p, v, std in zip(dynamics.free, fitted.values.tolist(), stds.tolist(), strict=True)
    )
    if free == dynamics.free:
        return fitted
    return replace(fitted, problem=replace(fitted.problem, dynamics=dynamics.with_free(free)))


def _modes(found: Problem, values: Floats, stds: Floats) -> tuple[FittedMode, ...]:
    """Return the elastic modes among the hidden parameters, ordered by frequency."""
    names = [p.name for p in found.free]
    modes = []
    for number in range(sum(name.endswith(".frequency") for name in names)):
        own = []
        for at in (names.index(name) for name in mode_names(number)[:2]):
            std = float(stds[at] * found.scales[at])
            own += [float(values[at]), std if np.isfinite(std) else None]
        modes.append(FittedMode(*own))
    return tuple(sorted(modes, key=lambda mode: mode.frequency))


def _hidden_by_fit(suggested: Sequence[Suggestion]) -> list[str]:
    """Return reasons why the plectrum's model is wrong although the residuals may be small."""
    return [
        f"{s.name}: freeing it would reduce the weighted sum of squares by {s.reduction:.0f}, and"
        f" {SUGGESTED:.0f} are allowed: the other parameters imitate it"
        for s in suggested
        if s.name in (FRICTION, CONTACT)
    ]


def _inertia_at_bound(free: Sequence[Parameter], values: Floats) -> list[str]:
    """Return a reason if the inertia of a compliant key is at a bound."""
    return [
        f"{INERTIA}: the fit reached a bound at {value:.4g} kg m^2, so that the modes imitate"
        " it: give its range by a prior, or press more slowly"
        for parameter, value in zip(free, values.tolist(), strict=True)
        if parameter.name == INERTIA
        and min(value / parameter.low, parameter.high / value) < NEAR_BOUND
    ]


def _estimate(
    parameter: Parameter, value: float, std: float, *, identifiable: bool, fits: bool
) -> Estimate:
    room = AT_BOUND * (parameter.high - parameter.low)
    known = np.isfinite(std)
    return Estimate(
        name=parameter.name,
        unit=parameter.unit,
        value=value,
        start=parameter.start,
        std=std if known else None,
        low=value - INTERVAL * std if known and fits else None,
        high=value + INTERVAL * std if known and fits else None,
        at_bound=min(value - parameter.low, parameter.high - value) <= room,
        identifiable=identifiable,
    )


def _covariance(jacobian: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Return the covariance of the scaled parameters, and which of them are determined."""
    _, singular, directions = np.linalg.svd(jacobian, full_matrices=False)
    seen = singular > UNDETERMINED * max(float(singular[0]), 1e-300)
    bounded = np.all(np.abs(directions[~seen]) < 1e-3, axis=0)
    kept = directions[seen] / singular[seen, None]
    return kept.T @ kept, bounded


def _apart(data: Floats, found: Problem, shown: Sequence[int]) -> Floats:
    """Return the Jacobian by the reported parameters, orthogonal to that by the hidden ones."""
    hidden = [k for k in range(data.shape[1]) if k not in shown]
    if not hidden:
        return data
    own = np.vstack([data, found.prior_jacobian(np.zeros(data.shape[1]))[found.nuisances]])
    base, _ = np.linalg.qr(own[:, hidden])
    return own[:, shown] - base @ (base.T @ own[:, shown])


def _warnings(estimates: Sequence[Estimate], dynamics: InverseDynamics) -> tuple[str, ...]:
    found: list[str] = []
    by_name = {p.name: p for p in dynamics.free}
    for estimate in estimates:
        if estimate.at_bound:
            p = by_name[estimate.name]
            found.append(
                f"{p.name}: the fit reached a bound at {estimate.value:.4g} {p.unit}, of"
                f" {p.low:.4g} to {p.high:.4g} {p.unit}; widen the range by a prior, or look for"
                " other errors in the rig"
            )
    if thrown := sum(press.thrown for press in dynamics.presses):
        found.append(
            f"in {thrown} of {len(dynamics.presses)} presses the finger struck the key and threw"
            " its jack; what precedes the landing is excluded: let the finger rest on the key"
            " before it presses"
        )
    if not any(len(press.releases) for press in dynamics.presses):
        found.append("no press has a pluck: plectrum, string and clearance are not identifiable")
    return tuple(found)


def combinations(jacobian: Floats, names: Sequence[str]) -> list[Combination]:
    """Return the combinations of parameters, the best determined first.

    Args:
        jacobian: Jacobian of the whitened residuals by the scaled parameters, shape
            (n, parameters).
        names: Names of the parameters.
    """
    _, singular, directions = np.linalg.svd(jacobian, full_matrices=False)
    found = []
    for value, direction in zip(singular, directions, strict=True):
        largest = int(np.argmax(np.abs(direction)))
        direction = direction * np.sign(direction[largest])
        order = np.argsort(-np.abs(direction))
        std = 1 / float(value) if value > 1e-9 * max(float(singular[0]), 1e-300) else None
        found.append(
            Combination(
                {
                    names[int(i)]: float(direction[i])
                    for i in order
                    if abs(direction[i]) >= LEAST_WEIGHT
                },
                std,
                std is not None and std < IDENTIFIABLE,
            )
        )
    return found
