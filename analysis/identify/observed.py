"""A recorded press as a fit takes it: force and motion smoothed alike, and what is left out.

The acceleration is the slope of a line through the velocity in a window. That is, exactly, the
velocity's derivative seen through a window of parabolic weights; force, angle and spin are seen
through the same window, so that nothing of it is left in their balance.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.phases import Phases
from sautereau.analysis.press.load import Press
from sautereau.rig.schema import Rig
from sautereau.trajectory.key import rise_of_angle
from sautereau.trajectory.motion import Floats, Motion

WINDOW = 2e-3
"""s, of the smoothing."""
STEP = 0.5e-3
"""s, from one instant that is fitted to the next, nearly."""
PARTS = 4
"""Instants in a step at which the string's force, which bends, is taken before smoothing."""
BESIDE_RELEASE = 1.5e-3
"""s, on either side of a release, that is left out: filters spread the fall of the force."""
BESIDE_TURN = 4e-3
"""s, on either side of where the key turns or rests, where friction may take any value."""
SLOW = 0.03
"""1, share of the largest speed below which the key counts as resting."""
BESIDE_DIP = 0.1e-3
"""m, of the pressing point's travel before the front felt that is left out as well."""
CAUGHT = 4.0
"""1, of the planned acceleration of the return, beyond which the finger catches a key that
had fallen away from it: such an impact is shorter than the smoothing."""
BESIDE_STRING = 0.3e-3
"""m, of the jack above the string that is left out with all below on its way down, where
tongue and damper act."""
RISE_STD = 1e-6
"""m, uncertainty of a jack's rise beside that of the moment at which it is read."""
LEAST = 20
"""Instants that a press has at the least."""


@dataclass(frozen=True)
class Observed:
    """What a fit takes of a press; arrays of shape (n,), n instants `step` apart."""

    name: str
    """Of the recording."""
    step: float
    """s."""
    time: Floats
    """s."""
    motion: Motion
    """Of the key [rad], smoothed."""
    used: NDArray[np.bool_]
    """Which instants are fitted."""
    releases: Floats
    """s, measured, in order; shape (plucks,)."""
    release_rises: Floats
    """m, of the first jack then."""
    release_stds: Floats
    """m, their standard uncertainties."""
    release_speeds: Floats
    """m/s, of the first jack then."""
    every_time: Floats
    """s, of `every_force`; shape (m,)."""
    every_force: Floats
    """N, of the finger, smoothed at the recording's own rate."""
    part_time: Floats
    """s, `PARTS` times as dense as `time`, reaching beyond it as far as the smoothing does."""
    part_angle: Floats
    """rad, of the key then, as it was measured."""

    def force(self, lag: float = 0.0) -> Floats:
        """Return the force [N] at the instants, where it is `lag` [s] behind the motion."""
        return np.interp(self.time + lag, self.every_time, self.every_force)

    def smoothed(self, values: Floats) -> Floats:
        """Return what the window makes of values at `part_time`, at the instants."""
        reach = (len(values) - 1 - PARTS * (len(self.time) - 1)) // 2
        weights = 1 - (np.arange(-reach, reach + 1) * self.step / PARTS / (WINDOW / 2)) ** 2
        weights = np.maximum(weights, 0.0)
        smoothed = np.convolve(values, weights / weights.sum(), "valid")[::PARTS]
        return np.asarray(smoothed, float)


