"""The numbers that a fit keeps fixed: their effects on the results, and which should be freed.

Let r be the whitened residuals and priors, J their Jacobian by the fitted parameters, and c their
derivative by a fixed number. A unit change of the number changes the fitted values by -J^+ c. The
part of c that the parameters do not explain is d = c - J J^+ c. If the number is freed, a
Gauss-Newton step changes it by -(d r) / (d d) and reduces the sum of squares of r by
(d r)^2 / (d d). This is the score test; for a correct number the reduction is 1 on average.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sautereau.analysis.identify.fit import DEPENDENT, Fit
from sautereau.analysis.identify.information import Information
from sautereau.analysis.identify.parameter_names import (
    CONTACT,
    FORCE,
    MODULUS,
    NAMES,
    STIFFNESS,
    VELOCITY_GAIN,
)
from sautereau.analysis.identify.parameters import (
    bounds_of,
    unit_of_parameter,
    value_of,
    with_parameters,
)
from sautereau.analysis.identify.problem import Problem
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.analysis.identify.whitening import white
from sautereau.rig.ranges import Deviation, deviations
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

MEASURED = (
    *("key.press_arm", "key.laser_arm", "key.jack_arm", "key.jack_surface_height"),
    *("plectrum.length", "plectrum.thickness"),
    *("string.tension", "string.length", "string.plucking_point", "string.diameter"),
)
"""Numbers of the rig that are measured with a ruler. They are never fitted."""
CHANGE = 0.01
"""Relative change in the table of effects of a number for which the rig assumes no range."""
FRICTION_CHANGE = 0.1
"""The same for a number that is 0, such as a coefficient of friction; absolute."""
STEP = 1e-3  # Relative step of numerical derivatives
LIKELY = 0.4
"""The string is suggested to lie on the surface if its fitted offset from the mid-line is more than
this fraction of the offset on the surface."""
SUGGESTED = 16.0
"""Reduction of the sum of squares above which freeing is suggested: 4 standard deviations."""


@dataclass(frozen=True)
class Sensitivity:
    """The effect of one fixed number of the rig, or of one calibration, on the results."""

    name: str
    unit: str
    value: float
    """SI; for `plectrum.contact` 1 is the surface and 0 the mid-line."""
    change: float
    """SI; the standard uncertainty if it has one, otherwise 1 % of the value; 1 for
    `plectrum.contact`."""
    stated: bool
    """Whether the change is its standard uncertainty: of a range that the rig assumes, of a
    calibration, or of a hidden parameter."""
    effects: dict[str, float]
    """Resulting change of each result, divided by the result's scale."""


@dataclass(frozen=True)
class Input:
    """A fixed number of the rig, and what its error does to the fit."""

    name: str
    change: float
    """SI; see `Sensitivity`."""
    effects: Floats
    """Change of the scaled parameters by it, shape (parameters,)."""
    deviation: Deviation | None
    """Its error; None if the rig assumes no range."""


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
    """The effects of freeing further numbers of a problem, at values [SI] of its parameters.

    The residuals are treated as independent, with a standard deviation of `spread` [N].
    """

    def __init__(self, problem: Problem, values: Floats, spread: float, free_offset: bool):
        self.problem = replace(problem, whitenings=white(problem.dynamics, spread, free_offset))
        point = values / problem.scales
        self._data, own = self.problem.data(point), self.problem.jacobian(point, self.problem.data)
        self._basis, _ = np.linalg.qr(np.vstack([own, self.problem.prior_jacobian]))
        self._residuals = np.concatenate([self._data, self.problem.prior(point)])

    def column(self, dynamics: InverseDynamics, values: Floats, step: float) -> Floats:
        """Return the derivative by a number; 0 if the model has no solution after the step.

        Arguments as for `Problem.by_another`.
        """
        column = self.problem.by_another(self._data, dynamics, values, step)
        column = np.zeros(len(self._data)) if column is None else column
        return np.append(column, np.zeros(len(self._residuals) - len(self._data)))

    def freed(self, columns: Sequence[Floats]) -> tuple[Floats, float]:
        """Return the changes of numbers that are freed together, and the reduction."""
        rows = np.stack(columns, axis=1)
        left = rows - self._basis @ (self._basis.T @ rows)
        sizes = np.linalg.norm(left, axis=0)
        left[:, sizes <= 3e-5 * np.linalg.norm(rows, axis=0)] = 0.0
        scales = np.maximum(sizes, 1e-300)
        steps = -np.linalg.lstsq(left / scales, self._residuals, rcond=1e-6)[0]
        moved = left / scales @ steps
        return steps / scales, float(moved @ moved)


def fixed_inputs(fitted: Fit, jacobian: Floats, excess: float) -> list[Input]:
    """Return the fixed numbers of a fit with their effects.

    Args:
        jacobian: Derivatives of its whitened residuals by the scaled parameters.
        excess: Mean square of the whitened residuals.
    """
    problem, dynamics = fitted.problem, fitted.problem.dynamics
    rows = np.vstack([jacobian / np.sqrt(excess), problem.prior_jacobian])
    gain = np.linalg.pinv(rows, rcond=1e-9)[:, : len(jacobian)] / np.sqrt(excess)
    whitened = problem.data(fitted.values / problem.scales)
    rig, numbers, found = dynamics.rig, _fixed(dynamics), []

    def add(name: str, change: float, moved: Rig, step: float, error: Deviation | None) -> None:
        column = problem.by_another(whitened, *_moved_to(dynamics, fitted.values, moved), step)
        if column is not None:
            found.append(Input(name, change, gain @ column * -change, error))

    for error in deviations(rig, numbers):
        add(error.name, error.std, *_beside(dynamics, error.keys), error)
    for name in [name for name in numbers if name not in rig.assumed]:
        change = CHANGE * abs(value_of(rig, name)) or FRICTION_CHANGE
        add(name, change, *_beside(dynamics, [name]), None)
    add(CONTACT, 1.0, _other_contact(rig), 1.0, None)
    return found


