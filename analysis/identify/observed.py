"""A recorded press as input of a fit: force and motion, smoothed alike, and excluded instants.

The acceleration is the slope of a line fitted to the velocity in a window. It equals the derivative
of the velocity smoothed with parabolic weights. Force, angle and angular velocity are smoothed with
the same weights. The smoothing therefore cancels in the equation of motion. Impacts, rests, felts
and gaps, where that does not hold, are excluded.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.parameters import TIME_RANGE
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.rig.acquisition import Channel
from sautereau.rig.instrument import Key
from sautereau.rig.schema import Rig
from sautereau.rig.units import GRAVITY
from sautereau.trajectory.arm import fingertip_place
from sautereau.trajectory.key import rise_of_angle, surface_axes
from sautereau.trajectory.motion import Floats, Motion, dot


def landing(key: Key, time: Floats, motion: Motion, contact: float) -> float | None:
    """Return the time [s] at which a thrown jack lands, or None if the jack is not thrown.

    A key that decelerates faster than a free fall loses its jack. Until the jack is back, the key
    has another inertia and other modes.

    Args:
        time: s, shape (n,).
        motion: Motion of the key [rad], arrays of shape (n,).
        contact: s, first contact with a string; the search ends there.
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


def used_instants(
    press: Press, phases: Phases, time: Floats, motion: Motion, shift: float
) -> NDArray[np.bool_]:
    """Return the instants at which the equation of motion is fitted."""
    rig, speed, step = press.rig, np.abs(motion.velocity), float(time[1] - time[0])
    edge = WINDOW / 2 + shift
    used = (time - time[0] > shift) & (time[-1] - time > shift)
    resting = speed <= REST_SPEED * speed.max(initial=0.0)
    resting |= np.sign(motion.velocity) != np.sign(np.roll(motion.velocity, 1))
    beside = np.ones(2 * max(1, round((TURN_MARGIN + shift) / step)) + 1)
    used &= np.convolve(resting, beside, "same") < 0.5
    # Above this multiple of the planned acceleration the finger catches a key that it had lost, or
    # a key turns without it. What precedes is excluded: the force transducer does not measure the
    # load then.
    fast = 2.5 * rig.press.return_acceleration / rig.key.jack_arm
    clearances = [rig.jack.string_clearance]
    clearances += [c.jack.string_clearance * rig.key.jack_arm / c.jack_arm for c in rig.more_choirs]
    back = motion.velocity < 0
    # Up to 0.3 mm above the string tongue and damper act.
    low = rise_of_angle(rig.key, motion.position) < max(clearances) + 0.3e-3
    caught = back & ~low & (np.abs(motion.acceleration) > fast)
    # It is not known when the finger lost the key.
    used &= ~(back & (low | (time <= np.max(time[caught], initial=-np.inf) + edge)))
    # A key that turns faster than a finger would turn it was thrown, at the latest where its
    # deceleration began.
    top, gentle = int(np.argmax(motion.position)), motion.acceleration > -fast
    thrown = time[:top][gentle[:top]].max(initial=time[0])
    used &= gentle[top] | (time < thrown - edge) | (time > time[top])
    for pluck in phases.plucks:
        # Filters spread the force drop over 1.5 ms.
        used &= np.abs(time - pluck.release) > 1.5e-3 + edge
        if pluck.string is None:  # and its force is not modelled
            used &= (time < pluck.contact - edge) | (time > pluck.release)
    used &= clear_of_flags(press, time, edge)
    coupled, stretch = coupled_force(rig), np.zeros(len(time), int)
    for mark in press.quality_flags:
        if coupled and mark.channel == coupled.name and mark.kind != "drop-out":
            stretch += time > mark.stop
    # Up to 0.1 mm before the front felt.
    used &= rig.key.press_arm * motion.position < rig.key.dip - 0.1e-3
    # An AC-coupled force has another level after an overload.
    return used & (stretch == np.argmax(np.bincount(stretch, used)))


