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
    LEAST,
    coupled_force,
    observed,
)
from sautereau.analysis.identify.parameters import (
    CHOIR,
    CLEARANCE,
    DAMPER,
    DAMPER_LIFT,
    ENDS,
    FORCE_GAIN,
    FRICTION,
    LATE_SLIDING,
    MODE,
    MODULUS,
    OVERLAP,
    RELEASE,
    SLIDING,
    STIFFNESS,
    TIME,
    TIME_RANGE,
    VELOCITY_GAIN,
    Parameter,
    Prior,
    parameters,
)
from sautereau.analysis.identify.problem import (
    COARSE,
    FLOOR,
    TOLERANCE,
    Problem,
    Whitening,
    autocovariance,
    descend,
    white,
    whitening,
)
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.rig.progress import tracked
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

CLEARANCE_STD = 0.1e-3
"""m, of the clearance in the rig: each recording shows it to some micrometres, so it is always
fitted, and contact does not calibrate the vibrometer."""
SLIDING_STD = 2e-3
"""1/N: a force of 1 N moves the finger of a compliant arm along the key by a third of a
millimetre."""
RELEASE_STD = 5e-3
"""Dimensionless, of the height of release: the string moves, and the model's is static."""
FRICTION_STD = 0.1
"""Dimensionless, of the plectrum's friction in the rig. It is fitted with stiffness and overlap,
which imitate it: 0.03 hides in the noise, and makes the overlap 8 % too large. A string on the
mid-line, which no instrument has, looks like friction as well: there its place comes first."""
DAMPER_STD, DAMPER_LIFT_STD = 0.2, 0.1e-3
"""Dimensionless and m, of the stiffness and the lift of the dampers, unless the rig assumes them in
a range."""
CHOIR_STD = 0.3
"""Dimensionless, of stiffness and overlap of the plectra of further choirs in the rig."""
FAR = 10
"""Bounds of these errors, in their standard uncertainties."""
DEPENDENT = 2.4
"""Dimensionless, instants per independent value of the smoothed force."""
COMPLIANT_FLOOR = 0.3
"""Dimensionless, `FLOOR` of a compliant key."""
ROUNDS = 3
"""Number of fits, from the second on whitened by the residuals of the one before."""


@dataclass(frozen=True)
class Fit:
    """A completed fit."""

    problem: Problem
    values: Floats
    """SI, of all parameters, including hidden ones."""
    residual_before: float
    """N, RMS force residual with the values of the rig."""
    levelled: bool
    """Whether the zero of each force was free."""
    moved: Floats | None = None
    """How far whitening moved the scaled values of a compliant key; None of a rigid one."""

    @property
    def excess(self) -> float:
        """Mean square of the whitened residuals: 1 for a correct covariance; at least 1."""
        residuals = self.problem.data(self.values / self.problem.scales)
        # The covariance of the noise is an estimate, so a larger scatter of the residuals counts.
        return max(1.0, float(residuals @ residuals) / max(1, len(residuals) - self.spent))

    @property
    def spent(self) -> int:
        """Number of fitted values: parameters and trends."""
        return len(self.values) + sum(w.trends.shape[1] for w in self.problem.whitenings)


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
    free += tuple(error for error in _errors(rig, names) if error.name not in names)
    shift = TIME_RANGE if TIME in names else min(TIME_RANGE, FAR * _stds(rig)[TIME])
    taken = [observed(p, f, shift) for p, f in zip(presses, phases, strict=True)]
    return InverseDynamics(rig, free, taken, level)


def fit(
    dynamics: InverseDynamics, starts: int = 3, robust: bool = False, *, levelled: bool = False
) -> Fit:
    """Fit the free parameters of inverse dynamics, as if the residuals were independent.

    Args:
        dynamics: Of the presses.
        starts: Number of starting points.
        robust: Weight large residuals linearly instead of quadratically.
        levelled: Whether the zero of each force is free although the force is not AC-coupled.

    Raises:
        AnalysisError: There is no starting point.
    """
    if starts < 1:
        raise AnalysisError(f"starts: {starts} starting points; give 1 or more")
    free = dynamics.free
    levelled = levelled or coupled_force(dynamics.rig) is not None
    values = np.array([p.start for p in free])
    before, rises = dynamics.residuals(values)
    # Correlated residuals count less beside the priors.
    size = spread(dynamics, before, levelled) * np.sqrt(DEPENDENT)
    noise = white(dynamics, size, levelled)
    residual_before = rms([f - w.trend(f) for f, w in zip(before, noise, strict=True)])
    tried = _starts(free, starts)
    factor = scatter(rises)
    found = [
        descend(problem_at(dynamics, start, noise, factor), start, robust, tolerance=COARSE)
        for start in tracked(tried)
    ]
    _, values = min(found, key=lambda pair: pair[0])
    return Fit(problem_at(dynamics, values, noise, factor), values, residual_before, levelled)


