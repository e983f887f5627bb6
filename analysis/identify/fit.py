"""Fit unknown parameters of the bench to recorded presses by generalised least squares."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sautereau.analysis.alike import check_alike
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.observed import (
    BACK,
    FREE,
    HELD,
    MIN_INSTANTS,
    coupled_force,
    observed,
)
from sautereau.analysis.identify.parameters import (
    BOUND_STDS,
    MODE,
    TIME,
    TIME_RANGE,
    Prior,
    canonical,
    delay_std,
    hidden_parameters,
    parameters,
    values_of_rig,
)
from sautereau.analysis.identify.problem import (
    COARSE,
    FLOOR,
    TOLERANCE,
    Problem,
    Whitening,
    autocovariance,
    minimise,
    white,
    whitening,
)
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.rig.progress import tracked
from sautereau.trajectory.motion import Floats

DEPENDENT = 2.4  # Instants per independent value of the smoothed force
ROUNDS = 3  # Fits; each after the first is whitened with the residuals of the one before


@dataclass(frozen=True)
class Fit:
    """A completed fit."""

    problem: Problem
    values: Floats
    """Values of all parameters, including the hidden ones, SI."""
    free_offset: bool
    """Whether the zero of each force was fitted."""
    moved: Floats
    """Change of the scaled values by whitening, for a compliant key; 0 for a rigid one; shape
    (parameters,)."""
    instead: tuple[str, ...] = ()
    """Calibrations with wrong values of which a rigid key fits, so that no mode was tried."""

    @property
    def residual_before(self) -> float:
        """RMS force residual of the fitted samples with the values of the rig [N]."""
        dynamics = self.problem.dynamics
        forces, _ = dynamics.residuals(values_of_rig(dynamics.rig, dynamics.free))
        noise = self.problem.whitenings
        return rms([f - w.trend(f) for f, w in zip(forces, noise, strict=True)])

    @property
    def excess(self) -> float:
        """Mean square of the whitened residuals, at least 1; 1 if the covariance is correct."""
        residuals = self.problem.data(self.values / self.problem.scales)
        # The covariance of the noise is an estimate. A larger scatter of the residuals is real.
        return max(1.0, float(residuals @ residuals) / max(1, len(residuals) - self.spent))

    @property
    def spent(self) -> int:
        """Number of fitted values: parameters and trends of the force."""
        return len(self.values) + sum(w.trends.shape[1] for w in self.problem.whitenings)


def inverse_dynamics(
    presses: Sequence[Press],
    phases: Sequence[Phases],
    names: Sequence[str],
    priors: Mapping[str, Prior] | None = None,
    level: str = "auto",
) -> InverseDynamics:
    """Return the inverse dynamics of presses with all parameters; arguments as for `identify`.

    Raises:
        AnalysisError: No press is usable, or the presses have different rigs.
    """
    if not presses:
        raise AnalysisError("there is no press to fit; give at least one recording")
    names = list(map(canonical, names))
    priors = {canonical(name): prior for name, prior in (priors or {}).items()}
    rig = check_alike({str(press.path): press.rig for press in presses})
    free = parameters(rig, names, priors)
    free += tuple(hidden_parameters(rig, names))
    shift = TIME_RANGE if TIME in names else min(TIME_RANGE, BOUND_STDS * delay_std(rig))
    taken, unusable = [], []
    for press, found in zip(presses, phases, strict=True):
        try:
            taken.append(observed(press, found, shift))
        except AnalysisError as error:
            unusable.append(str(error))
    if not taken:
        raise AnalysisError("\n".join(unusable))
    return InverseDynamics(rig, free, taken, level, unusable)


def fit(
    dynamics: InverseDynamics,
    starts: int = 3,
    robust: bool = False,
    *,
    free_offset: bool = False,
    tolerance: float = COARSE,
) -> Fit:
    """Fit the parameters under the assumption that the residuals are independent.

    Args:
        starts: Number of starting points.
        robust: Weight large residuals linearly instead of quadratically.
        free_offset: Fit the zero of each force even if the force is not AC-coupled.
        tolerance: As of `minimise`.

    Raises:
        AnalysisError: `starts` is less than 1.
    """
    from scipy.stats import qmc

    if starts < 1:
        raise AnalysisError(f"starts: {starts} starting points; give 1 or more")
    free = dynamics.free
    values = np.array([p.start for p in free])
    first = at_values(dynamics, values, free_offset)
    noise, factor = first.problem.whitenings, first.problem.rise_factor
    low, high = np.array([p.low for p in free]), np.array([p.high for p in free])
    # The rig's values, and points that are spread between the bounds.
    spread_out = qmc.LatinHypercube(len(free), rng=np.random.default_rng(0)).random(starts - 1)
    found = [
        minimise(problem_at(dynamics, start, noise, factor), start, robust, tolerance=tolerance)
        for start in tracked([values, *(low + spread_out * (high - low))])
    ]
    _, values = min(found, key=lambda pair: pair[0])
    return replace(first, problem=problem_at(dynamics, values, noise, factor), values=values)


def at_values(dynamics: InverseDynamics, values: Floats, free_offset: bool) -> Fit:
    """Return a fit that has these values [SI], with independent residuals; arguments as `fit`."""
    free_offset = free_offset or coupled_force(dynamics.rig) is not None
    before, rises = dynamics.residuals(values)
    # Correlated residuals get less weight relative to the priors.
    size = spread(dynamics, before, free_offset) * np.sqrt(DEPENDENT)
    noise = white(dynamics, size, free_offset)
    problem = problem_at(dynamics, values, noise, scatter(rises))
    return Fit(problem, values, free_offset, np.zeros(len(values)))


def refined(fitted: Fit, robust: bool = False) -> Fit:
    """Continue a fit to the final tolerance, with whitened residuals.

    Whitening gives most weight to the frequencies that are weakest in the residuals, which the
    model describes worst. The residuals are therefore whitened only in part. The values of a
    correct model do not depend on the weights (Hausman 1978); on a compliant key, whose modes are
    never all fitted, the change that whitening causes is counted as an uncertainty.
    """
    dynamics, values, problem = fitted.problem.dynamics, fitted.values, fitted.problem
    compliant = any(p.name.startswith(MODE) for p in dynamics.free)
    for tolerance in [COARSE] * (ROUNDS - 2) + [TOLERANCE]:
        problem = whitened(replace(fitted, problem=problem, values=values))
        _, values = minimise(problem, values, robust, tolerance=tolerance)
    problem = problem_at(dynamics, values, problem.whitenings, problem.rise_factor)
    moved = (values - fitted.values) / problem.scales * compliant
    return replace(fitted, problem=problem, values=values, moved=moved)


def whitened(fitted: Fit) -> Problem:
    """Return the problem of a fit with the covariance of its residuals."""
    dynamics = fitted.problem.dynamics
    forces, rises = dynamics.residuals(fitted.values)
    left = [f - w.trend(f) for f, w in zip(forces, fitted.problem.whitenings, strict=True)]
    # Of its mean, the noise that weights a fit has at least 0.3 at any frequency.
    noise = _noise(dynamics, left, dynamics.floor, fitted.spent, fitted.free_offset, 0.3)
    return problem_at(dynamics, fitted.values, noise, scatter(rises))


def informative(fitted: Fit, jacobian: Floats) -> Floats:
    """Return rows R with R'R equal to the information that correlated residuals contain.

    The information of a least-squares fit with the Jacobian J and residuals of covariance S is
    J'J (J'SJ)^-1 J'J, for any weights (White 1980, Newey and West 1987).

    Args:
        jacobian: Derivatives of its weighted residuals, shape (n, parameters).

    Returns:
        R, shape (parameters, parameters).
    """
    from scipy.linalg import solve_triangular

    dynamics, problem = fitted.problem.dynamics, fitted.problem
    forces, _ = dynamics.residuals(fitted.values)
    left = [w(f) for f, w in zip(forces, problem.whitenings, strict=True)]
    noise = _noise(dynamics, left, DEPENDENT**-0.5, fitted.spent, free_offset=False)
    basis, mixing = np.linalg.qr(jacobian)
    parts = np.split(basis, np.cumsum([len(f) for f in left]))
    shaped = [w.coloured(rows) for w, rows in zip(noise, parts[:-1], strict=True)]
    variance = sum(rows.T @ rows for rows in [*shaped, parts[-1]])
    return solve_triangular(np.linalg.cholesky(variance), mixing, lower=True)


def problem_at(
    dynamics: InverseDynamics,
    values: Floats,
    noise: tuple[Whitening, ...] = (),
    factor: float = 1.0,
) -> Problem:
    """Return the problem whose scales are those of the parameters at these values [SI]."""
    scales = np.array([p.scale(float(v)) for p, v in zip(dynamics.free, values, strict=True)])
    return Problem(dynamics, scales, noise, factor)


def spread(dynamics: InverseDynamics, forces: Sequence[Floats], free_offset: bool) -> float:
    """Return the RMS [N] of the residuals; at least the accuracy of the model."""
    return max(rms([f - f.mean() * free_offset for f in forces]), dynamics.floor)


def _noise(
    dynamics: InverseDynamics,
    left: Sequence[Floats],
    floor: float,
    spent: int,
    free_offset: bool,
    least: float = FLOOR,
) -> tuple[Whitening, ...]:
    """Return the whitenings of the residuals `left` [N] of each press, without trends.

    Each phase of the press has its own scale, at least `floor` [N]. An error of the pluck's model
    affects one phase only, and on the way back the finger may lose the key and catch it again.
    """
    parts = [p.phase[p.used] for p in dynamics.presses]
    scales = [np.full(len(f), max(rms(left), floor)) for f in left]
    for part in (FREE, HELD, BACK):
        own = [f[p == part] for f, p in zip(left, parts, strict=True)]
        if sum(map(len, own)) >= MIN_INSTANTS:
            for scale, p in zip(scales, parts, strict=True):
                scale[p == part] = max(rms(own), floor)
    covariance = autocovariance(
        [f / s for f, s in zip(left, scales, strict=True)],
        [p.used for p in dynamics.presses],
        dynamics.presses[0].step,
        spent,
        least,
    )
    return tuple(
        whitening(p.used, covariance, free_offset, s, p.step)
        for p, s in zip(dynamics.presses, scales, strict=True)
    )


def scatter(rises: Floats) -> float:
    """Return the scatter of the rises at release divided by their uncertainties; at least 1."""
    return max(1.0, float(np.std(rises, ddof=1))) if len(rises) > 2 else 1.0


def rms(parts: Sequence[Floats]) -> float:
    """Return the root mean square of all values together; 0 without values."""
    joined = np.concatenate([np.asarray(part, float) for part in parts])
    return float(np.sqrt(np.mean(joined**2))) if len(joined) else 0.0