def clear_of_flags(press: Press, time: Floats, edge: float) -> NDArray[np.bool_]:
    """Return which times are more than `edge` [s] away from all drop-outs and overloads."""
    clean = np.ones(len(time), bool)
    for mark in press.quality_flags:
        clean &= (time < mark.start - edge) | (time > mark.stop + edge)
    return clean


def coupled_force(rig: Rig) -> Channel | None:
    """Return the force channel if it is AC-coupled: the force at rest is then unknown."""
    channel = rig.daq.channel("force")
    return channel if channel is not None and channel.high_pass > 0 else None


WINDOW = 2e-3  # Width of the smoothing window (s)
REST_SPEED = 0.03  # Fraction of the largest speed below which the key counts as at rest
TURN_MARGIN = 4e-3  # Excluded beside a reversal or a rest (s): the friction is indeterminate there
MIN_REST = 10e-3  # Shortest rest from which the noise is estimated (s)


@dataclass(frozen=True)
class Noise:
    """RMS of the smoothed signals at rest, after removal of mean and linear trend."""

    slow_force: float
    """N, part slower than the smoothing window, such as mains hum."""
    fast_force: float
    """N, part faster than that."""
    acceleration: float
    """rad/s^2, of the key's angular acceleration."""

    def fast_of_load(self, inertia: float, gain: float = 1.0) -> float:
        """Return the RMS [N] of the force residual that noise causes, without its slow part.

        Args:
            inertia: kg m, inertia of the key with its jacks divided by the finger's lever arm.
            gain: Amplification of the fast force by the elastic modes.
        """
        return float(np.hypot(gain * self.fast_force, inertia * self.acceleration))


def noise_at_rest(
    rate: float, time: Floats, force: Floats, motion: Motion, clean: NDArray[np.bool_]
) -> Noise | None:
    """Return the noise at rest, or None if the recording has no rest.

    Args:
        rate: Hz, sampling rate.
        time: s, shape (n,).
        force: N, smoothed, shape (n,).
        motion: Smoothed motion of the key [rad], arrays of shape (n,).
        clean: Which samples are outside drop-outs and overloads, shape (n,).
    """
    speed = np.abs(motion.velocity)
    moving = time[speed > REST_SPEED * speed.max(initial=0.0)]
    # The rest after the press starts 10 ms after the end of the return.
    rests = (time < moving[0] - TURN_MARGIN, time > moving[-1] + 10e-3)
    found = []
    for rest in rests:
        kept = rest & clean
        if np.count_nonzero(kept) >= MIN_REST * rate:
            every, fast = _scatter(time, force, kept, rate), _fast(force, kept, rate)
            slow = float(np.sqrt(max(0.0, every**2 - fast**2)))
            found.append(Noise(slow, fast, _scatter(time, motion.acceleration, kept, rate)))
    # After a return the arm may still vibrate.
    return min(found, key=lambda noise: np.hypot(noise.slow_force, noise.fast_force), default=None)


def _scatter(time: Floats, signal: Floats, kept: NDArray[np.bool_], rate: float) -> float:
    """Return the RMS of a smoothed signal after removal of its mean and linear trend."""
    at, left = time[kept] - time[kept].mean(), signal[kept] - signal[kept].mean()
    left -= at * (at @ left) / (at @ at)
    # The smoothing leaves about one independent value in half a window.
    return float(np.sqrt(left @ left / (len(left) - WINDOW * rate)))


def _fast(signal: Floats, kept: NDArray[np.bool_], rate: float) -> float:
    """Return the RMS of the part that changes from one smoothing window to the next.

    It is 0 if there are too few samples.
    """
    lag = round(WINDOW * rate)
    change = signal[lag:-lag] - (signal[: -2 * lag] + signal[2 * lag :]) / 2
    change = change[kept[lag:-lag] & kept[: -2 * lag] & kept[2 * lag :]]
    return float(np.sqrt(change @ change / max(1, len(change)) / 1.5))


