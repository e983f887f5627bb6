"""The profile likelihood of a fitted parameter.

The parameter is fixed at a series of values while all others are fitted again. Where twice the
log-likelihood is 3.84 below its maximum, the value is an end of the 95 % interval (Wilks 1938).
This holds for non-linear problems too, and for parameters at a bound or hardly identifiable.
"""

from dataclasses import dataclass

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.fit import Fit
from sautereau.analysis.identify.identified import Identified
from sautereau.analysis.identify.problem import descend
from sautereau.trajectory.motion import Floats

CRITICAL = 3.841
"""95 % quantile of chi squared with one degree of freedom."""
STEPS = 8
"""Largest number of values on either side."""
REACH = 4.0
"""Standard uncertainties from the estimate to the last of these values."""


@dataclass(frozen=True)
class Profile:
    """Profile of one parameter; arrays of shape (n,), in ascending order of the value."""

    name: str
    values: Floats
    """SI."""
    rises: Floats
    """Twice the negative log-likelihood minus its minimum."""
    low: float | None
    """SI, lower end of the 95 % interval; None where the bound is inside the interval."""
    high: float | None
    """SI, upper end of the 95 % interval; None where the bound is inside the interval."""


def profile(made: Fit, found: Identified, name: str) -> Profile:
    """Return the profile of one parameter around a fit.

    Args:
        made: The fit.
        found: Its result.
        name: Of the parameter.

    Raises:
        AnalysisError: The parameter was not fitted.
    """
    names = [p.name for p in made.problem.free]
    estimate = next((e for e in found.estimates if e.name == name), None)
    if estimate is None:
        fitted = ", ".join(e.name for e in found.estimates)
        raise AnalysisError(
            f"{name}: it was not fitted, so it has no profile; fitted parameters: {fitted}"
        )
    at = names.index(name)
    parameter = made.problem.free[at]
    residuals = made.problem.all(made.values / made.problem.scales)
    least, excess = float(residuals @ residuals), made.excess
    step = (parameter.high - parameter.low) / STEPS
    if estimate.std is not None:
        step = min(step, estimate.std * REACH / STEPS)
    values, rises, ends = [estimate.value], [0.0], []
    for sign in (-1.0, 1.0):
        start, end = made.values, None
        last = (estimate.value, 0.0)
        for number in range(1, STEPS + 1):
            value = estimate.value + sign * number * step
            value = min(max(value, parameter.low), parameter.high)
            if value == last[0]:
                break
            start = start.copy()
            start[at] = value
            cost, start = descend(made.problem, start, fixed=at)
            rise = max(0.0, (2 * cost - least) / excess)
            values.append(value)
            rises.append(rise)
            if rise >= CRITICAL:
                roots = np.sqrt([last[1], rise])
                end = float(np.interp(np.sqrt(CRITICAL), roots, [last[0], value]))
                break
            last = (value, rise)
        ends.append(end)
    order = np.argsort(values)
    return Profile(name, np.array(values)[order], np.array(rises)[order], ends[0], ends[1])
