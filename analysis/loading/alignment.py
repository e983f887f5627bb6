"""Find the start of a motion in the samples of an acquisition that no edge has started.

The encoders, on the controller's clock, and the vibrometer, on the acquisition's, show the same
motion: the finger takes the key along from its first contact until it returns. Each reading of the
encoders gives a rise r of the jack, by the arm's geometry, and the vibrometer gives R(t). The start
s minimises the sum of squares of

    r_k - (a R(t_k + s) + b + c t_k)

over the readings. The factor a absorbs errors of calibration and geometry, b a gap between finger
and key, and c the drift of the integrated speed. Force and speed are samples of one clock, so
that this aligns the force as well.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import product
from math import ceil
from typing import Any

import numpy as np
from scipy.optimize import fminbound

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.press import columns_of
from sautereau.daq.signals.calibration import restored
from sautereau.rig.schema import Rig
from sautereau.trajectory.arm import jack_under_finger
from sautereau.trajectory.motion import Floats, Motion

STEP = 1e-3  # s, between the starts tried first
BLOCKS = 10  # Parts of the motion that are omitted in turn to estimate the uncertainty


def find_start(
    rig: Rig,
    volts: Floats,
    first: float,
    rate: float,
    times: Floats,
    joints: Floats,
    latest: float,
) -> tuple[float, float]:
    """Return the start of a motion on the acquisition's clock, and its standard uncertainty.

    The uncertainty has two parts: the jackknife's over blocks of readings, which contains the
    jitter of their times; and the resolution of the encoders, from fits to the same motion as
    encoders that are turned by fractions of a count would read it.

    Args:
        volts: V, of the rig's channels; shape (channels, n).
        first: s, time of the first sample.
        rate: Hz.
        times: s, of the encoders' readings after the motion's start, on the controller's clock;
            shape (k,).
        joints: rad, the readings; shape (k, 2).
        latest: s, largest magnitude of the start.

    Returns:
        Both in s.

    Raises:
        AnalysisError: The rig has no velocity channel, or the samples do not show the motion.
    """
    channel = rig.daq.channel("velocity")
    if channel is None:
        raise AnalysisError("alignment: the rig has no velocity channel")
    early = ceil(max(0.0, -channel.lag * rate))
    speed = restored(volts[rig.daq.channels.index(channel)], channel, rate, early)
    rise = columns_of(rig.key, speed, np.zeros_like(speed), rate)[4]
    clock = first + early / rate + np.arange(len(rise)) / rate
    kept = (times - latest >= clock[0]) & (times + latest <= clock[-1])
    times, joints = times[kept], joints[kept]
    wanted = _rise_of_joints(rig, joints)
    if len(times) < 4 * BLOCKS or np.ptp(wanted) == 0:
        raise AnalysisError(f"alignment: {len(times)} readings of the encoders are too few")
    seen = _Seen(clock, rise)
    starts = np.arange(-latest, latest + STEP, STEP)
    near = float(starts[np.argmin([seen.misfit(times, wanted, start) for start in starts])])
    start = seen.start(times, wanted, near)
    unexplained = np.sqrt(seen.misfit(times, wanted, start)) / np.std(wanted)
    if not unexplained <= 0.1:  # The two do not show the same motion
        raise AnalysisError(
            "alignment: encoders and vibrometer do not show the same motion (residual"
            f" {100 * unexplained:.0f} % of it)"
        )
    blocks = np.array_split(np.arange(len(times)), BLOCKS)
    without = [
        seen.start(np.delete(times, block), np.delete(wanted, block), start) for block in blocks
    ]
    # Readings of encoders that are turned by fractions of a count, of the smooth motion in which
    # the joints are cubic functions of the rise.
    rises, turned, count = seen.rise_at(times + start), [], rig.arm.radians_per_count
    smooth = np.stack([np.polyval(np.polyfit(rises, q, 3), rises) for q in joints.T], -1)
    for turn in product((-0.375, -0.125, 0.125, 0.375), repeat=2):
        phase = np.array(turn) * count
        reading = np.rint((smooth - phase) / count) * count + phase
        turned.append(seen.start(times, _rise_of_joints(rig, reading), start))
    jackknife = (BLOCKS - 1) * np.var(without)
    return start, float(np.sqrt(jackknife + np.var(turned) + (0.5 / rate) ** 2))


@dataclass(frozen=True)
class _Seen:
    """What the vibrometer has seen of the motion."""

    clock: Floats
    """s."""
    rise: Floats
    """m, of the jack."""

    def rise_at(self, time: Floats) -> Floats:
        """Return the jack's rise [m]."""
        return np.interp(time, self.clock, self.rise)

    def misfit(self, times: Floats, wanted: Floats, start: float) -> float:
        """Return the mean square [m^2] of what it does not explain of a rise, for a start [s]."""
        basis = np.stack([self.rise_at(times + start), np.ones_like(times), times], -1)
        found, *_ = np.linalg.lstsq(basis, wanted, rcond=None)
        return float(np.mean((wanted - basis @ found) ** 2))

    def start(self, times: Floats, wanted: Floats, near: float) -> float:
        """Return the best start [s] near one."""
        misfit: Callable[[float], float] = partial(self.misfit, times, wanted)
        found: Any = fminbound(misfit, near - 10 * STEP, near + 10 * STEP, xtol=1e-7)
        return float(found)


def _rise_of_joints(rig: Rig, joints: Floats) -> Floats:
    """Return the jack's rise [m] with the finger on the key, at joint angles (rad, (k, 2))."""
    still = np.zeros_like(joints)
    return jack_under_finger(rig, Motion(joints, still, still)).position
