"""The profile likelihood of a fitted parameter.

The parameter is fixed at a series of values, and all others are fitted again at each of them. The
95 % interval ends where twice the log-likelihood is 3.84 below its maximum (Wilks 1938). This is
valid for non-linear problems as well, for parameters at a bound and for poorly identifiable ones.
"""

from dataclasses import dataclass

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.fit import Fit
from sautereau.analysis.identify.identified import Identified
from sautereau.analysis.identify.problem import minimise
from sautereau.trajectory.motion import Floats

CRITICAL = 3.841  # 95 % quantile of the chi-squared distribution with one degree of freedom
STEPS = 8  # Largest number of values on either side of the estimate
REACH = 4.0  # Distance of the last of these values from the estimate, in standard uncertainties


@dataclass(frozen=True)
class Profile:
    """Profile of one parameter; arrays of shape (n,), in ascending order of the value."""

    name: str
    values: Floats
    """SI."""
    rises: Floats
    """Twice the negative log-likelihood, minus its minimum."""
    low: float | None
    """Lower end of the 95 % interval, SI; None if the interval reaches the bound."""
    high: float | None
    """Upper end of the 95 % interval, SI; None if the interval reaches the bound."""


def profile(fitted: Fit, found: Identified, name: str) -> Profile:
    """Return the profile of one parameter around a fit.

    Raises:
        AnalysisError: The parameter was not fitted.
    """
    names = [p.name for p in fitted.problem.free]
    estimate = next((e for e in found.estimates if e.name == name), None)
    if estimate is None:
        results = ", ".join(e.name for e in found.estimates)
        raise AnalysisError(
            f"{name}: it was not fitted, so it has no profile; fitted parameters: {results}"
        )
    at = names.index(name)
    parameter = fitted.problem.free[at]
    residuals = fitted.problem.all(fitted.values / fitted.problem.scales)
    least, excess = float(residuals @ residuals), fitted.excess
    step = (parameter.high - parameter.low) / STEPS
    if estimate.std is not None:
        step = min(step, estimate.std * REACH / STEPS)
    values, rises, ends = [estimate.value], [0.0], []
    for sign in (-1.0, 1.0):
        start, end = fitted.values, None
        last = (estimate.value, 0.0)
        for number in range(1, STEPS + 1):
            value = estimate.value + sign * number * step
            value = min(max(value, parameter.low), parameter.high)
            if value == last[0]:
                break
            start = start.copy()
            start[at] = value
            cost, start = minimise(fitted.problem, start, fixed=at)
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
