"""A recorded press as input of a fit: force and motion, smoothed alike, and excluded instants.

The acceleration is the slope of a line through the velocity in a window. That equals the derivative
of the velocity smoothed by parabolic weights; force, angle and angular velocity are smoothed by the
same weights, so that the smoothing cancels in the equation of motion.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.noise import BESIDE_TURN, SLOW, WINDOW, Noise, noise_at_rest
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.rig.acquisition import Channel
from sautereau.rig.instrument import Key
from sautereau.rig.schema import Rig
from sautereau.rig.section import GRAVITY
from sautereau.trajectory.key import rise_of_angle
from sautereau.trajectory.motion import Floats, Motion

STEP = 0.5e-3
"""s, approximate time between fitted instants."""
PARTS = 4
"""Instants per step at which the force of the string is evaluated before smoothing."""
BESIDE_RELEASE = 1.5e-3
"""s, excluded on either side of a release, over which filters spread the force drop."""
BESIDE_DIP = 0.1e-3
"""m, path of the pressing point before the front felt that is excluded as well."""
CAUGHT = 4.0
"""Dimensionless, multiple of the planned acceleration of the return above which the finger catches
a key that had lost contact with it: such an impact is shorter than the smoothing."""
BESIDE_STRING = 0.3e-3
"""m, height of the jack above the string below which its way down is excluded, as tongue and damper
act there."""
ARM_LAG = 6e-3
"""s, lag of the deflection of a servo-driven arm behind the force."""
AT_REST = 5e-3
"""s, of the beginning of a recording, in which the finger rests."""
LIFTED = 2.5e-5
"""rad, angle of a key that has left its back rail; at rest, noise moves it by less."""
RISE_STD = 1e-6
"""m, uncertainty of the rise of a jack, without that of the instant of release."""
FREE, HELD, BACK = range(3)
"""Parts of a press: down without a string, with one, and the way back."""
LEAST = 20
"""Fewest fitted instants of a press."""


@dataclass(frozen=True, eq=False)
class Observed:
    """Input of a fit from one press; arrays of shape (n,) at n instants, `step` apart."""

    name: str
    """Of the recording."""
    step: float
    """s."""
    time: Floats
    """s."""
    motion: Motion
    """Smoothed motion of the key [rad]."""
    used: NDArray[np.bool_]
    """Which instants are fitted, shape (n,)."""
    releases: Floats
    """s after the trigger, measured, in order; shape (plucks,)."""
    release_angles: Floats
    """rad, of the key at those releases whose rise is fitted, the first ones; shape (releases,)."""
    release_stds: Floats
    """m, standard uncertainties of the rises of the first jack there; shape (releases,)."""
    release_speeds: Floats
    """m/s, speed of the first jack there; shape (releases,)."""
    every_time: Floats
    """s after the trigger, of `every_force`; shape (m,)."""
    every_force: Floats
    """N, smoothed finger force at the rate of the recording; shape (m,)."""
    late_force: Floats
    """N, `every_force` behind a lag of `ARM_LAG`, at the instants; shape (n,)."""
    part_time: Floats
    """s, `PARTS` times as dense as `time`, extended at both ends by half the smoothing window."""
    part_angle: Floats
    """rad, measured angle of the key at `part_time`."""
    light_time: Floats
    """s after the trigger, of `light_force`; shape (samples,)."""
    light_force: Floats
    """N, finger force smoothed over a part, without that at rest; shape (samples,)."""
    lifted: float
    """s after the trigger, at which the key leaves its back rail, or its jack the last flight."""
    thrown: bool
    """Whether an impact of the finger threw the jack before."""
    part: NDArray[np.int8]
    """Part of the press at the instants: `FREE`, `HELD` or `BACK`; shape (n,)."""
    noise: Noise | None
    """Of the smoothed force and acceleration, while the key is at rest; None without a rest."""

    def force(self, lag: float = 0.0) -> Floats:
        """Return the force [N] at the instants, for a delay `lag` [s] of the force."""
        return np.interp(self.time + lag, self.every_time, self.every_force)

    def part_force(self, lag: float = 0.0) -> Floats:
        """Return the force [N] at `part_time` without that at rest, for a delay [s] of it."""
        return np.interp(self.part_time + lag, self.light_time, self.light_force)

    def until(self, count: int, end: int) -> "Observed":
        """Return the first `count` instants, of which none from `end` on is fitted."""
        parts = len(self.part_time) - PARTS * (len(self.time) - count)
        return replace(
            self,
            time=self.time[:count],
            motion=Motion(*(part[:count] for part in self.motion)),
            used=self.used[:count] & (np.arange(count) < end),
            release_angles=self.release_angles[:1],
            release_stds=self.release_stds[:1],
            release_speeds=self.release_speeds[:1],
            late_force=self.late_force[:count],
            part_time=self.part_time[:parts],
            part_angle=self.part_angle[:parts],
            part=self.part[:count],
        )

    def smoothed(self, values: Floats) -> Floats:
        """Return values at `part_time` after smoothing, at the instants."""
        reach = (len(values) - 1 - PARTS * (len(self.time) - 1)) // 2
        weights = 1 - (np.arange(-reach, reach + 1) * self.step / PARTS / (WINDOW / 2)) ** 2
        weights = np.maximum(weights, 0.0)
        smoothed = np.convolve(values, weights / weights.sum(), "valid")[::PARTS]
        return np.asarray(smoothed, float)


def observed(press: Press, phases: Phases, shift: float = 0.0) -> Observed:
    """Return the input of a fit from a press.

    Args:
        press: The recording.
        phases: Its phases.
        shift: s, largest delay between force and motion in the fit.

    Raises:
        AnalysisError: The key moves for too short a time, or samples are not numbers.
    """
    velocity, force, angle = (press.samples[name] for name in ("velocity", "force", "angle"))
    if not np.isfinite([velocity, force, angle]).all():
        raise AnalysisError(
            f"press {press.path}: some samples are not finite numbers; exclude this recording"
        )
    half = max(1, round(WINDOW / 2 * press.rate))
    time = press.time[half:-half]
    offsets = np.arange(-half, half + 1)
    slope_weights = offsets / (offsets**2).sum()
    # The change of the velocity between two samples has the sum of the later weights.
    weights = np.cumsum(slope_weights[::-1])[:-1]
    weights = np.convolve(weights, [0.5, 0.5])

    def smooth(values: Floats) -> Floats:
        return np.convolve(values, weights, "valid")

    arm = press.rig.key.laser_arm
    slope = np.correlate(velocity, slope_weights, "valid") * press.rate
    part = max(1, round(STEP / PARTS * press.rate))
    step = part * PARTS / press.rate
    count = (len(time) - 1) // (part * PARTS) + 1
    at = slice(None, None, part * PARTS)
    # In rows of the recording, of which `half` come before the first instant.
    first = half - half // part * part
    rows = first + part * np.arange(PARTS * (count - 1) + 2 * (half // part) + 1)
    every, pushed = Motion(smooth(angle), smooth(velocity) / arm, slope / arm), smooth(force)
    motion = Motion(*(values[at] for values in every))
    releases = np.array([p.release for p in phases.plucks], float)
    stds = np.array([p.release_std for p in phases.plucks], float)
    angles = np.interp(releases, press.time, angle)
    speeds = np.interp(releases, time, smooth(press.samples["jack_speed"]))
    used = _used(press, phases, time[at], motion, shift)
    contact = min((p.contact for p in phases.plucks), default=time[0])
    landed = landing(press.rig.key, time[at], motion, contact)
    if landed is not None:
        used &= time[at] > landed + WINDOW / 2 + shift
    if used.sum() < LEAST:
        raise AnalysisError(
            f"press {press.path}: the key moves freely in only {int(used.sum())} steps of"
            f" {STEP * 1e3:.3g} ms, and {LEAST} are needed; exclude this recording, or check"
            " whether the key was pressed"
        )
    return Observed(
        name=press.path.name,
        step=step,
        time=time[at],
        motion=motion,
        used=used,
        releases=releases,
        release_angles=angles,
        release_stds=np.hypot(stds * speeds, RISE_STD),
        release_speeds=speeds,
        every_time=time,
        every_force=pushed,
        late_force=_late(pushed, press.rate)[at],
        part_time=press.time[rows],
        part_angle=angle[rows],
        light_time=press.time,
        light_force=_light(force, part, press.rate),
        lifted=_lifted(press.time, angle) if landed is None else landed,
        thrown=landed is not None,
        part=_part(phases, time[at], motion),
        noise=noise_at_rest(press.rate, time, pushed, every, _clean(press, time, WINDOW / 2)),
    )


def _late(force: Floats, rate: float) -> Floats:
    """Return a force behind a lag of first order."""
    from scipy.signal import lfilter

    kept = np.exp(-1 / (rate * ARM_LAG))
    return force[0] + np.asarray(lfilter([1 - kept], [1, -kept], force - force[0]), float)


def _lifted(time: Floats, angle: Floats) -> float:
    """Return the time at which a key leaves rest, whose acceleration then grows with time."""
    second = int(np.argmax(angle > 8 * LIFTED))
    first = second - int(np.argmax(angle[second::-1] < LIFTED))
    return float(max(time[0], 2 * time[first] - time[second]))


def landing(key: Key, time: Floats, motion: Motion, contact: float) -> float | None:
    """Return when the jack that the finger's impact has thrown lands; None without a flight.

    A key that decelerates faster than its jack falls loses it. Until the jack is back, the key has
    another inertia and other modes.

    Args:
        key: The key.
        time: s, shape (n,).
        motion: Of the key [rad], arrays of shape (n,).
        contact: s, first contact of a string, which ends the search.
    """
    rise, speed = rise_of_angle(key, motion.position), key.jack_arm * motion.velocity
    thrown = (key.jack_arm * motion.acceleration < -GRAVITY) & (time < contact)
    landed = None
    for start in np.flatnonzero(thrown):
        if landed is None or time[start] >= landed:
            flown = time[start:] - time[start]
            flight = rise[start] + speed[start] * flown - GRAVITY / 2 * flown**2
            down = np.flatnonzero(flight[1:] < rise[start + 1 :])
            landed = float(time[start + 1 + down[0]]) if len(down) else landed
    return landed


def _light(force: Floats, width: int, rate: float) -> Floats:
    from scipy.ndimage import uniform_filter1d

    rest = force[: max(1, round(AT_REST * rate))].mean()
    return np.asarray(uniform_filter1d(force - rest, width, mode="nearest"), float)


def _part(phases: Phases, time: Floats, motion: Motion) -> NDArray[np.int8]:
    found = np.where(motion.velocity < 0, BACK, FREE).astype(np.int8)
    for pluck in phases.plucks:
        found[(time > pluck.contact) & (time < pluck.release)] = HELD
    return found


def _used(
    press: Press, phases: Phases, time: Floats, motion: Motion, shift: float
) -> NDArray[np.bool_]:
    """Return the instants at which the equation of motion is fitted."""
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
    used &= _clean(press, time, edge)
    coupled, stretch = coupled_force(rig), np.zeros(len(time), int)
    for mark in press.quality_flags:
        if coupled and mark.channel == coupled.name and mark.kind != "drop-out":
            stretch += time > mark.stop
    used &= rig.key.press_arm * motion.position < rig.key.dip - BESIDE_DIP
    down = motion.velocity < 0
    used &= ~(down & (rise_of_angle(rig.key, motion.position) < _highest_string(rig)))
    # An AC-coupled force has another level after an overload.
    return used & (stretch == np.argmax(np.bincount(stretch, used)))


def _clean(press: Press, time: Floats, edge: float) -> NDArray[np.bool_]:
    """Return which times are farther than `edge` [s] from every drop-out and overload."""
    clean = np.ones(len(time), bool)
    for mark in press.quality_flags:
        clean &= (time < mark.start - edge) | (time > mark.stop + edge)
    return clean


def coupled_force(rig: Rig) -> Channel | None:
    """Return the force channel where it is AC-coupled, so that the force at rest is unknown."""
    channel = rig.daq.channel("force")
    return channel if channel is not None and channel.high_pass > 0 else None


def _beside(which: NDArray[np.bool_], reach: float) -> NDArray[np.bool_]:
    """Return the instants at most `reach` instants away from one of the given instants."""
    wide = np.ones(2 * max(1, round(reach)) + 1)
    return np.asarray(np.convolve(which, wide, "same") > 0.5)


def _highest_string(rig: Rig) -> float:
    """Return the rise [m] of the first jack below which a falling plectrum may touch its string."""
    clearances = [rig.jack.string_clearance]
    clearances += [c.jack.string_clearance * rig.key.jack_arm / c.jack_arm for c in rig.more_choirs]
    return max(clearances) + BESIDE_STRING
