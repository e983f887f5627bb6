"""The numbers that a fit keeps fixed: what each does to the results, and which should be freed.

With the Jacobian J of whitened residuals and priors by the fitted parameters, and the derivative c
by a fixed number, a change of that number moves the fit by -J^+ c. What is left of c, which is
d = c - J J^+ c, gives the effect of freeing it: a Gauss-Newton step of -d r / d d, which reduces
the sum of squares of the residuals r by (d r)^2 / d d (the score test; 1 on average for a correct
number).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sautereau.analysis.identify.fit import DEPENDENT, Fit, assumed_std
from sautereau.analysis.identify.parameters import (
    ENDS,
    FORCE,
    MODULUS,
    NAMES,
    STIFFNESS,
    VELOCITY_GAIN,
    unit_of_parameter,
    value_of,
    with_parameters,
)
from sautereau.analysis.identify.problem import Problem, white
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

MEASURED = (
    *("key.press_arm", "key.laser_arm", "key.jack_arm", "key.jack_surface_height"),
    *("plectrum.length", "plectrum.thickness"),
    *("string.tension", "string.length", "string.plucking_point", "string.diameter"),
)
"""Numbers of the rig that are measured with a rule, and never fitted."""
CHANGE, STEP = 0.01, 1e-3
"""Dimensionless, change of a number without a stated range in the table, and of differences."""
FRICTION_CHANGE = 0.1
"""Dimensionless, change of a coefficient of friction in the table."""
CONTACT, LIKELY = "plectrum.contact", 0.4
"""The string on the surface is suggested where its fitted offset from the mid-line is larger than
this fraction of that on the surface."""
SUGGESTED = 16.0
"""Reduction of the sum of squares from which freeing is suggested: 4 standard deviations."""


@dataclass(frozen=True)
class Sensitivity:
    """What one fixed number of the rig, or one calibration, does to the results."""

    name: str
    unit: str
    value: float
    """SI; of `plectrum.contact` 1 for the surface and 0 for the mid-line."""
    change: float
    """SI; its standard uncertainty where the rig states a range, else 1 % of it; of
    `plectrum.contact` 1, to the other one."""
    stated: bool
    """Whether the rig states that uncertainty."""
    effects: dict[str, float]
    """Change of each result by it, over the result's scale; dimensionless."""


@dataclass(frozen=True)
class Suggestion:
    """A fixed number whose freeing would reduce the residuals."""

    name: str
    unit: str
    reduction: float
    """Expected reduction of the weighted sum of squares; 1 on average for a correct number."""
    value: float
    """SI, expected value."""


class ScoreTest:
    """The effects of freeing one more number of a problem, at values [SI] of its parameters.

    The residuals count as independent, with a standard deviation `spread` [N].
    """

    def __init__(self, problem: Problem, values: Floats, spread: float, levelled: bool):
        self.problem = replace(problem, whitenings=white(problem.dynamics, spread, levelled))
        point = values / problem.scales
        self._data, prior = self.problem.data(point), self.problem.prior_jacobian(point)
        rows = np.vstack([self.problem.jacobian(point, self.problem.data), prior])
        self._basis, _ = np.linalg.qr(rows)
        self._residuals = np.concatenate([self._data, self.problem.prior(point)])

    def column(self, dynamics: InverseDynamics, values: Floats, step: float) -> Floats:
        """Return the derivative by a number, 0 without one; arguments as `Problem.by_another`."""
        column = self.problem.by_another(self._data, dynamics, values, step)
        column = np.zeros(len(self._data)) if column is None else column
        return np.append(column, np.zeros(len(self._residuals) - len(self._data)))

    def freed(self, columns: Sequence[Floats]) -> tuple[Floats, float]:
        """Return the steps of numbers that are freed together, and the reduction."""
        rows = np.stack(columns, axis=1)
        left = rows - self._basis @ (self._basis.T @ rows)
        sizes = np.linalg.norm(left, axis=0)
        left[:, sizes <= 3e-5 * np.linalg.norm(rows, axis=0)] = 0.0
        scales = np.maximum(sizes, 1e-300)
        steps = -np.linalg.lstsq(left / scales, self._residuals, rcond=1e-6)[0]
        moved = left / scales @ steps
        return steps / scales, float(moved @ moved)