def refined(made: Fit, robust: bool = False) -> Fit:
    """Return a fit to the tolerance of a result, for the correlation of its residuals.

    Whitening gives most weight to what is rare in the residuals, which a model of few modes
    describes worst. A compliant key's residuals are whitened in part, and how far this moves the
    values is part of their uncertainty, as another weight would not move those of a correct model
    (Hausman 1978).
    """
    dynamics, values, problem = made.problem.dynamics, made.values, made.problem
    compliant = any(p.name.startswith(MODE) for p in dynamics.free)
    floor = COMPLIANT_FLOOR if compliant else FLOOR
    for tolerance in [COARSE] * (ROUNDS - 2) + [TOLERANCE]:
        forces, rises = dynamics.residuals(values)
        left = [f - w.trend(f) for f, w in zip(forces, problem.whitenings, strict=True)]
        noise = _noise(dynamics, left, dynamics.floor, made.spent, made.levelled, floor)
        problem = problem_at(dynamics, values, noise, scatter(rises))
        _, values = descend(problem, values, robust, tolerance=tolerance)
    problem = problem_at(dynamics, values, problem.whitenings, problem.rise_factor)
    moved = (values - made.values) / problem.scales if compliant else None
    return replace(made, problem=problem, values=values, moved=moved)


def informative(made: Fit, jacobian: Floats) -> Floats:
    """Return rows with the information of data whose residuals are correlated.

    Least squares with a Jacobian J, of residuals with the covariance S, has the information
    J'J (J'SJ)^-1 J'J on the parameters, whatever their weights (White 1980, Newey and West 1987).

    Args:
        made: The fit.
        jacobian: Derivatives of its weighted residuals, shape (n, parameters).

    Returns:
        Shape (parameters, parameters).
    """
    from scipy.linalg import solve_triangular

    dynamics, problem = made.problem.dynamics, made.problem
    forces, _ = dynamics.residuals(made.values)
    left = [w(f) for f, w in zip(forces, problem.whitenings, strict=True)]
    noise = _noise(dynamics, left, DEPENDENT**-0.5, made.spent, levelled=False)
    basis, mixing = np.linalg.qr(jacobian)
    parts = np.split(basis, np.cumsum([len(f) for f in left]))
    shaped = [w.coloured(rows) for w, rows in zip(noise, parts[:-1], strict=True)]
    variance = sum(rows.T @ rows for rows in [*shaped, parts[-1]])
    return solve_triangular(np.linalg.cholesky(variance), mixing, lower=True)


def _errors(rig: Rig, names: Sequence[str]) -> list[Parameter]:
    """Return the hidden parameters: errors of the measurement, and what is seldom known."""
    units = {CLEARANCE: "m", TIME: "s", SLIDING: "1/N", LATE_SLIDING: "1/N"}
    values = {
        CLEARANCE: rig.jack.string_clearance,
        TIME: 0.0,
        SLIDING: 0.0,
        LATE_SLIDING: 0.0,
        RELEASE: 0.0,
    }
    stds = _stds(rig)
    for choir in range(1, len(rig.more_choirs) + 1):
        stiffness, overlap, clearance = (name.format(choir) for name in CHOIR)
        stds |= {stiffness: CHOIR_STD, overlap: CHOIR_STD, clearance: CLEARANCE_STD}
        values[clearance], units[clearance] = 0.0, "m"
    if rig.jack.damper is not None and rig.jack.damper.stiffness > 0:
        stiffness, lift = rig.jack.damper.stiffness, rig.jack.damper.lift
        stds[DAMPER] = assumed_std(rig, "jack.damper.stiffness") / stiffness or DAMPER_STD
        stds[DAMPER_LIFT] = assumed_std(rig, "jack.damper.lift") or DAMPER_LIFT_STD
        values[DAMPER_LIFT], units[DAMPER_LIFT] = lift, "m"
    found = []
    for name, std in stds.items():
        value = values.get(name, 1.0)
        low = value - min(FAR * std, 0.9 * value) if value else -FAR * std
        unit = units.get(name, "")
        found.append(Parameter(name, unit, value, low, value + FAR * std, value, std, hidden=True))
    if {MODULUS, STIFFNESS, OVERLAP} & set(names) and rig.plectrum.contact == "surface":
        value = rig.plectrum.friction
        friction = Parameter(FRICTION, "", value, *ENDS[FRICTION], value, FRICTION_STD, hidden=True)
        found.append(friction)
    return found


