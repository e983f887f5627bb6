"""A motion as the setpoints by which an ODrive's position filter follows it.

The filter, critically damped and of second order, follows what it is told:

    x'' = b^2 (u - x) + 2 b (w - x'),    b the bandwidth,

and u and w stay as they are between two setpoints, for an interval T. The host knows it and
computes along where it is. It sends w = p', the plan's speed in the middle, and the u for
which x + 2T x' is at the end of the interval what the plan wants: an error left by one
interval falls by a factor exp(-1/2) in the next. What remains is a ripple of the speed
within the interval, b^2 T^2 / 8 of it from top to bottom.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from sautereau.trajectory.cubic import controller_motion
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Counts, Segments

INTERVAL = 4
"""Controller samples between two setpoints: 256 a second."""
_SETTLE = 20
"""Controller samples for which the end of a motion is held and recorded."""


def bandwidth(sample_period: float) -> float:
    """Return the bandwidth [1/s] of the filter, a quarter of the setpoints' rate.

    The higher it is, the less a motion runs out where the host fails, and the more the
    setpoints and their jitter show in the speed.
    """
    return 1 / (4 * INTERVAL * sample_period)


@dataclass(frozen=True)
class Setpoints:
    """What is sent for a motion, one row for each interval."""

    positions: Floats
    """Counts, told to the filter; shape (n, 2)."""
    velocities: Floats
    """Counts a second, told to the filter; shape (n, 2)."""
    planned: Floats
    """Counts, where the joints should be when the interval begins; shape (n, 2)."""
    interval: float
    """s, between two setpoints."""
    run_out: Counts
    """Counts, where the joints would come to rest if no setpoint followed; shape (n, 2)."""

    @classmethod
    def of(cls, segments: Segments, sample_period: float) -> Self:
        """Return the setpoints of a motion, and of a rest at its end."""
        _, motion = controller_motion(segments, 1, 1.0, sample_period)
        last, interval = segments.total_samples, INTERVAL * sample_period
        width = bandwidth(sample_period)
        begins = np.arange(0, last + _SETTLE, INTERVAL)
        middles = np.minimum(begins + INTERVAL // 2, last)
        ends = np.minimum(begins + INTERVAL, last)
        velocities = (middles < last)[:, None] * motion.velocity[middles]
        wanted = motion.position[ends] + 2 * interval * motion.velocity[ends]
        rests = _rests(wanted, motion.position[0], width, interval)
        rests[-1] = motion.position[last]
        return cls(
            rests - 2 * velocities / width,
            velocities,
            motion.position[np.minimum(begins, last)],
            interval,
            np.rint(rests).astype(np.int64),
        )

    def __len__(self) -> int:
        return len(self.positions)


def _rests(wanted: Floats, start: Floats, width: float, interval: float) -> Floats:
    """Return where the filter must be led to, interval by interval, shape (n, 2).

    u and w act together, as the place u + 2 w / b where the filter would come to rest. From
    x and x' before, and with y = x - rest, the filter is after T at

        y(T) = (y (1 + b T) + x' T) exp(-b T),    x'(T) = (x' (1 - b T) - y b^2 T) exp(-b T).

    Args:
        wanted: Counts, of x + 2T x' at the ends; shape (n, 2).
        start: Counts, where the filter stands at first; shape (2,).
        width: 1/s, b.
        interval: s, T.
    """
    turn, fall = width * interval, math.exp(-width * interval)
    of_place = fall * (1 + turn - 2 * turn**2)
    of_speed = fall * interval * (3 - 2 * turn)
    place, speed = start.astype(np.float64), np.zeros(2)
    rests = np.empty_like(wanted)
    for row, aim in enumerate(wanted):
        rest = (aim - of_place * place - of_speed * speed) / (1 - of_place)
        away = place - rest
        place = rest + (away * (1 + turn) + speed * interval) * fall
        speed = (speed * (1 - turn) - away * width * turn) * fall
        rests[row] = rest
    return rests
