"""The setpoints with which an ODrive's position filter follows a motion.

The filter is of second order and critically damped. Its position x follows a setpoint of
position u and velocity w,

    x'' = b^2 (u - x) + 2 b (w - x'),    b the bandwidth,

and u and w are constant for the interval T between two setpoints. The host computes the
filter's state, and sends w = p', the planned speed in the middle of the interval, and the u
for which x + 2T x' has its planned value at the end of the interval: an error left by one
interval falls by a factor exp(-1/2) in the next. What remains is a ripple of the speed within
the interval, b^2 T^2 / 8 of the speed from peak to peak.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from sautereau.robot.drivers.streamed import Rows
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Counts, Segments, motion_at, segment_cubics

INTERVAL = 4  # Controller samples between two setpoints: 256 per second
LEAD = 26  # Intervals for which the arm is held and recorded before a motion


def bandwidth(sample_period: float) -> float:
    """Return the bandwidth [1/s] of the filter, a quarter of the setpoints' rate.

    A higher bandwidth shortens the overrun where the host fails, and lets more of the
    setpoints' steps and jitter into the speed.
    """
    return 1 / (4 * INTERVAL * sample_period)


@dataclass(frozen=True)
class Setpoints(Rows):
    """The setpoints of a motion, one row for each interval."""

    positions: Floats
    """Counts, sent to the filter; shape (n, 2)."""
    velocities: Floats
    """Counts per second, sent to the filter; shape (n, 2)."""
    run_out: Counts
    """Counts, where the joints would come to rest if no setpoint followed; shape (n, 2)."""

    @classmethod
    def of(cls, segments: Segments, sample_period: float) -> Self:
        """Return the setpoints of a motion, and of a rest before it and at its end."""
        last, interval = segments.total_samples, INTERVAL * sample_period
        cubics = segment_cubics(segments, 1.0, sample_period)
        motion = motion_at(segments, cubics, np.arange(last + 1))
        width = bandwidth(sample_period)
        # 20 samples of the end are held and recorded.
        starts = np.arange(-LEAD * INTERVAL, last + 20, INTERVAL)
        middles = np.clip(starts + INTERVAL // 2, 0, last)
        ends = np.clip(starts + INTERVAL, 0, last)
        moving = (middles > 0) & (middles < last)
        velocities = moving[:, None] * motion.velocity[middles]
        aims = motion.position[ends] + 2 * interval * motion.velocity[ends]
        rests = _rests(aims, motion.position[0], width, interval)
        rests[-1] = motion.position[last]
        return cls(
            motion.position[np.clip(starts, 0, last)],
            interval,
            rests - 2 * velocities / width,
            velocities,
            np.rint(rests).astype(np.int64),
        )

    def __len__(self) -> int:
        return len(self.positions)


def _rests(aims: Floats, start: Floats, width: float, interval: float) -> Floats:
    """Return the rest position of the filter for each interval, shape (n, 2).

    u and w act together, as the rest position u + 2 w / b. From
    x and x' before, and with y = x - rest, the filter is after T at

        y(T) = (y (1 + b T) + x' T) exp(-b T),    x'(T) = (x' (1 - b T) - y b^2 T) exp(-b T).

    Args:
        aims: Counts, of x + 2T x' at the ends of the intervals; shape (n, 2).
        start: Counts, position of the filter at first; shape (2,).
        width: 1/s, b.
        interval: s, T.
    """
    turn, fall = width * interval, math.exp(-width * interval)
    of_place = fall * (1 + turn - 2 * turn**2)
    of_speed = fall * interval * (3 - 2 * turn)
    place, speed = start.astype(np.float64), np.zeros(2)
    rests = np.empty_like(aims)
    for row, aim in enumerate(aims):
        rest = (aim - of_place * place - of_speed * speed) / (1 - of_place)
        away = place - rest
        place = rest + (away * (1 + turn) + speed * interval) * fall
        speed = (speed * (1 - turn) - away * width * turn) * fall
        rests[row] = rest
    return rests
