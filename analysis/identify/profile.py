"""The profile likelihood of a fitted parameter: how well every other value of it would do.

Each value is held while all else is fitted again. Where twice the log of the likelihood has
fallen by 3.84 the value lies at the end of the 95 % interval (Wilks 1938), straight error
propagation or not: a parameter that a bound stops, or that data hardly tell, shows it here.
"""

from dataclasses import dataclass

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.fit import Fit
from sautereau.analysis.identify.identified import Identified
from sautereau.analysis.identify.problem import descend
from sautereau.trajectory.motion import Floats

CRITICAL = 3.841
"""1, 95 % point of chi squared of one degree of freedom."""
STEPS = 8
"""Values that are tried either way at the most."""
REACH = 4.0
"""1, standard uncertainties that the last of them is away."""


@dataclass(frozen=True)
class Profile:
    """Of one parameter; arrays of shape (n,), by growing value."""

    name: str
    values: Floats
    """SI."""
    rises: Floats
    """1, of twice the negative log likelihood above its least."""
    low: float | None
    """SI, lower end of the 95 % interval; None where a bound comes before it."""
    high: float | None
    """SI, upper end of the 95 % interval; None where a bound comes before it."""


def profile(made: Fit, found: Identified, name: str) -> Profile:
    """Return the profile of one parameter around a fit.

    Args:
        made: The fit.
        found: What it told.
        name: Of the parameter.

    Raises:
        AnalysisError: It was not fitted.
    """
    names = [p.name for p in made.problem.free]
    estimate = next((e for e in found.estimates if e.name == name), None)
    if estimate is None:
        fitted = ", ".join(e.name for e in found.estimates)
        raise AnalysisError(f"{name}: it was not fitted, so it has no profile; there are {fitted}")
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
