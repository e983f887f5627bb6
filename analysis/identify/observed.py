"""A recorded press as input of a fit: force and motion, smoothed alike, and excluded instants.

The acceleration is the slope of a line fitted to the velocity in a window. It equals the derivative
of the velocity smoothed with parabolic weights. Force, angle and angular velocity are smoothed with
the same weights. The smoothing therefore cancels in the equation of motion.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.excluded import clear_of_flags, landing, used_instants
from sautereau.analysis.identify.noise import WINDOW, Noise, noise_at_rest
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.trajectory.arm import fingertip_place
from sautereau.trajectory.key import surface_axes
from sautereau.trajectory.motion import Floats, Motion, dot

STEP = 0.5e-3  # Approximate time between fitted instants (s)
SUBSTEPS = 4  # Evaluations of the string's force per step, before smoothing
ARM_LAG = 6e-3  # Time constant with which a servo-driven arm deflects under the force (s)
REST_TIME = 5e-3  # Time at the start of a recording in which the finger is at rest (s)
LIFT_OFF_ANGLE = 2.5e-5
"""Key angle from which the key counts as lifted off its back rail (rad). Noise is smaller."""
RISE_STD = 1e-6
"""Standard uncertainty of the jack's rise at release (m), without that of the time of release."""
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
        """Return the force [N] at the instants if the force is delayed by `lag` [s]."""
        return np.interp(self.time + lag, self.smooth_time, self.smooth_force)

    def substep_force(self, lag: float = 0.0) -> Floats:
        """Return the net force [N] at `substep_time` if the force is delayed by `lag` [s]."""
        return np.interp(self.substep_time + lag, self.net_time, self.net_force)

    def until(self, count: int, end: int) -> "Observed":
        """Return at most the first `count` instants; those from number `end` on are not fitted."""
        count = min(count, len(self.time))
        parts = len(self.substep_time) - SUBSTEPS * (len(self.time) - count)
        return replace(
            self,
            time=self.time[:count],
            motion=Motion(*(part[:count] for part in self.motion)),
            used=self.used[:count] & (np.arange(count) < end),
            release_angles=self.release_angles[:1],
            release_stds=self.release_stds[:1],
            release_speeds=self.release_speeds[:1],
            lagged_force=self.lagged_force[:count],
            slide=self.slide[:count],
            substep_time=self.substep_time[:parts],
            substep_angle=self.substep_angle[:parts],
            phase=self.phase[:count],
        )

    def smoothed(self, rows: Floats) -> Floats:
        """Return rows of values given at `substep_time`, smoothed, at the instants."""
        reach = (rows.shape[1] - 1 - SUBSTEPS * (len(self.time) - 1)) // 2
        weights = 1 - (np.arange(-reach, reach + 1) * self.step / SUBSTEPS / (WINDOW / 2)) ** 2
        weights = np.maximum(weights, 0.0)
        smoothed = [np.convolve(row, weights / weights.sum(), "valid")[::SUBSTEPS] for row in rows]
        return np.stack(smoothed)


def observed(press: Press, phases: Phases, shift: float = 0.0) -> Observed:
    """Return the input of a fit from a press.

    Args:
        shift: s, largest delay between force and motion that the fit may assume.

    Raises:
        AnalysisError: The key moves for too short a time, or samples are not numbers.
    """
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
    known = [p for p in phases.plucks if p.string]
    releases = np.array([p.release for p in known], float)
    stds = np.array([p.release_std for p in known], float)
    angles = np.interp(releases, press.time, angle)
    speeds = np.interp(releases, time, smooth(press.samples["jack_speed"]))
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
        release_stds=np.hypot(stds * speeds, RISE_STD),
        release_speeds=speeds,
        smooth_time=time,
        smooth_force=pushed,
        lagged_force=_lagged(pushed, press.rate)[at],
        slide=_slide(press, time[at], motion.position),
        substep_time=press.time[rows],
        substep_angle=angle[rows],
        net_time=press.time,
        net_force=_net(force, part, press.rate),
        laser_arm=arm,
        lift_off=_lift_off(press.time, angle) if landed is None else landed,
        thrown=landed is not None,
        phase=_phase(phases, time[at], motion),
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


def _net(force: Floats, width: int, rate: float) -> Floats:
    from scipy.ndimage import uniform_filter1d

    rest = force[: max(1, round(REST_TIME * rate))].mean()
    return np.asarray(uniform_filter1d(force - rest, width, mode="nearest"), float)


def _phase(phases: Phases, time: Floats, motion: Motion) -> NDArray[np.int8]:
    found = np.where(motion.velocity < 0, BACK, FREE).astype(np.int8)
    for pluck in phases.plucks:
        found[(time > pluck.contact) & (time < pluck.release)] = HELD
    return found