def assumed_std(rig: Rig, name: str) -> float:
    """Return the standard uncertainty of a value whose range the rig assumes; 0 without a range."""
    low, high = rig.assumed.get(name, (0.0, 0.0))
    return float(high - low) / np.sqrt(12)


def _stds(rig: Rig) -> dict[str, float]:
    """Return the standard uncertainties of the hidden parameters."""
    force, velocity = (
        next(c for c in rig.daq.channels if c.quantity == name) for name in ("force", "velocity")
    )
    return {
        CLEARANCE: CLEARANCE_STD,
        # Not 0, which would be no prior but an empty range.
        TIME: max(float(np.hypot(force.delay_std, velocity.delay_std)), 1e-9),
        FORCE_GAIN: max(force.gain_std, 1e-6),
        VELOCITY_GAIN: max(velocity.gain_std, 1e-6),
        SLIDING: SLIDING_STD,
        LATE_SLIDING: SLIDING_STD,
        RELEASE: RELEASE_STD,
    }


def problem_at(
    dynamics: InverseDynamics,
    values: Floats,
    noise: tuple[Whitening, ...] = (),
    factor: float = 1.0,
) -> Problem:
    """Return the problem with the scales of the parameters at these values [SI]."""
    scales = np.array([p.scale(float(v)) for p, v in zip(dynamics.free, values, strict=True)])
    return Problem(dynamics, scales, noise, factor)


def spread(dynamics: InverseDynamics, forces: Sequence[Floats], levelled: bool) -> float:
    """Return the RMS [N] of residuals, at least the accuracy of the model."""
    return max(rms([f - f.mean() * levelled for f in forces]), dynamics.floor)


def _noise(
    dynamics: InverseDynamics,
    left: Sequence[Floats],
    floor: float,
    spent: int,
    levelled: bool,
    least: float = FLOOR,
) -> tuple[Whitening, ...]:
    """Return whitenings of residuals without trends, of which `spent` values are fitted.

    The spectrum of the noise is at least the fraction `least` of its mean.

    Each part of the press has its own scale, at least `floor`: an error of the pluck's model is in
    one only, and on the way back the finger may lose the key and catch it again.
    """
    parts = [p.part[p.used] for p in dynamics.presses]
    scales = [np.full(len(f), max(rms(left), floor)) for f in left]
    for part in (FREE, HELD, BACK):
        own = [f[p == part] for f, p in zip(left, parts, strict=True)]
        if sum(map(len, own)) >= LEAST:
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
        whitening(p.used, covariance, levelled, s, p.step)
        for p, s in zip(dynamics.presses, scales, strict=True)
    )


def _starts(free: Sequence[Parameter], count: int) -> list[Floats]:
    """Return the values of the rig, and points spread between the bounds."""
    from scipy.stats import qmc

    start = np.array([p.start for p in free])
    if count < 2:
        return [start]
    low, high = np.array([p.low for p in free]), np.array([p.high for p in free])
    spread = qmc.LatinHypercube(len(free), rng=np.random.default_rng(0)).random(count - 1)
    return [start, *(low + spread * (high - low))]


def scatter(rises: Floats) -> float:
    """Return the scatter of the rises at release over their stated uncertainties; at least 1."""
    return max(1.0, float(np.std(rises, ddof=1))) if len(rises) > 2 else 1.0


def rms(parts: Sequence[Floats]) -> float:
    """Return the root mean square of all values together; 0 for no value."""
    joined = np.concatenate([np.asarray(part, float) for part in parts])
    return float(np.sqrt(np.mean(joined**2))) if len(joined) else 0.0