def sensitivities(made: Fit, jacobian: Floats, excess: float) -> tuple[Sensitivity, ...]:
    """Return the effects of all fixed numbers and calibrations, the largest first.

    Args:
        made: The fit.
        jacobian: Derivatives of its whitened residuals by the scaled parameters.
        excess: Mean square of the whitened residuals.
    """
    problem, dynamics = made.problem, made.problem.dynamics
    shown = [k for k, p in enumerate(problem.free) if not p.hidden]
    prior = problem.prior_jacobian(made.values / problem.scales)
    data, nothing = jacobian / np.sqrt(excess), np.zeros(len(prior))
    rows, table = np.vstack([data, prior]), []

    def add(name: str, unit: str, value: float, change: float, stated: bool, moved: Floats) -> None:
        effects = {problem.free[k].name: float(moved[k] * change) for k in shown}
        table.append(Sensitivity(name, unit, value, change, stated, effects))

    for k, parameter in enumerate(problem.free):
        if parameter.hidden and parameter.std:
            # While it is fixed, its own prior does not count.
            others = [j for j in range(len(problem.free)) if j != k]
            kept = np.concatenate([np.ones(len(data), bool), np.any(prior[:, others] != 0, axis=1)])
            column, moved = np.concatenate([data[:, k], nothing]), np.zeros(len(problem.free))
            moved[others] = _moved(rows[kept][:, others], column[kept]) / problem.scales[k]
            value = float(made.values[k])
            add(parameter.name, parameter.unit, value, parameter.std, True, moved)
    fixed = [
        (name, unit, value, *_change(dynamics, name, value), *_beside(dynamics, name, value))
        for name, unit, value in _fixed(dynamics)
    ]
    place = float(dynamics.rig.plectrum.contact == "surface")
    fixed.append((CONTACT, "", place, 1.0, False, _other_contact(dynamics.rig), 1.0))
    whitened = problem.data(made.values / problem.scales)
    for name, unit, value, change, stated, rig, step in fixed:
        moved = problem.by_another(whitened, *_moved_to(dynamics, made.values, rig), step)
        if moved is not None:
            column = np.concatenate([moved / np.sqrt(excess), nothing])
            add(name, unit, value, change, stated, _moved(rows, column))
    return tuple(sorted(table, key=lambda s: -max(map(abs, s.effects.values()), default=0.0)))


def suggestions(made: Fit, noise: float) -> tuple[Suggestion, ...]:
    """Return the fixed numbers whose freeing would reduce the residuals, the best first.

    Args:
        made: The fit, of a model that does not fit.
        noise: N, RMS of the force residual without the error of the model.
    """
    dynamics = made.problem.dynamics
    test = ScoreTest(made.problem, made.values, noise * np.sqrt(DEPENDENT), made.levelled)

    def freed(rig: Rig, step: float) -> tuple[float, float]:
        moved, reduction = test.freed([test.column(*_moved_to(dynamics, made.values, rig), step)])
        return float(moved[0]), reduction

    found = []
    for name, unit, value in _fixed(dynamics):
        if name in MEASURED:
            continue
        step, reduction = freed(*_beside(dynamics, name, value))
        low, high = ENDS.get(name, (0.0, np.inf))
        # An impossible number is not the cause, but a linear step may be too long.
        if reduction > SUGGESTED and low <= value + step <= high + (high - low):
            found.append(Suggestion(name, unit, reduction, min(value + step, high)))
    found.sort(key=lambda s: -s.reduction)
    if dynamics.rig.plectrum.contact == "mid-line":
        # The offset of the string's centre, as a fraction of that on the surface.
        step, reduction = freed(_other_contact(dynamics.rig), 1.0)
        if reduction > SUGGESTED and step > LIKELY:
            # First: it is no number to free, and friction imitates it.
            found.insert(0, Suggestion(CONTACT, "", reduction, 1.0))
    return tuple(found)


def _other_contact(rig: Rig) -> Rig:
    """Return the rig with the string on the surface instead of the mid-line, or the reverse."""
    other = "mid-line" if rig.plectrum.contact == "surface" else "surface"
    return rig.model_copy(update={"plectrum": rig.plectrum.model_copy(update={"contact": other})})


def _moved(rows: Floats, column: Floats) -> Floats:
    """Return the move of the fit by a unit of the column."""
    return -np.asarray(np.linalg.lstsq(rows, column, rcond=1e-9)[0], float)


def _fixed(dynamics: InverseDynamics) -> list[tuple[str, str, float]]:
    """Return name, unit and value of the fixed numbers that the model has."""
    free = {p.name for p in dynamics.free}
    taken = free | {FORCE, MODULUS} | ({STIFFNESS} if MODULUS in free else set())
    names = [name for name in (*NAMES, *MEASURED) if name not in taken]
    return [(name, unit_of_parameter(name), value_of(dynamics.rig, name)) for name in names]


def _change(dynamics: InverseDynamics, name: str, value: float) -> tuple[float, bool]:
    rig = dynamics.rig
    if name in rig.assumed:
        return assumed_std(rig, name), True
    return (CHANGE * abs(value) if value else FRICTION_CHANGE), False


def _beside(dynamics: InverseDynamics, name: str, value: float) -> tuple[Rig, float]:
    """Return the rig with another value of a fixed number, and the step to it."""
    step = STEP * abs(value) if value else STEP
    return with_parameters(dynamics.rig, {name: value + step}), step


def _moved_to(
    dynamics: InverseDynamics, values: Floats, rig: Rig
) -> tuple[InverseDynamics, Floats]:
    """Return the dynamics of another rig, and the values of its parameters."""
    values = values.copy()
    # The angle is the measured velocity over this arm.
    gain = [p.name for p in dynamics.free].index(VELOCITY_GAIN)
    values[gain] *= dynamics.rig.key.laser_arm / rig.key.laser_arm
    return InverseDynamics(rig, dynamics.free, dynamics.presses, dynamics.level), values