def sensitivities(
    fitted: Fit, inputs: Sequence[Input], known: Information
) -> tuple[Sensitivity, ...]:
    """Return the effects of fixed numbers and of hidden parameters, the largest effect first."""
    problem, rig, table = fitted.problem, fitted.problem.dynamics.rig, []
    shown = [k for k, p in enumerate(problem.free) if not p.hidden]

    def add(name: str, unit: str, value: float, change: float, stated: bool, by: Floats) -> None:
        effects = {problem.free[k].name: float(by[k]) for k in shown}
        table.append(Sensitivity(name, unit, value, change, stated, effects))

    for k, parameter in enumerate(problem.free):
        if parameter.hidden and parameter.std:
            by = known.by(k) * parameter.std / problem.scales[k]
            value = float(fitted.values[k])
            add(parameter.name, parameter.unit, value, parameter.std, True, by)
    for i in inputs:
        unit, value = "", float(rig.plectrum.contact == "surface")
        if i.name != CONTACT:
            unit, value = unit_of_parameter(i.name), value_of(rig, i.name)
        add(i.name, unit, value, i.change, i.deviation is not None, i.effects)
    return tuple(sorted(table, key=lambda s: -max(map(abs, s.effects.values()), default=0.0)))


def suggestions(fitted: Fit, noise: float) -> tuple[Suggestion, ...]:
    """Return the fixed numbers that should be freed, the largest reduction first.

    Args:
        fitted: A fit whose model does not fit.
        noise: N, RMS of the part of the force residual that is no error of the model.
    """
    dynamics = fitted.problem.dynamics
    test = ScoreTest(fitted.problem, fitted.values, noise * np.sqrt(DEPENDENT), fitted.free_offset)

    def freed(rig: Rig, step: float) -> tuple[float, float]:
        moved, reduction = test.freed([test.column(*_moved_to(dynamics, fitted.values, rig), step)])
        return float(moved[0]), reduction

    found = []
    for name in _fixed(dynamics):
        if name in MEASURED:
            continue
        unit, value = unit_of_parameter(name), value_of(dynamics.rig, name)
        step, reduction = freed(*_beside(dynamics, [name]))
        low, high = bounds_of(dynamics.rig, name)
        if low == high:
            high = np.inf
        # An impossible value is not the cause. A linear step may be too long, however.
        if reduction > SUGGESTED and low <= value + step <= high + (high - low):
            found.append(Suggestion(name, unit, reduction, min(value + step, high)))
    found.sort(key=lambda s: -s.reduction)
    if dynamics.rig.plectrum.contact == "mid-line":
        # The step is the offset of the string's centre, as a fraction of that on the surface.
        step, reduction = freed(_other_contact(dynamics.rig), 1.0)
        if reduction > SUGGESTED and step > LIKELY:
            # It comes first, because friction has a similar effect.
            found.insert(0, Suggestion(CONTACT, "", reduction, 1.0))
    return tuple(found)


def _other_contact(rig: Rig) -> Rig:
    """Return the rig with the string on the surface instead of the mid-line, or vice versa."""
    other = "mid-line" if rig.plectrum.contact == "surface" else "surface"
    return rig.replaced({"plectrum.contact": other})


def _fixed(dynamics: InverseDynamics) -> list[str]:
    """Return the fixed numbers of the model; of modulus and stiffness the one with a range."""
    free, of_plectrum = {p.name for p in dynamics.free}, {MODULUS, STIFFNESS}
    if free.isdisjoint(of_plectrum):
        of_plectrum = {STIFFNESS if MODULUS in dynamics.rig.assumed else MODULUS}
    taken = free | {FORCE} | of_plectrum
    return [name for name in (*NAMES, *MEASURED) if name not in taken]


def _beside(dynamics: InverseDynamics, names: Sequence[str]) -> tuple[Rig, float]:
    """Return the rig after a small common step of fixed numbers, and the step."""
    values = {name: value_of(dynamics.rig, name) for name in names}
    first = abs(values[names[0]])
    step = STEP * first if first else STEP
    return with_parameters(dynamics.rig, {n: v + step for n, v in values.items()}), step


def _moved_to(
    dynamics: InverseDynamics, values: Floats, rig: Rig
) -> tuple[InverseDynamics, Floats]:
    """Return the inverse dynamics of another rig, and the values of its parameters."""
    values = values.copy()
    # The angle follows from the measured velocity and this lever arm.
    gain = [p.name for p in dynamics.free].index(VELOCITY_GAIN)
    values[gain] *= dynamics.rig.key.laser_arm / rig.key.laser_arm
    return InverseDynamics(rig, dynamics.free, dynamics.presses, dynamics.level), values
