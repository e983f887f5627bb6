"""When a string was let go: a sudden fall of the load on the key."""

import math
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.phases.signals import Signals
from sautereau.analysis.phases.stroke import BRIDGED, Rows, rows_of
from sautereau.trajectory.motion import Floats

WINDOW = 20
"""Rows of the lines that are fitted on either side of a fall."""
GAP = 2
"""Rows beside a fall over which it is spread."""
SIGNIFICANCE = 8.0
"""Standard deviations that a fall must exceed."""
LEAST_FALL = 0.02
"""N, below which a fall is no release whatever the noise."""
REACH, ROOM = 3, 40
"""Rows by which a fall may be off, and on either side of it that its instant is taken from."""
SIDE = 60
"""Samples on either side of the release, at most, from which its instant is taken."""
TRIED, FINEST, ZOOMS = 17, 0.5, 12
"""Instants that are tried at once, samples between them in the end, and times to close in."""
RIDGE, PARAMETERS = 1e-9, 6
"""1, that keeps a fit of nothing solvable, and parameters of a fit."""
RISES = 1e12
"""1, added to the misfit of an instant at which the load does not fall."""
WRONG_INERTIA = 0.6
"""1, share by which key and jack's inertia may be more than the rig's."""


@dataclass(frozen=True)
class Release:
    """A string let go."""

    time: float
    """s from the trigger."""
    std: float
    """s, standard uncertainty."""
    fall: float
    """N at the finger, of the load."""
    fall_std: float
    """N, standard uncertainty of the fall."""
    slowed: float
    """N, by which the inertia that was taken off falls there as well."""
    gain: float
    """1, by which the misfit is less than that of a load which only bends."""