STEP = 0.5e-3  # Approximate time between fitted instants (s)
SUBSTEPS = 4  # Evaluations of the string's force per step, before smoothing
ARM_LAG = 6e-3  # Time constant with which a servo-driven arm deflects under the force (s)
LIFT_OFF_ANGLE = 2.5e-5  # From which the key counts as lifted off its rail (rad), above the noise
FREE = 0  # Phase of a press: the key moves down and no string is held
HELD = 1  # Phase of a press: a string is held
BACK = 2  # Phase of a press: the key moves up
MIN_INSTANTS = 20  # Smallest number of fitted instants of a press


@dataclass(frozen=True, eq=False)
class Observed:
    """Input of a fit from one press; most arrays have shape (n,), for n instants `step` apart."""

    name: str
    """Name of the recording."""
    step: float
    """Time between two instants (s)."""
    time: Floats
    """s after the trigger."""
    motion: Motion
    """Smoothed motion of the key [rad]."""
    used: NDArray[np.bool_]
    """Which instants are fitted, shape (n,)."""
    releases: Floats
    """Times of release of known strings (s after the trigger), increasing; shape (plucks,)."""
    strings: NDArray[np.intp]
    """Their strings, by number from 0, shape (plucks,)."""
    unknown: int
    """Number of plucks of unknown strings."""
    release_angles: Floats
    """rad, key angle at the first releases, those whose rise is fitted; shape (releases,)."""
    release_stds: Floats
    """m, standard uncertainties of the first jack's rise there; shape (releases,)."""
    release_speeds: Floats
    """m/s, speed of the first jack there; shape (releases,)."""
    release_std: float
    """s, standard uncertainty of the only release; 0 if there are others, or if set by hand."""
    smooth_time: Floats
    """s after the trigger, times of `smooth_force`; shape (m,)."""
    smooth_force: Floats
    """N, smoothed finger force at the sampling rate; shape (m,)."""
    lagged_force: Floats
    """N, `smooth_force` after a first-order lag of `ARM_LAG`; shape (n,)."""
    slide: Floats
    """m, by which the captured joints say that the finger has slid along the key towards the pin
    since the motion started; 0 where the joints were not captured; shape (n,)."""
    substep_time: Floats
    """s, `SUBSTEPS` values per step; starts before `time` and ends after it by half a smoothing
    window."""
    substep_angle: Floats
    """rad, measured angle of the key at `substep_time`."""
    net_time: Floats
    """s after the trigger, times of `net_force`; shape (samples,)."""
    net_force: Floats
    """N, finger force averaged over a substep, minus its value at rest; shape (samples,)."""
    laser_arm: float
    """m, of the rig with which the angles were measured."""
    lift_off: float
    """s after the trigger, at which the key leaves its back rail, or at which a thrown jack has
    landed."""
    thrown: bool
    """Whether an impact of the finger threw the jack."""
    phase: NDArray[np.int8]
    """Phase of the press: `FREE`, `HELD` or `BACK`; shape (n,)."""
    noise: Noise | None
    """Noise while the key is at rest; None if the recording has no rest."""

    def force(self, lag: float = 0.0) -> Floats:
        """Return the force [N] at the fitted instants if it is delayed by `lag` [s]."""
        return np.interp(self.time[self.used] + lag, self.smooth_time, self.smooth_force)

    def until(self, end: int) -> "Observed":
        """Return the press of which instants from number `end` on are not fitted."""
        return replace(
            self,
            used=self.used & (np.arange(len(self.used)) < end),
            release_angles=self.release_angles[:1],
            release_stds=self.release_stds[:1],
            release_speeds=self.release_speeds[:1],
        )


