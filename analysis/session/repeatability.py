"""Repeatability and accuracy of the presses of a session, as defined by ISO 9283.

The path is the rise of the jack over the time after the trigger, one-dimensional; its velocity is
that of the jack. Deviations are those of the measured presses from their mean (repeatability) or
from the plan (accuracy); as in the standard, the spread is three standard deviations.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.press import Press
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.timing import PressLaw

LEAST = 3  # Fewest presses for a spread
COVERAGE = 0.95  # Dimensionless coverage of the intervals
NORMAL = 1.96  # Half of that of a normal error, in standard uncertainties
CHANCE = 1e-3  # Probability that a change between presses is said of presses without one


@dataclass(frozen=True)
class Spread:
    """A figure with its interval, for normally distributed presses."""

    value: float
    low: float
    """Lower end of the 95 % interval."""
    high: float
    """Upper end of the 95 % interval."""


def student(degrees: float) -> float:
    """Return half the width of Student's interval over the standard error."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees, (1 + COVERAGE) / 2))


def interval_of(
    value: float, variance: float, shared: Floats | float, degrees: float
) -> tuple[tuple[float, float, float], float, float]:
    """Return a value with its interval, its standard uncertainty, and its degrees of freedom.

    Args:
        variance: By presses, which has these degrees.
        shared: Standard uncertainties by other errors, which are known, shape (n,). The degrees are
            then those of Welch and Satterthwaite (JCGM 100, G.4).
    """
    total = variance + float(np.sum(np.square(shared)))
    degrees *= (total / max(variance, 1e-6 * total)) ** 2 if total else 1.0
    reach = student(degrees) * total**0.5
    return (value, value - reach, value + reach), total**0.5, degrees


def interval(spread: Spread | None, scale: float = 1.0, digits: int = 4) -> str:
    """Return a figure with its interval: `0.34 (0.3 to 0.38)`; `-` for None."""
    if spread is None:
        return "-"
    value, low, high = (f"{scale * v:.{digits}g}" for v in (spread.value, spread.low, spread.high))
    return f"{value} ({low} to {high})"


@dataclass(frozen=True)
class Trend(Spread):
    """Change of a quantity per press, from a straight line through all presses."""

    chance: float = 0.0
    """Probability of so large a change of presses without one."""

    @property
    def significant(self) -> bool:
        """Whether it is reported; of the drifts of a session without one, at most 5 % are."""
        return self.chance < 0.01  # Five are tested, of the presses and of the motion


@dataclass(frozen=True)
class Repeatability:
    """Presses of one plan against each other, over the cruise."""

    presses: int
    path_repeatability: float
    """m, RT_p: largest over the path of mean distance from the mean path plus 3 s."""
    path_accuracy: float
    """m, AT_p: largest distance of the mean path from the planned one."""
    velocity_accuracy: float
    """Dimensionless, AV: mean speed over the planned speed, minus 1."""
    velocity_repeatability: Spread
    """Dimensionless, RV: three standard deviations of the mean speeds, over the planned one."""
    velocity_fluctuation: float
    """Dimensionless, FV: largest range of speed within one press, over the planned one."""
    rise_drift: Trend
    """m per press, of the mean rise."""
    speed_drift: Trend
    """Dimensionless per press, of the mean speed over the planned one."""


def repeatability(presses: Sequence[Press], law: PressLaw) -> Repeatability:
    """Compare presses of one plan with each other, each from the start of its motion.

    Raises:
        AnalysisError: There are fewer than `LEAST`, or one does not cover the cruise.
    """
    if len(presses) < LEAST:
        raise AnalysisError(
            f"repeatability of {len(presses)} presses: at least {LEAST} are needed; record more"
        )
    time = np.linspace(law.cruise_start, law.cruise_end, 200)
    _check(presses, time)
    rise = np.array([_at(p, "jack_rise", time) for p in presses])
    # Between the midpoints of the instants, which averages the noise.
    edges = np.concatenate([time[:1], (time[1:] + time[:-1]) / 2, time[-1:]])
    speed = np.array([np.diff(_at(p, "jack_rise", edges)) / np.diff(edges) for p in presses])
    planned = law.law.at(time)
    fast = float(np.abs(planned.velocity).max())
    mean = rise.mean(axis=0)
    distance = np.abs(rise - mean)
    # ISO 9283, 7.10: RT_p = max of (mean distance + 3 standard deviations of the distance).
    path = (distance.mean(axis=0) + 3 * distance.std(axis=0, ddof=1)).max()
    speeds = speed.mean(axis=1) / fast
    return Repeatability(
        presses=len(presses),
        path_repeatability=float(path),
        path_accuracy=float(np.abs(mean - planned.position).max()),
        velocity_accuracy=float(speeds.mean() - planned.velocity.mean() / fast),
        velocity_repeatability=_spread(speeds),
        velocity_fluctuation=float(np.ptp(speed, axis=1).max() / fast),
        rise_drift=trend_of(rise.mean(axis=1)),
        speed_drift=trend_of(speeds),
    )


