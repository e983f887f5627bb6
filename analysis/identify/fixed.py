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

from sautereau.analysis.errors import ModelError
from sautereau.analysis.identify import parameters
from sautereau.analysis.identify.fit import DEPENDENT, Fit
from sautereau.analysis.identify.information import Information
from sautereau.analysis.identify.problem import Problem, white
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

STEP = 1e-3  # Relative step of numerical derivatives
SUGGESTED = 16.0  # Reduction of the sum of squares to suggest freeing: 4 standard deviations


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

    Args:
        slopes: `Problem.differences` at the values.
    """

    def __init__(
        self, problem: Problem, values: Floats, slopes: Floats, spread: float, free_offset: bool
    ):
        self.problem = replace(problem, whitenings=white(problem.dynamics, spread, free_offset))
        point = values / problem.scales
        own = np.vstack([self.problem.white(slopes), self.problem.prior_jacobian])
        self._basis, _ = np.linalg.qr(own)
        self._residuals = np.append(self.problem.data(point), self.problem.prior(point))

    def freed(self, columns: Sequence[Floats]) -> tuple[Floats, float]:
        """Return the changes of numbers that are freed together, and the reduction.

        Args:
            columns: Derivatives of `InverseDynamics.joined` by each number.
        """
        rows = self.problem.white(np.stack(columns, axis=1))
        rows = np.pad(rows, ((0, len(self._residuals) - len(rows)), (0, 0)))
        left = rows - self._basis @ (self._basis.T @ rows)
        sizes = np.linalg.norm(left, axis=0)
        left[:, sizes <= 3e-5 * np.linalg.norm(rows, axis=0)] = 0.0
        scales = np.maximum(sizes, 1e-300)
        steps = -np.linalg.lstsq(left / scales, self._residuals, rcond=1e-6)[0]
        moved = left / scales @ steps
        return steps / scales, float(moved @ moved)


@dataclass(frozen=True)
class Fixed:
    """A number of the rig that is neither fitted nor known to within a range only."""

    name: str
    unit: str
    value: float
    """SI; of `plectrum.contact`, the last one, 1 on the surface and 0 on the mid-line."""
    column: Floats | None
    """Derivatives of `InverseDynamics.joined` by it, shape (n,); None if the model has no solution
    after the step."""


def fixed_numbers(fitted: Fit) -> list[Fixed]:
    """Return the fixed numbers at the values of a fit."""
    dynamics, found = fitted.problem.dynamics, []
    rig, before = dynamics.rig, dynamics.joined(fitted.values)

    def add(name: str, unit: str, value: float, step: float, after: Rig) -> None:
        column = derivative(before, dynamics.on(after), fitted.values, step)
        found.append(Fixed(name, unit, value, column))

    for name in parameters.unfitted(rig, [p.name for p in dynamics.free]):
        if name not in rig.assumed:
            value = parameters.value_of(rig, name)
            step = STEP * abs(value) or STEP
            after = parameters.with_parameters(rig, {name: value + step})
            add(name, parameters.unit_of_parameter(name), value, step, after)
    on_surface = rig.plectrum.contact == "surface"
    other = rig.replaced({parameters.CONTACT: "mid-line" if on_surface else "surface"})
    add(parameters.CONTACT, "", float(on_surface), 1.0, other)
    return found


def derivative(
    before: Floats, dynamics: InverseDynamics, values: Floats, step: float
) -> Floats | None:
    """Return the derivative of `InverseDynamics.joined` by a number that is not a parameter.

    It is None if the model has no solution after the step.

    Args:
        before: Residuals before the step.
        dynamics: Inverse dynamics after the step.
        values: SI, values of its parameters.
    """
    try:
        return (dynamics.joined(values) - before) / step
    except ModelError:
        return None


def sensitivities(
    fitted: Fit, fixed: Sequence[Fixed], jacobian: Floats, excess: float, known: Information
) -> tuple[Sensitivity, ...]:
    """Return the effects of fixed numbers and of hidden parameters, the largest effect first.

    Args:
        fixed: Its fixed numbers.
        jacobian: Derivatives of its whitened residuals by the scaled parameters.
        excess: Mean square of the whitened residuals.
        known: The information of the fit.
    """
    problem, table = fitted.problem, []
    shown = [k for k, p in enumerate(problem.free) if not p.hidden]
    rows = np.vstack([jacobian / np.sqrt(excess), problem.prior_jacobian])
    gain = np.linalg.pinv(rows, rcond=1e-9)[:, : len(jacobian)] / np.sqrt(excess)

    def add(name: str, unit: str, value: float, change: float, stated: bool, by: Floats) -> None:
        effects = {problem.free[k].name: float(by[k]) for k in shown}
        table.append(Sensitivity(name, unit, value, change, stated, effects))

    for k, parameter in enumerate(problem.free):
        if parameter.hidden and parameter.std:
            by = known.by(k) * parameter.std / problem.scales[k]
            value = float(fitted.values[k])
            add(parameter.name, parameter.unit, value, parameter.std, True, by)
    for number in fixed:
        # Without an assumed range: 1 % or, of a number that is 0 such as a friction, 0.1.
        change = 0.01 * abs(number.value) or 0.1
        change = 1.0 if number.name == parameters.CONTACT else change
        if number.column is not None:
            by = gain @ problem.white(number.column) * -change
            add(number.name, number.unit, number.value, change, False, by)
    return tuple(sorted(table, key=lambda s: -max(map(abs, s.effects.values()), default=0.0)))


def suggestions(
    fitted: Fit, fixed: Sequence[Fixed], slopes: Floats, noise: float
) -> tuple[Suggestion, ...]:
    """Return the fixed numbers that should be freed, the largest reduction first.

    Args:
        fitted: A fit whose model does not fit.
        fixed: Its fixed numbers.
        slopes: Its `Problem.differences`.
        noise: N, RMS of the part of the force residual that is no error of the model.
    """
    rig, floor = fitted.problem.dynamics.rig, fitted.problem.dynamics.floor
    spread = float(np.hypot(noise, floor) * np.sqrt(DEPENDENT))
    test = ScoreTest(fitted.problem, fitted.values, slopes, spread, fitted.free_offset)
    found, of_contact = [], []
    for number in fixed:
        name, unit, value = number.name, number.unit, number.value
        on_surface = name == parameters.CONTACT and value
        if name in parameters.MEASURED or on_surface or number.column is None:
            continue
        moved, reduction = test.freed([number.column])
        step = float(moved[0])
        if name == parameters.CONTACT:
            # The step is the offset of the string's centre, as a fraction of that on the surface.
            # Else the fitted offset from the mid-line is too small over that on the surface.
            if reduction > SUGGESTED and step > 0.4:
                of_contact = [Suggestion(name, unit, reduction, 1.0)]
            continue
        low, high = parameters.bounds_of(rig, name)
        if low == high:
            high = np.inf
        # An impossible value is not the cause. A linear step may be too long, however.
        if reduction > SUGGESTED and low <= value + step <= high + (high - low):
            found.append(Suggestion(name, unit, reduction, min(value + step, high)))
    # The contact comes first, because friction has a similar effect.
    return (*of_contact, *sorted(found, key=lambda s: -s.reduction))