def observed(press: Press, phases: Phases, shift: float = 0.0) -> Observed:
    """Return what a fit takes of a press.

    Args:
        press: The recording.
        phases: Its phases.
        shift: s, by which the fit may move force against motion.

    Raises:
        AnalysisError: The key moves for too short a time, or its samples are no numbers.
    """
    data = press.data
    columns = data[["velocity", "force", "angle"]].to_numpy()
    if not np.isfinite(columns).all():
        raise AnalysisError(
            f"press {press.path}: it holds samples that are not finite numbers; leave it out"
        )
    half = max(1, round(WINDOW / 2 * press.rate))
    time = data.index.to_numpy()[half:-half]
    offsets = np.arange(-half, half + 1)
    slope_weights = offsets / (offsets**2).sum()
    # Between two samples the velocity's change counts with the sum of the weights beyond.
    weights = np.cumsum(slope_weights[::-1])[:-1]
    weights = np.convolve(weights, [0.5, 0.5])

    def smooth(values: Floats) -> Floats:
        return np.convolve(values, weights, "valid")

    arm = press.rig.key.laser_arm
    velocity, force, angle = columns.T
    slope = np.correlate(velocity, slope_weights, "valid") * press.rate
    part = max(1, round(STEP / PARTS * press.rate))
    step = part * PARTS / press.rate
    count = (len(time) - 1) // (part * PARTS) + 1
    at = slice(None, None, part * PARTS)
    # In rows of the recording, of which `half` come before the first instant.
    first = half - half // part * part
    rows = first + part * np.arange(PARTS * (count - 1) + 2 * (half // part) + 1)
    motion = Motion(smooth(angle)[at], smooth(velocity)[at] / arm, slope[at] / arm)
    releases = np.array([p.release for p in phases.plucks], float)
    stds = np.array([p.release_std for p in phases.plucks], float)
    rises = np.interp(releases, data.index, data["jack_rise"])
    speeds = np.interp(releases, time, smooth(data["jack_speed"].to_numpy()))
    used = _used(press, phases, time[at], motion, shift)
    if used.sum() < LEAST:
        raise AnalysisError(
            f"press {press.path}: in only {int(used.sum())} instants of {STEP * 1e3:.3g} ms the key"
            f" moves freely, and {LEAST} are needed; leave it out, or look whether the key was"
            " pressed"
        )
    return Observed(
        name=press.path.name,
        step=step,
        time=time[at],
        motion=motion,
        used=used,
        releases=releases,
        release_rises=rises,
        release_stds=np.hypot(stds * speeds, RISE_STD),
        release_speeds=speeds,
        every_time=time,
        every_force=smooth(force),
        part_time=data.index.to_numpy()[rows],
        part_angle=angle[rows],
    )


def _used(
    press: Press, phases: Phases, time: Floats, motion: Motion, shift: float
) -> NDArray[np.bool_]:
    """Return at which instants the model's balance is to hold."""
    rig, speed, step = press.rig, np.abs(motion.velocity), float(time[1] - time[0])
    edge = WINDOW / 2 + shift
    used = (time - time[0] > shift) & (time[-1] - time > shift)
    resting = speed <= SLOW * speed.max(initial=0.0)
    resting |= np.sign(motion.velocity) != np.sign(np.roll(motion.velocity, 1))
    used &= ~_beside(resting, (BESIDE_TURN + shift) / step)
    planned = rig.press.return_acceleration / rig.key.jack_arm
    caught = (motion.velocity < 0) & (np.abs(motion.acceleration) > CAUGHT * planned)
    used &= ~_beside(caught, edge / step)
    for pluck in phases.plucks:
        used &= np.abs(time - pluck.release) > BESIDE_RELEASE + edge
    for mark in press.quality_flags:
        used &= (time < mark.start - edge) | (time > mark.stop + edge)
        if mark.channel == _force_channel(rig) and mark.kind != "drop-out":
            # An AC-coupled force stands at another level after what it could not follow.
            used &= time < mark.start - edge
    used &= rig.key.press_arm * motion.position < rig.key.dip - BESIDE_DIP
    down = motion.velocity < 0
    return used & ~(down & (rise_of_angle(rig.key, motion.position) < _highest_string(rig)))


def _force_channel(rig: Rig) -> str | None:
    """Return the name of the force channel where it is AC-coupled."""
    channel = rig.daq.channel("force")
    return channel.name if channel is not None and channel.high_pass > 0 else None


def _beside(which: NDArray[np.bool_], reach: float) -> NDArray[np.bool_]:
    """Return the instants that are no further than `reach` instants from one of those given."""
    wide = np.ones(2 * max(1, round(reach)) + 1)
    return np.asarray(np.convolve(which, wide, "same") > 0.5)


def _highest_string(rig: Rig) -> float:
    """Return the first jack's rise [m] below which a falling plectrum may meet its string."""
    clearances = [rig.jack.string_clearance]
    clearances += [c.jack.string_clearance * rig.key.jack_arm / c.jack_arm for c in rig.more_choirs]
    return max(clearances) + BESIDE_STRING
