"""Release of a string: a sudden fall of the load on the key."""

import math
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.phases.levenberg import orthonormal
from sautereau.analysis.phases.rows import BRIDGED, Rows, rows_of
from sautereau.analysis.phases.signals import Signals
from sautereau.daq.signals.calibration import robust_std
from sautereau.trajectory.motion import Floats

LEAST_FALL = 4e-3  # N, least fall of a release


@dataclass(frozen=True)
class Release:
    """The release of a string."""

    time: float
    """s after the trigger."""
    std: float
    """s, standard uncertainty."""
    fall: float
    """N at the finger, fall of the load."""
    fall_std: float
    """N, standard uncertainty of the fall."""
    slowed: float
    """N, simultaneous fall of the subtracted inertia."""
    gain: float
    """Dimensionless, reduction of chi2 compared with a load that only bends."""
    noise: float
    """Dimensionless, variance of the residuals over the assumed noise, at least 1."""


NO_RELEASE = Release(math.inf, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0)  # A string that is not there


def find_falls(rows: Rows) -> list[int]:
    """Return the rows at which the load may have fallen suddenly, in order of time.

    Lines fitted before and after each row are extrapolated to it; their difference is the fall,
    independent of the slope.
    """
    n, gap = len(rows.load), 2  # rows on either side over which a fall is spread
    m = max(4, min(20, n // 12))
    if n < 2 * (m + gap) + 1:
        return []
    # Weights of the value at row 0 of the least-squares line through the rows from the gap on.
    away = np.arange(m) - (m - 1) / 2
    weights = 1 / m - (gap + (m - 1) / 2) * away / (away @ away)
    after = np.correlate(rows.load, weights, "valid")
    before = np.correlate(rows.load, weights[::-1], "valid")
    # Row r has the lines over r - gap - m + 1 .. r - gap and r + gap .. r + gap + m - 1.
    count = n - 2 * (m + gap) + 2
    fall = before[:count] - after[2 * gap + m - 1 :][:count]
    # A fall together with the acceleration of the key may be an error of the rig's inertia, by up
    # to 60 %.
    slowed = (
        np.correlate(rows.inertia, weights[::-1], "valid")[:count]
        - np.correlate(rows.inertia, weights, "valid")[2 * gap + m - 1 :][:count]
    )
    fall = fall - 0.6 * np.maximum(slowed, 0.0)
    first = m + gap - 1
    std = robust_std(fall)
    least = max(LEAST_FALL, 8 * std)
    found = []
    left = fall.copy()
    while len(left) and (best := int(np.argmax(left))) >= 0 and left[best] > least:
        row = first + best
        # As many rows as those of the shortest pluck must fall as well. At a contact, where the
        # load bends, they do not.
        if rows.load[row - gap - 8 : row - gap].mean() > rows.load[row + gap :][:8].mean():
            found.append(row)
        left[max(0, best - m) : best + m] = -np.inf
    return sorted(found)


def releases_in(signals: Signals, rows: Rows) -> list[Release]:
    """Return the sudden falls of the load in order of time, fitted to the samples around them."""
    near = [refine(signals, float(rows.time[fall]), rows.step) for fall in find_falls(rows)]
    # A fall of the load must reduce chi2 by 9, compared with a bend.
    return [each for each in near if each.gain > 9.0 and each.fall > LEAST_FALL]


def refine(signals: Signals, near: float, step: float) -> Release:
    """Return the instant of a fall, fitted to the samples around it.

    Args:
        near: s after the trigger, approximate instant.
        step: s, of the rows in which the fall was found.
    """
    # The instant of the candidate may be wrong by three rows.
    rate, reach, room = signals.rate, 3 * step, 40 * step
    middle = signals.sample(near)
    side = min(60 + int(reach * rate) + 1, max(8, int(room * rate)))
    first, last = max(0, middle - side), min(len(signals.time), middle + side + 1)
    rows = rows_of(signals, first, last, 1)
    tau = (rows.time - near) * rate
    fit = _Fall(tau, rows)
    high = min(reach * rate + 3, fit.span - 4)
    instants = np.linspace(-high, high, 17)
    found = fit.at(instants)
    bent = found.bent
    # Grids are refined to half a sample, where a fall reduces chi2 more than a bend.
    while (spacing := float(instants[1] - instants[0])) > 0.505 and bent - found.chi2.min() > 3:
        around = max(1.5 * spacing, 4.0)
        centre = float(instants[np.argmin(found.chi2)])
        instants = np.linspace(max(-high, centre - around), min(high, centre + around), 17)
        found = fit.at(instants)
        bent = min(bent, found.bent)
    best = int(np.argmin(found.chi2))
    noise = max(1.0, float(found.chi2[best]) / max(1, len(tau) - 6))
    chance = np.exp((found.chi2[best] - found.chi2) / (2 * noise))
    mean = float(instants @ chance / chance.sum())
    variance = float((instants - mean) ** 2 @ chance / chance.sum())
    bridged = bool(signals.no_velocity[first:last].any())
    near_by = np.abs(tau - mean) < side / 2
    before, after = near_by & (tau < mean - 2), near_by & (tau > mean + 2)
    return Release(
        time=near + mean / rate,
        # A signal sampled at points does not resolve the instant within a sample.
        std=math.hypot(math.sqrt(variance) / rate, signals.instant_std),
        fall=-float(found.step[best]),
        fall_std=math.hypot(
            float(found.step_std[best]) * math.sqrt(noise),
            BRIDGED * bridged,
            signals.fall_std * float(found.step[best]),
        ),
        slowed=_mean(rows.inertia[before]) - _mean(rows.inertia[after]),
        gain=(bent - float(found.chi2[best])) / noise,
        noise=noise,
    )


@dataclass(frozen=True)
class _Steps:
    """Fits of a load with a step at each of several instants; arrays of shape (n,)."""

    chi2: Floats
    """Sum of squared residuals in units of the noise; 1e12 more where the load rises."""
    step: Floats
    """N."""
    step_std: Floats
    """N, standard uncertainty for the assumed noise."""
    bent: float
    """Smallest chi2 of a load that only bends at one of them."""


class _Fall:
    """Least-squares fit of a parabola with a step and a bend at some instant to the load.

    Args:
        tau: Samples, times of the rows after the approximate fall.
        rows: One row per sample.
    """

    def __init__(self, tau: Floats, rows: Rows):
        self._tau, self._white = tau, rows.whitener()
        self.span = float(np.abs(tau).max())
        u = tau / self.span
        white = self._white(np.array([np.ones_like(u), u, u**2, rows.load]).T)
        self._base, _ = orthonormal(white[:, :3])
        self._target = white[:, 3] - self._base @ (self._base.T @ white[:, 3])
        self._free = float(self._target @ self._target)

    def at(self, instants: Floats) -> _Steps:
        """Return the fits with a step at each instant [samples]."""
        # Steps are 0 in the rows before the first instant.
        first = max(0, int(instants.min() - self._tau[0]))
        from_step = self._tau[first:] - instants[:, None]
        # A row is the mean load over a sample; in the sample of the fall, the step counts in part.
        part = np.minimum(np.maximum(from_step + 0.5, 0.0), 1.0)
        from_step *= part / self.span
        white = self._white(np.concatenate([part, from_step]).T, first).T
        of_step, of_bend = (white @ self._target[first:]).reshape(2, -1)
        # Solution of the normal equations of a step and a bend, without the parabola's part.
        by_base = white @ self._base[first:]
        own = (white * white).sum(1) - (by_base * by_base).sum(1) + 1e-9
        square_step, square_bend = own.reshape(2, -1)
        n = len(instants)
        both = (white[:n] * white[n:]).sum(1) - (by_base[:n] * by_base[n:]).sum(1)
        determinant = square_step * square_bend - both**2
        fall = (square_bend * of_step - both * of_bend) / determinant
        slope = (square_step * of_bend - both * of_step) / determinant
        chi2 = self._free - fall * of_step - slope * of_bend + 1e12 * (fall >= 0)
        bent = self._free - float((of_bend**2 / square_bend).max())
        return _Steps(chi2, fall, np.sqrt(square_bend / determinant), bent)


def _mean(signal: Floats) -> float:
    return float(signal.mean()) if len(signal) else 0.0
