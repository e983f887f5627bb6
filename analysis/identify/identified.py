"""What a fit has found: values, uncertainties, and what the data cannot tell apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.identify.fit import Fit, fit, inverse_dynamics, rms
from sautereau.analysis.identify.identifiability import IDENTIFIABLE, Combination, combinations
from sautereau.analysis.identify.parameters import FORCE, Parameter, Prior, with_parameters
from sautereau.analysis.identify.problem import AT_BOUND, Problem
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.analysis.phases import Phases
from sautereau.analysis.press.load import Press
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

INTERVAL = 1.96
"""1, standard uncertainties from a value to the ends of its 95 % interval."""
UNSEEN = 1e-7
"""1, of the largest singular value, below which a combination is not seen at all."""


@dataclass(frozen=True)
class Estimate:
    """A fitted value; SI."""

    name: str
    unit: str
    value: float
    start: float
    """The rig's, from which the fit set out."""
    std: float | None
    """Standard uncertainty that data and prior leave; None where nothing bounds it."""
    low: float | None
    """Lower end of the 95 % interval."""
    high: float | None
    """Upper end of the 95 % interval."""
    at_bound: bool
    """Whether a bound stopped it: then the interval is about the bound and not a finding."""
    identifiable: bool
    """Whether the data alone determine it, to `IDENTIFIABLE` of its scale, with the others free."""


@dataclass(frozen=True)
class Identified:
    """What the presses say of the parameters that were free."""

    rig: Rig
    """The bench with the fitted values."""
    estimates: tuple[Estimate, ...]
    correlation: Floats
    """1, of the estimates, shape (parameters, parameters)."""
    combinations: tuple[Combination, ...]
    """The combinations of parameters from the best told to the worst, by the data alone."""
    presses: tuple[str, ...]
    """Names of the recordings."""
    releases: int
    """Releases that were seen."""
    level: str
    """Of the plectra."""
    residual: float
    """N, of what the fitted model misses of the force."""
    residual_before: float
    """N, of what the rig's own values miss of it."""
    rise_residual: float | None
    """m, rms of what it misses of the rises at release; None without one."""
    force_offsets: tuple[float, ...]
    """N, of each press; 0 where the level is known."""
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
        phases: Theirs, in the same order.
        names: Of the parameters, from `parameters.NAMES`.
        priors: What is known of them beforehand, by name.
        level: Of the plectra.
        starts: Points to set out from: the rig's values, and others between the bounds.
        robust: Let large residuals count in proportion and not by their squares.

    Raises:
        AnalysisError: There is no press, nothing to fit, or the presses are of different rigs.
        ModelError: The model has no solution for the rig's values.
    """
    dynamics = inverse_dynamics(presses, phases, names, priors, level)
    return evaluate(fit(dynamics, starts, robust, levelled=FORCE in names))


def evaluate(made: Fit) -> Identified:
    """Return what a fit has found, with its uncertainties."""
    found, values, excess = made.problem, made.values, made.excess
    dynamics, point = found.dynamics, values / found.scales
    shown = [k for k, p in enumerate(found.free) if not p.hidden]
    data = found.jacobian(point, found.data)
    prior = found.prior_jacobian(point)
    covariance, known = _covariance(np.vstack([data / np.sqrt(excess), prior]))
    alone, seen = _covariance(np.vstack([data / np.sqrt(excess), prior[found.nuisances]]))
    stds = np.where(known, np.sqrt(np.diag(covariance)), np.inf)
    seen &= np.sqrt(np.diag(alone)) < IDENTIFIABLE
    free = [found.free[k] for k in shown]
    estimates = [
        _estimate(found.free[k], float(values[k]), float(stds[k] * found.scales[k]), bool(seen[k]))
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
        combinations=tuple(
            combinations(_apart(data, found, shown) / np.sqrt(excess), [p.name for p in free])
        ),
        presses=tuple(press.name for press in dynamics.presses),
        releases=len(rises),
        level=dynamics.level,
        residual=rms([f - w.trend(f) for f, w in zip(forces, found.whitenings, strict=True)]),
        residual_before=made.residual_before,
        rise_residual=rms([rises * dynamics.rise_stds]) if len(rises) else None,
        force_offsets=tuple(offsets),
        warnings=_warnings(estimates, dynamics),
    )


def _estimate(parameter: Parameter, value: float, std: float, told: bool) -> Estimate:
    room = AT_BOUND * (parameter.high - parameter.low)
    known = np.isfinite(std)
    return Estimate(
        name=parameter.name,
        unit=parameter.unit,
        value=value,
        start=parameter.start,
        std=std if known else None,
        low=value - INTERVAL * std if known else None,
        high=value + INTERVAL * std if known else None,
        at_bound=min(value - parameter.low, parameter.high - value) <= room,
        identifiable=told,
    )


def _covariance(jacobian: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Return the covariance of scaled parameters, and which of them are bounded at all."""
    _, singular, directions = np.linalg.svd(jacobian, full_matrices=False)
    seen = singular > UNSEEN * max(float(singular[0]), 1e-300)
    bounded = np.all(np.abs(directions[~seen]) < 1e-3, axis=0)
    kept = directions[seen] / singular[seen, None]
    return kept.T @ kept, bounded


def _apart(data: Floats, found: Problem, shown: Sequence[int]) -> Floats:
    """Return the data's Jacobian by the shown parameters, what a hidden one explains taken off."""
    hidden = [k for k in range(data.shape[1]) if k not in shown]
    if not hidden:
        return data
    own = np.vstack([data, found.prior_jacobian(np.zeros(data.shape[1]))[found.nuisances]])
    base, _ = np.linalg.qr(own[:, hidden])
    return own[:, shown] - base @ (base.T @ own[:, shown])


def _warnings(estimates: Sequence[Estimate], dynamics: InverseDynamics) -> tuple[str, ...]:
    found = []
    by_name = {p.name: p for p in dynamics.free}
    for estimate in estimates:
        if estimate.at_bound:
            p = by_name[estimate.name]
            found.append(
                f"{p.name}: it came to a bound of {p.low:.4g} to {p.high:.4g} {p.unit} at"
                f" {estimate.value:.4g} {p.unit}; widen it by a prior, or look for what else is"
                " wrong in the rig"
            )
    if not any(len(press.releases) for press in dynamics.presses):
        found.append("no press has a pluck: nothing is told of plectrum, string or clearance")
    return tuple(found)
