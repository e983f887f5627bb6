"""Fit unknown parameters of the bench to recorded presses by generalised least squares."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.observed import coupled_force, observed
from sautereau.analysis.identify.parameters import (
    CLEARANCE,
    GAIN,
    TIME,
    TIME_RANGE,
    Parameter,
    Prior,
    parameters,
)
from sautereau.analysis.identify.problem import (
    Problem,
    Whitening,
    autocovariance,
    descend,
    whitening,
)
from sautereau.analysis.identify.residuals import InverseDynamics, check_alike
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

RISE_STD = 2e-6
"""m, common error of all rises: the remaining drift of the vibrometer."""
TIME_STD = 20e-6
"""s, remaining delay between force and motion after the correction of their delays."""
GAIN_STD = 1.2e-3
"""Dimensionless, common relative error of all forces: the finger of a compliant arm slides along
the key by a fifth of a millimetre, and its moment on the key changes by as much."""
FAR = 10
"""Bounds of these errors, in their standard uncertainties."""
ROUNDS = 3
"""Number of fits, each whitened by the residuals of the one before."""


@dataclass(frozen=True)
class Fit:
    """A completed fit."""

    problem: Problem
    values: Floats
    """SI, of all parameters, including hidden ones."""
    residual_before: float
    """N, RMS force residual with the values of the rig."""

    @property
    def excess(self) -> float:
        """Mean square of the whitened residuals: 1 for a correct covariance; at least 1."""
        residuals = self.problem.data(self.values / self.problem.scales)
        spent = len(self.values) + sum(w.trends.shape[1] for w in self.problem.whitenings)
        # The covariance of the noise is an estimate, so a larger scatter of the residuals counts.
        return max(1.0, float(residuals @ residuals) / max(1, len(residuals) - spent))


def inverse_dynamics(
    presses: Sequence[Press],
    phases: Sequence[Phases],
    names: Sequence[str],
    priors: Mapping[str, Prior] | None = None,
    level: str = "elastica",
) -> InverseDynamics:
    """Return the inverse dynamics of presses with its free parameters; arguments as `identify`."""
    if not presses:
        raise AnalysisError("there is no press to fit; give at least one recording")
    rig = check_alike({str(press.path): press.rig for press in presses})
    free = parameters(rig, names, priors)
    free += tuple(error for error in _errors(rig) if error.name not in names)
    shift = TIME_RANGE if TIME in names else FAR * TIME_STD
    taken = [observed(p, f, shift) for p, f in zip(presses, phases, strict=True)]
    return InverseDynamics(rig, free, taken, level)


def fit(
    dynamics: InverseDynamics, starts: int = 3, robust: bool = False, *, levelled: bool = False
) -> Fit:
    """Fit the free parameters of inverse dynamics.

    Args:
        dynamics: Of the presses.
        starts: Number of starting points.
        robust: Weight large residuals linearly instead of quadratically.
        levelled: Whether the zero of each force is free although the force is not AC-coupled.
    """
    free = dynamics.free
    levelled = levelled or coupled_force(dynamics.rig) is not None
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
        # The scatter of the rises at release over their stated uncertainties.
        factor = max(1.0, float(np.std(rises, ddof=1))) if len(rises) > 2 else 1.0
        _, values = descend(_problem(dynamics, values, noise, factor), values, robust)
    return Fit(_problem(dynamics, values, noise, factor), values, residual_before)


def _errors(rig: Rig) -> list[Parameter]:
    """Return the hidden parameters for errors of the measurement.

    The clearance of the string represents a common error of all rises.
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


def _problem(
    dynamics: InverseDynamics, values: Floats, noise: Sequence[Whitening], factor: float = 1.0
) -> Problem:
    scales = np.array([p.scale(float(v)) for p, v in zip(dynamics.free, values, strict=True)])
    return Problem(dynamics, scales, tuple(noise), factor)


def _white(dynamics: InverseDynamics, forces: Sequence[Floats], levelled: bool) -> list[Whitening]:
    """Return whitenings for independent residuals."""
    # Not below rounding errors, so that presses without noise can be fitted as well.
    spread = max(rms([f - f.mean() * levelled for f in forces]), 1e-9)
    return [whitening(p.used, np.array([spread**2]), levelled) for p in dynamics.presses]


def _coloured(
    dynamics: InverseDynamics, forces: Sequence[Floats], noise: Sequence[Whitening], levelled: bool
) -> list[Whitening]:
    """Return whitenings for the autocovariance of the residuals."""
    left = [f - w.trend(f) for f, w in zip(forces, noise, strict=True)]
    spent = len(dynamics.free) + 2 * levelled * len(forces)
    covariance = autocovariance(
        left, [p.used for p in dynamics.presses], dynamics.presses[0].step, spent
    )
    return [whitening(p.used, covariance, levelled) for p in dynamics.presses]


def _starts(free: Sequence[Parameter], count: int) -> list[Floats]:
    """Return the values of the rig, and points spread between the bounds."""
    from scipy.stats import qmc

    start = np.array([p.start for p in free])
    if count < 2:
        return [start]
    low, high = np.array([p.low for p in free]), np.array([p.high for p in free])
    spread = qmc.LatinHypercube(len(free), rng=np.random.default_rng(0)).random(count - 1)
    return [start, *(low + spread * (high - low))]


def rms(parts: Sequence[Floats]) -> float:
    """Return the root mean square of all values together; 0 for no value."""
    joined = np.concatenate([np.asarray(part, float) for part in parts])
    return float(np.sqrt(np.mean(joined**2))) if len(joined) else 0.0