def find_falls(rows: Rows) -> list[int]:
    """Return the rows at which the load may have fallen at once, in order of time.

    Lines fitted before and after each row are carried on to it; their gap is a fall whatever
    the slope.
    """
    n = len(rows.load)
    m = max(4, min(WINDOW, n // 12))
    if n < 2 * (m + GAP) + 1:
        return []
    # Of the value at row 0 of the line with the least squares through rows GAP and on.
    away = np.arange(m) - (m - 1) / 2
    weights = 1 / m - (GAP + (m - 1) / 2) * away / (away @ away)
    after = np.correlate(rows.load, weights, "valid")
    before = np.correlate(rows.load, weights[::-1], "valid")
    # Row r has the lines over r - GAP - m + 1 .. r - GAP and r + GAP .. r + GAP + m - 1.
    count = n - 2 * (m + GAP) + 2
    fall = before[:count] - after[2 * GAP + m - 1 :][:count]
    # What falls with the key's acceleration may be the rig's wrong inertia.
    slowed = (
        np.correlate(rows.inertia, weights[::-1], "valid")[:count]
        - np.correlate(rows.inertia, weights, "valid")[2 * GAP + m - 1 :][:count]
    )
    fall = fall - WRONG_INERTIA * np.maximum(slowed, 0.0)
    first = m + GAP - 1
    std = robust_std(fall)
    least = max(LEAST_FALL, SIGNIFICANCE * std)
    found = []
    left = fall.copy()
    while len(left) and (best := int(np.argmax(left))) >= 0 and left[best] > least:
        found.append(first + best)
        left[max(0, best - m) : best + m] = -np.inf
    return sorted(found)


def refine(signals: Signals, near: float, step: float) -> Release:
    """Return the instant of a fall, from the samples beside it.

    Args:
        signals: Of the press.
        near: s, about when.
        step: s, of the rows in which it was found.
    """
    rate, reach, room = signals.rate, REACH * step, ROOM * step
    middle = signals.sample(near)
    side = min(SIDE + int(reach * rate) + 1, max(8, int(room * rate)))
    first, last = max(0, middle - side), min(len(signals.time), middle + side + 1)
    rows = rows_of(signals, first, last, 1)
    tau = (rows.time - near) * rate
    fit = _Fall(tau, rows)
    high = min(reach * rate + 3, fit.span - 4)
    instants = np.linspace(-high, high, TRIED)
    found = fit.at(instants)
    bent = found.bent
    for _ in range(ZOOMS):
        spacing = float(instants[1] - instants[0])
        if spacing < 1.01 * FINEST:
            break
        around = max(1.5 * spacing, FINEST * (TRIED - 1) / 2)
        centre = float(instants[np.argmin(found.misfit)])
        instants = np.linspace(max(-high, centre - around), min(high, centre + around), TRIED)
        found = fit.at(instants)
        bent = min(bent, found.bent)
    best = int(np.argmin(found.misfit))
    noise = max(1.0, float(found.misfit[best]) / max(1, len(tau) - PARAMETERS))
    chance = np.exp((found.misfit[best] - found.misfit) / (2 * noise))
    mean = float(instants @ chance / chance.sum())
    variance = float((instants - mean) ** 2 @ chance / chance.sum())
    bridged = bool(signals.no_velocity[first:last].any())
    near_by = np.abs(tau - mean) < side / 2
    before, after = near_by & (tau < mean - GAP), near_by & (tau > mean + GAP)
    return Release(
        time=near + mean / rate,
        # Where in a sample it fell is not told by a signal that is sampled at a point.
        std=math.hypot(math.sqrt(variance) / rate, signals.instant_std),
        fall=-float(found.step[best]),
        fall_std=math.hypot(float(found.step_std[best]) * math.sqrt(noise), BRIDGED * bridged),
        slowed=0.0 if bridged else _mean(rows.inertia[before]) - _mean(rows.inertia[after]),
        gain=(bent - float(found.misfit[best])) / noise,
    )


@dataclass(frozen=True)
class _Steps:
    """Of a load that steps at several instants; arrays of shape (n,)."""

    misfit: Floats
    """1, sum of squares in units of the noise; `RISES` more where it steps up."""
    step: Floats
    """N."""
    step_std: Floats
    """N, standard uncertainty for noise as it is supposed to be."""
    bent: float
    """1, least misfit of a load that only bends at one of them."""


class _Fall:
    """A load that is a parabola, and from some instant on a step and a bend besides.

    Args:
        tau: Samples, times of the rows from about the fall on.
        rows: One a sample.
    """

    def __init__(self, tau: Floats, rows: Rows):
        self._tau, self._white = tau, rows.whitener()
        self.span = float(np.abs(tau).max())
        u = tau / self.span
        self._base, _ = np.linalg.qr(self._white(np.stack([np.ones_like(u), u, u**2], 1)))
        load = self._white(rows.load)
        self._target = load - self._base @ (self._base.T @ load)

    def at(self, instants: Floats) -> _Steps:
        """Return the fits with a step at each instant [samples]."""
        from_step = self._tau - instants[:, None]
        # A row is the load over a sample's length: of the one in which it falls, a share.
        share = np.minimum(np.maximum(from_step + 0.5, 0.0), 1.0)
        columns = np.concatenate([share, share * from_step / self.span])
        columns = self._white(columns.T).T
        columns = columns - (columns @ self._base) @ self._base.T
        step, bend = columns.reshape(2, len(instants), -1)
        of_step, of_bend = (columns @ self._target).reshape(2, -1)
        # The normal equations of a step and a bend, solved.
        both = (step * bend).sum(1)
        square_step, square_bend = (step * step).sum(1) + RIDGE, (bend * bend).sum(1) + RIDGE
        determinant = square_step * square_bend - both**2
        fall = (square_bend * of_step - both * of_bend) / determinant
        slope = (square_step * of_bend - both * of_step) / determinant
        free = float(self._target @ self._target)
        misfit = free - fall * of_step - slope * of_bend + RISES * (fall >= 0)
        bent = free - float((of_bend**2 / square_bend).max())
        return _Steps(misfit, fall, np.sqrt(square_bend / determinant), bent)


def robust_std(signal: Floats) -> float:
    """Return the standard deviation of most of a signal, from its median absolute deviation."""
    return 1.4826 * float(np.median(np.abs(signal - np.median(signal))))


def _mean(signal: Floats) -> float:
    return float(signal.mean()) if len(signal) else 0.0