class Stacked:
    """Presses as rows of arrays, in which a shorter one repeats its last value; it is not fitted.

    `substep_time`, `substep_angle` and `used` are those of `Observed`, shape (presses, n), up to
    the last fitted instant and modelled release; `lift_off` has the shape (presses, 1).
    """

    def __init__(self, presses: Sequence[Observed]):
        self.presses, self.step = tuple(presses), presses[0].step / SUBSTEPS
        time, used = _rows([p.substep_time for p in presses]), _rows([p.used for p in presses])
        self._window = time.shape[1] - SUBSTEPS * (used.shape[1] - 1)
        self.used = used[:, : np.flatnonzero(used.any(axis=0))[-1] + 1]
        end = self._window + SUBSTEPS * (self.used.shape[1] - 1)
        for press, own in zip(presses, time, strict=True):
            releases = press.releases[: len(press.release_angles)] + TIME_RANGE
            end = max([end, *(np.searchsorted(own, releases) + 1)])
        self.substep_time = time[:, :end]
        self.substep_angle = _rows([p.substep_angle for p in presses])[:, :end]
        self.lift_off = np.array([[p.lift_off] for p in presses])

    def substep_force(self, lag: float) -> Floats:
        """Return the net force [N] at `substep_time` if it is delayed by `lag` [s]."""
        pairs = zip(self.presses, self.substep_time + lag, strict=True)
        return np.stack([np.interp(time, p.net_time, p.net_force) for p, time in pairs])

    def smoothed(self, values: Floats) -> Floats:
        """Return values at `substep_time`, smoothed, at all fitted instants.

        Args:
            values: Shape (..., presses, n); those after the last ones are 0.

        Returns:
            Shape (..., instants).
        """
        reach, last = self._window // 2, SUBSTEPS * (self.used.shape[1] - 1)
        window = np.arange(-reach, reach + 1) * self.step / (WINDOW / 2)
        weights = np.maximum(1 - window**2, 0.0)
        every = np.zeros((*values.shape[:-1], max(last + self._window, values.shape[-1])))
        every[..., : values.shape[-1]] = values
        every = np.lib.stride_tricks.sliding_window_view(every, len(weights), axis=-1)
        found = every[..., : last + 1 : SUBSTEPS, :] @ (weights / weights.sum())
        return found[..., self.used]


def _rows(arrays: Sequence[NDArray[Any]]) -> NDArray[Any]:
    longest = max(map(len, arrays))
    return np.stack([np.pad(a, (0, longest - len(a)), mode="edge") for a in arrays])


