"""Fit unknown numbers of the bench to recorded presses by generalised least squares."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.noise import Whitening, autocovariance, whitening
from sautereau.analysis.identify.observed import observed
from sautereau.analysis.identify.parameters import (
    CLEARANCE,
    GAIN,
    TIME,
    TIME_RANGE,
    Parameter,
    Prior,
    parameters,
)
from sautereau.analysis.identify.problem import Problem, descend
from sautereau.analysis.identify.residuals import InverseDynamics, check_alike
from sautereau.analysis.phases import Phases
from sautereau.analysis.press.load import Press
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

RISE_STD = 2e-6
"""m, by which all rises may be wrong alike: what is left of the vibrometer's drift."""
TIME_STD = 20e-6
"""s, by which force and motion may be apart although their delays are taken back."""
GAIN_STD = 1.2e-3
"""1, by which all forces may be wrong alike: the finger slides along the key by a fifth of a
millimetre where the arm gives way, and its moment on the key changes by as much."""
FAR = 10
"""1, standard uncertainties by which any of these may be wrong at the most."""
ROUNDS = 3
"""Fits one after the other, each whitened by the residuals of the one before."""


@dataclass(frozen=True)
class Fit:
    """A fit that has been made."""

    problem: Problem
    values: Floats
    """SI, of all parameters, those that are not shown as well."""
    residual_before: float
    """N, of what the rig's own values miss of the force."""

    @property
    def excess(self) -> float:
        """1, by which the residuals' mean square is more than their covariance says."""
        residuals = self.problem.data(self.values / self.problem.scales)
        spent = len(self.values) + sum(w.trends.shape[1] for w in self.problem.whitenings)
        # The noise's covariance is itself estimated: what is left over counts, if it is more.
        return max(1.0, float(residuals @ residuals) / max(1, len(residuals) - spent))


def inverse_dynamics(
    presses: Sequence[Press],
    phases: Sequence[Phases],
    names: Sequence[str],
    priors: Mapping[str, Prior] | None = None,
    level: str = "elastica",
) -> InverseDynamics:
    """Return the dynamics that a fit is about; as `identify`."""
    if not presses:
        raise AnalysisError("there is no press to fit to; give at least one recording")
    rig = check_alike({str(press.path): press.rig for press in presses})
    free = parameters(rig, names, priors)
    free += tuple(error for error in _errors(rig) if error.name not in names)
    shift = TIME_RANGE if TIME in names else FAR * TIME_STD
    taken = [observed(p, f, shift) for p, f in zip(presses, phases, strict=True)]
    return InverseDynamics(rig, free, taken, level)


def fit(
    dynamics: InverseDynamics, starts: int = 3, robust: bool = False, *, levelled: bool = False
) -> Fit:
    """Fit what is free in a dynamics; as `identify`.

    Args:
        dynamics: Of the presses.
        starts: Points to set out from.
        robust: Let large residuals count in proportion.
        levelled: Whether the forces' levels are free although they are not AC-coupled.
    """
    free = dynamics.free
    levelled = levelled or _coupled(dynamics.rig)
    values = np.array([p.start for p in free])
    before, _ = dynamics.residuals(values)
    noise = _white(dynamics, before, levelled)
    residual_before = rms([f - w.trend(f) for f, w in zip(before, noise, strict=True)])
    found = [
        descend(_problem(dynamics, start, noise), start, robust) for start in _starts(free, starts)
    ]
    _, values = min(found, key=lambda pair: pair[0])
    factor = 1.0
    for _ in range(ROUNDS - 1):
        forces, rises = dynamics.residuals(values)
        noise = _coloured(dynamics, forces, noise, levelled)
        factor = _factor(rises)
        _, values = descend(_problem(dynamics, values, noise, factor), values, robust)
    return Fit(_problem(dynamics, values, noise, factor), values, residual_before)


def _errors(rig: Rig) -> list[Parameter]:
    """Return the errors of the measurement that a fit has to allow for.

    A string higher or lower stands for rises that are all wrong alike.
    """
    known = (
        (CLEARANCE, "m", rig.jack.string_clearance, RISE_STD),
        (TIME, "s", 0.0, TIME_STD),
        (GAIN, "", 1.0, GAIN_STD),
    )
    return [
        Parameter(name, unit, value, value - FAR * std, value + FAR * std, value, std, hidden=True)
        for name, unit, value, std in known
    ]


def _coupled(rig: Rig) -> bool:
    """Return whether the force's level at rest is lost to AC coupling."""
    channel = rig.daq.channel("force")
    return channel is not None and channel.high_pass > 0


def _problem(
    dynamics: InverseDynamics, values: Floats, noise: Sequence[Whitening], factor: float = 1.0
) -> Problem:
    scales = np.array([p.scale(float(v)) for p, v in zip(dynamics.free, values, strict=True)])
    return Problem(dynamics, scales, tuple(noise), factor)


def _white(dynamics: InverseDynamics, forces: Sequence[Floats], levelled: bool) -> list[Whitening]:
    """Return whitenings as if the residuals were independent."""
    # Not below rounding, so that presses without any noise can be fitted as well.
    spread = max(rms([f - f.mean() * levelled for f in forces]), 1e-9)
    return [whitening(p.used, np.array([spread**2]), levelled) for p in dynamics.presses]


def _coloured(
    dynamics: InverseDynamics, forces: Sequence[Floats], noise: Sequence[Whitening], levelled: bool
) -> list[Whitening]:
    """Return whitenings by the autocovariance of residuals."""
    left = [f - w.trend(f) for f, w in zip(forces, noise, strict=True)]
    spent = len(dynamics.free) + 2 * levelled * len(forces)
    covariance = autocovariance(
        left, [p.used for p in dynamics.presses], dynamics.presses[0].step, spent
    )
    return [whitening(p.used, covariance, levelled) for p in dynamics.presses]


def _factor(rises: Floats) -> float:
    """Return by how much rises at release scatter more than their uncertainties say."""
    return max(1.0, float(np.std(rises, ddof=1))) if len(rises) > 2 else 1.0


def _starts(free: Sequence[Parameter], count: int) -> list[Floats]:
    """Return the rig's values, and others spread between the bounds."""
    from scipy.stats import qmc

    start = np.array([p.start for p in free])
    if count < 2:
        return [start]
    low, high = np.array([p.low for p in free]), np.array([p.high for p in free])
    spread = qmc.LatinHypercube(len(free), rng=np.random.default_rng(0)).random(count - 1)
    return [start, *(low + spread * (high - low))]


def rms(parts: Sequence[Floats]) -> float:
    """Return the root mean square of all values together; 0 of none."""
    joined = np.concatenate([np.asarray(part, float) for part in parts])
    return float(np.sqrt(np.mean(joined**2))) if len(joined) else 0.0