def _check(presses: Sequence[Press], time: Floats) -> None:
    short = []
    for press in presses:
        first, last = press.time[[0, -1]] - _start(press)
        if first > time[0] or last < time[-1]:
            short.append(f"{press.path} ends at {last:.4g} s")
    if short:
        raise AnalysisError(
            f"the cruise lasts from {time[0]:.4g} to {time[-1]:.4g} s after the start of the"
            f" motion, but {', '.join(short)}; exclude these presses, or record for longer"
        )


def _start(press: Press) -> float:
    """Return the start of a press's motion, from which its plan counts, in its own time [s]."""
    return press.motion.time if press.motion else 0.0


def _at(press: Press, column: str, time: Floats) -> Floats:
    return np.interp(time + _start(press), press.time, press.samples[column])


def _spread(values: Floats) -> Spread:
    """Return three standard deviations, with the chi-squared interval of normal values."""
    from scipy.special import gammaincinv

    free = len(values) - 1
    sigma = float(values.std(ddof=1))
    tail = (1 - COVERAGE) / 2
    low, high = (np.sqrt(free / 2 / gammaincinv(free / 2, p)) for p in (1 - tail, tail))
    return Spread(3 * sigma, float(3 * sigma * low), float(3 * sigma * high))


def trend_of(values: Floats) -> Trend:
    """Return the slope over the number of the press, with Student's interval.

    Args:
        values: Values of three or more presses in their order, shape (presses,).
    """
    from scipy.special import stdtr

    number, slope, left = _line(values)
    free = len(values) - 2
    error = float(np.sqrt(left @ left / free / (number @ number)))
    reach = student(free) * error
    chance = 2 * stdtr(free, -abs(slope) / error) if error else float(slope == 0)
    return Trend(slope, slope - reach, slope + reach, float(chance))


def _line(values: Floats) -> tuple[Floats, float, Floats]:
    """Return the numbers of presses from their middle, the slope over them, and the residuals."""
    number = np.arange(len(values), dtype=float) - (len(values) - 1) / 2
    slope = float(number @ values / (number @ number))
    return number, slope, values - values.mean() - slope * number


@dataclass(frozen=True)
class Step:
    """A quantity that changed between two presses, in its unit."""

    before: int
    """Number of presses before the change."""
    first: float
    """Their mean."""
    second: float
    """Mean of the presses after the change."""


def step_of(values: Floats) -> Step | None:
    """Return the likeliest change of the mean between two presses; None where there is none.

    A change of two means (Student's t) whose probability by chance, times the number of places
    where it may be, is below `CHANCE`, and that leaves less than a straight line does.

    Args:
        values: Values of presses in their order, shape (presses,).
    """
    from scipy.special import stdtr

    n = len(values)
    if n < LEAST or np.ptp(values) == 0:
        return None
    place = np.arange(1, n)
    total = values.cumsum()
    first, second = total[:-1] / place, (total[-1] - total[:-1]) / (n - place)
    left = values @ values - place * first**2 - (n - place) * second**2
    best = int(left.argmin())
    *_, of_line = _line(values)
    if left[best] >= of_line @ of_line:
        return None
    k = int(place[best])
    error = np.sqrt(max(left[best], 0.0) / (n - 2) * (1 / k + 1 / (n - k)))
    gone = abs(second[best] - first[best])
    if 2 * stdtr(n - 2, -gone / max(error, 1e-300)) * (n - 1) > CHANCE:
        return None
    return Step(k, float(first[best]), float(second[best]))