def observed(press: Press, phases: Phases, shift: float = 0.0) -> Observed:
    """Return the input of a fit from a press.

    Args:
        shift: s, largest delay between force and motion that the fit may assume.

    Raises:
        AnalysisError: The key moves for too short a time, or samples are not numbers.
    """
    from scipy.ndimage import uniform_filter1d

    velocity, force, angle = (press.samples[name] for name in ("velocity", "force", "angle"))
    if not np.isfinite([velocity, force, angle]).all():
        raise AnalysisError(
            f"press {press.path}: some samples are not finite numbers; check the recording"
        )
    half = max(1, round(WINDOW / 2 * press.rate))
    time = press.time[half:-half]
    offsets = np.arange(-half, half + 1)
    slope_weights = offsets / (offsets**2).sum()
    # A change of velocity between two samples is weighted by the sum of all later weights.
    weights = np.cumsum(slope_weights[::-1])[:-1]
    weights = np.convolve(weights, [0.5, 0.5])

    def smooth(values: Floats) -> Floats:
        return np.convolve(values, weights, "valid")

    arm = press.rig.key.laser_arm
    slope = np.asarray(np.correlate(velocity, slope_weights, "valid"), float) * press.rate
    part = max(1, round(STEP / SUBSTEPS * press.rate))
    step = part * SUBSTEPS / press.rate
    count = (len(time) - 1) // (part * SUBSTEPS) + 1
    at = slice(None, None, part * SUBSTEPS)
    # Row numbers of the recording; the first instant is at row `half`.
    first = half - half // part * part
    rows = first + part * np.arange(SUBSTEPS * (count - 1) + 2 * (half // part) + 1)
    every, pushed = Motion(smooth(angle), smooth(velocity) / arm, slope / arm), smooth(force)
    motion = Motion(*(values[at] for values in every))
    # In the first 5 ms of a recording the finger is at rest.
    rest = force[: max(1, round(5e-3 * press.rate))].mean()
    known = [p for p in phases.plucks if p.string]
    by_hand = phases.fit is not None and phases.fit.model == "by hand"
    releases = np.array([p.release for p in known], float)
    stds = np.array([p.release_std for p in known], float)
    angles = np.interp(releases, press.time, angle)
    speeds = np.interp(releases, time, smooth(press.samples["jack_speed"]))
    phase = np.where(motion.velocity < 0, BACK, FREE).astype(np.int8)
    for pluck in phases.plucks:
        phase[(time[at] > pluck.contact) & (time[at] < pluck.release)] = HELD
    used = used_instants(press, phases, time[at], motion, shift)
    contact = min((p.contact for p in phases.plucks), default=time[0])
    landed = landing(press.rig.key, time[at], motion, contact)
    if landed is not None:
        used &= time[at] > landed + WINDOW / 2 + shift
    if fault := too_short(str(press.path), used):
        raise AnalysisError(f"{fault}; check whether the key was pressed")
    return Observed(
        name=press.path.name,
        step=step,
        time=time[at],
        motion=motion,
        used=used,
        releases=releases,
        strings=np.array([p.string for p in known], np.intp) - 1,
        unknown=len(phases.plucks) - len(known),
        release_angles=angles,
        # 1 um of the rise, without that of the time of release.
        release_stds=np.hypot(stds * speeds, 1e-6),
        release_speeds=speeds,
        release_std=0.0 if by_hand or len(phases.plucks) != 1 else float(stds.sum()),
        smooth_time=time,
        smooth_force=pushed,
        lagged_force=_lagged(pushed, press.rate)[at],
        slide=_slide(press, time[at], motion.position),
        substep_time=press.time[rows],
        substep_angle=angle[rows],
        net_time=press.time,
        net_force=uniform_filter1d(force - rest, part, mode="nearest"),
        laser_arm=arm,
        lift_off=_lift_off(press.time, angle) if landed is None else landed,
        thrown=landed is not None,
        phase=phase,
        noise=noise_at_rest(
            press.rate, time, pushed, every, clear_of_flags(press, time, WINDOW / 2)
        ),
    )


def too_short(name: str, used: NDArray[np.bool_], when: str = "") -> str:
    """Return why a press with these fitted instants is not usable; empty if it is."""
    count = int(used.sum())
    if count >= MIN_INSTANTS:
        return ""
    return (
        f"press {name}: the key moves freely in only {count} steps of {STEP * 1e3:.3g} ms{when},"
        f" and {MIN_INSTANTS} are needed"
    )


def _lagged(force: Floats, rate: float) -> Floats:
    """Return a force [N] after a first-order lag of `ARM_LAG`."""
    from scipy.signal import lfilter

    kept = np.exp(-1 / (rate * ARM_LAG))
    return force[0] + np.asarray(lfilter([1 - kept], [1, -kept], force - force[0]), float)


def _slide(press: Press, time: Floats, angle: Floats) -> Floats:
    """Return `Observed.slide`: the change of the fingertip's place along the key's tangent."""
    joints = press.joints
    if joints is None:
        return np.zeros(len(time))
    at = np.append(joints.t[0], time)
    angles = np.stack([np.interp(at, joints.t, q) for q in (joints.q1, joints.q2)], axis=-1)
    tangent, _ = surface_axes(np.append(angle[0], angle))
    along = dot(fingertip_place(press.rig.arm, angles), tangent)
    return along[1:] - along[0]


def _lift_off(time: Floats, angle: Floats) -> float:
    """Return the time [s] at which a key leaves rest.

    The angle is extrapolated to 0 as a cubic of time: the acceleration increases linearly.
    """
    second = int(np.argmax(angle > 8 * LIFT_OFF_ANGLE))
    first = second - int(np.argmax(angle[second::-1] < LIFT_OFF_ANGLE))
    return float(max(time[0], 2 * time[first] - time[second]))
