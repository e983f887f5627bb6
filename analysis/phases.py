"""The three phases of a press: free, string held, string released.

The finger pushes inertia, friction, weight and string. Taking the inertia away, with the
acceleration that the vibrometer tells, leaves a force that is flat while the key is free,
bends upwards at contact and falls at release. Both are found there as change points.
"""

from dataclasses import dataclass

import numpy as np

from analysis.press import Press
from rig.schema import Rig
from trajectory.motion import Floats

DERIVATIVE_WINDOW = 1e-3
"""s, over which velocity is differentiated and lines are fitted beside a step."""
HINGE_WINDOW = 7e-3
"""s, on either side of contact, in which the bend is fitted."""
STEP_SIGNIFICANCE = 8.0
"""Standard deviations that a fall of force must exceed to be a release."""
LEAST_STEP = 0.02
"""N, below which a fall of force is no release whatever the noise."""


@dataclass(frozen=True)
class HeldString:
    """One pluck: when the string was met and let go; s from the trigger."""

    contact: float
    release: float
    contact_std: float
    """s, standard uncertainty."""
    release_std: float
    """s, standard uncertainty."""
    contact_force: float
    """N, of the finger at contact."""
    peak_force: float
    """N, of the finger just before release."""
    force_step: float
    """N, by which it falls at release."""
    slope: float
    """N/m, of the finger's force on the key's deflection while the string is held."""

    @property
    def duration(self) -> float:
        """Time the string is held [s]."""
        return self.release - self.contact


@dataclass(frozen=True)
class Phases:
    """What a press went through; times in s from the trigger."""

    start: float
    """s, when a jack always as fast as in the free phase would have left its rest."""
    bottom: float
    """s, when the jack has come to its full rise."""
    plucks: tuple[HeldString, ...]
    free_speed: float
    """m/s, mean of the jack in the free phase, after the run-up."""
    held_speed: float | None
    """m/s, mean of the jack while the string is held; None without a pluck."""
    released_speed: float | None
    """m/s, mean of the jack after release, over as long a time as the string was held."""
    warnings: tuple[str, ...]


def find_phases(press: Press) -> Phases:
    """Find contact and release in a press; a press without a pluck has none."""
    data = press.data
    time = data.index.to_numpy()
    force, speed, rise = (data[c].to_numpy() for c in ("force", "jack_speed", "jack_rise"))
    begin, end = _stroke(rise)
    if begin is None:
        warning = "the key did not move"
        return Phases(0.0, 0.0, (), 0.0, None, None, (warning,))
    cleared = force - _inertial_force(press.rig, data["velocity"].to_numpy(), press.rate)
    noise = _noise(force)
    released = _largest_fall(force[:end], press.rate, noise, begin)
    warnings = []
    plucks: tuple[HeldString, ...] = ()
    contact = time[end]
    if released is not None:
        held, weak = _held_string(press, time, force, cleared, begin, released)
        plucks, contact = (held,), held.contact
        warnings += weak
    settled = (time >= (time[begin] + contact) / 2) & (time < contact)
    if settled.sum() < 8:
        settled = (time >= time[begin]) & (time <= contact)
    slope, offset = np.polyfit(time[settled], rise[settled], 1)
    held_speed = released_speed = None
    if plucks:
        held_speed = _mean(speed, time, plucks[0].contact, plucks[0].release)
        after = min(plucks[0].release + plucks[0].duration, time[end])
        released_speed = _mean(speed, time, plucks[0].release, after)
    return Phases(
        start=float(-offset / slope),
        bottom=float(time[end]),
        plucks=plucks,
        free_speed=float(speed[settled].mean()),
        held_speed=held_speed,
        released_speed=released_speed,
        warnings=tuple(warnings),
    )


def _stroke(rise: Floats) -> tuple[int | None, int]:
    """Return where the jack leaves its rest and where it comes to its highest."""
    top = rise.max()
    if top < 1e-4:
        return None, len(rise) - 1
    begin = int(np.argmax(rise > 0.005 * top))
    return begin, int(np.argmax(rise > 0.995 * top))


def _inertial_force(rig: Rig, velocity: Floats, rate: float) -> Floats:
    """Return the finger's share [N] that accelerates key and jack."""
    from scipy.signal import savgol_filter

    window = max(5, int(DERIVATIVE_WINDOW * rate) | 1)
    spin = savgol_filter(velocity, window, 2, deriv=1, delta=1 / rate) / rig.key.laser_arm
    inertia = rig.key.inertia + rig.jack.mass * rig.key.jack_arm**2
    return inertia * spin / rig.key.press_arm


def _noise(signal: Floats) -> float:
    """Return the standard deviation of a signal's white noise, from its second differences."""
    second = np.diff(signal, 2)
    return float(1.4826 * np.median(np.abs(second - np.median(second))) / np.sqrt(6))


def _largest_fall(force: Floats, rate: float, noise: float, begin: int) -> int | None:
    """Return the first sample after the largest sudden fall of force, if one stands out.

    Lines fitted before and after each instant are carried on to it; their gap is a step
    whatever the slope.
    """
    m = max(4, int(DERIVATIVE_WINDOW * rate))
    if len(force) < 2 * m + begin + 2:
        return None
    x = np.arange(m) - (m - 0.5)
    weights = np.linalg.pinv(np.stack([np.ones(m), x], 1))[0]
    before = np.convolve(force, weights[::-1], "valid")
    after = np.convolve(force, weights, "valid")
    fall = before[: len(before) - m] - after[m:]
    fall[: max(0, begin - m)] = -np.inf
    best = int(np.argmax(fall))
    least = max(LEAST_STEP, STEP_SIGNIFICANCE * noise * np.sqrt(8 / m))
    return best + m if fall[best] > least else None


def _held_string(press, time, force, cleared, begin, released):
    """Return the pluck that ends at a sample, and what is weak about it."""
    rate = press.rate
    margin = int(1.5 * DERIVATIVE_WINDOW * rate)
    release, before, after = _release(time, force, released, rate)
    guess = _contact_guess(time, cleared, rate, begin, released - margin)
    reach = int(HINGE_WINDOW * rate)
    middle = int(np.searchsorted(time, guess))
    window = slice(max(begin, middle - reach), min(released - margin, middle + reach))
    contact, std = _hinge(time[window], cleared[window], guess)
    inside = (time >= contact) & (time < release)
    deflection = press.data["deflection"].to_numpy()
    slope = float(np.polyfit(deflection[inside], force[inside], 1)[0])
    at_contact = int(np.searchsorted(time, contact))
    quiet = slice(max(0, at_contact - margin), max(at_contact, margin))
    held = HeldString(
        contact=contact,
        release=release,
        contact_std=std,
        release_std=float(1 / rate / np.sqrt(12)),
        contact_force=float(force[quiet].mean()),
        peak_force=before,
        force_step=before - after,
        slope=slope,
    )
    weak = []
    if std > 0.5e-3:
        weak.append(f"contact is uncertain by {std * 1e3:.2g} ms: the force hardly bends there")
    return held, weak


def _release(time: Floats, force: Floats, near: int, rate: float) -> tuple[float, float, float]:
    """Return the instant [s] of the fall near a sample, and the force [N] on both sides.

    Lines are fitted to both sides; the samples that the sensor's filter spread between
    them are where the fall is half done.
    """
    m = max(4, int(DERIVATIVE_WINDOW * rate))
    gap = 3
    left, right = slice(near - gap - m, near - gap), slice(near + gap, near + gap + m)
    lines = [np.polyfit(time[s] - time[near], force[s], 1) for s in (left, right)]
    between = slice(near - gap, near + gap + 1)
    tau = time[between] - time[near]
    before, after = (np.polyval(line, tau) for line in lines)
    share = np.clip((force[between] - after) / (before - after), 0, 1)
    # The fall splits this stretch into a part on the first line and a part on the second.
    release = time[between][0] + (share.sum() - 0.5) / rate
    tau = release - time[near]
    return float(release), float(np.polyval(lines[0], tau)), float(np.polyval(lines[1], tau))


def _contact_guess(time: Floats, cleared: Floats, rate: float, begin: int, end: int) -> float:
    """Return where the rising force [N], carried back as a line, meets its level before."""
    width = max(5, int(DERIVATIVE_WINDOW * rate))
    cleared = np.convolve(cleared, np.full(width, 1 / width), "same")
    level = np.median(cleared[begin : begin + max(8, (end - begin) // 4)])
    top = cleared[max(begin, end - 8) : end].mean()
    rising = np.flatnonzero(cleared[begin:end] < level + 0.3 * (top - level))
    first = begin + int(rising[-1]) if len(rising) else begin
    if end - first < 8:
        return float(time[first])
    slope, offset = np.polyfit(time[first:end] - time[first], cleared[first:end], 1)
    return float(np.clip(time[first] + (level - offset) / slope, time[begin], time[end]))


def _hinge(time: Floats, signal: Floats, guess: float) -> tuple[float, float]:
    """Return the instant [s] at which a line starts to bend upwards, and its uncertainty.

    Before it the signal is a line, after it that line and a parabola through it; for each
    instant the rest is linear, and the instant is the one with the least squares.
    """
    from scipy.optimize import minimize_scalar

    def columns(instant: float) -> Floats:
        tau = time - instant
        after = np.maximum(tau, 0.0)
        return np.stack([np.ones_like(tau), tau, after, after**2], 1)

    def misfit(instant: float) -> float:
        matrix = columns(instant)
        solution = np.linalg.lstsq(matrix, signal, rcond=None)[0]
        return float(((signal - matrix @ solution) ** 2).sum())

    low, high = max(time[0] + 1e-3, guess - 4e-3), min(time[-1] - 1e-3, guess + 4e-3)
    if high <= low:
        return guess, float(time[-1] - time[0])
    grid = np.linspace(low, high, 41)
    best = grid[int(np.argmin([misfit(instant) for instant in grid]))]
    step = grid[1] - grid[0]
    found = minimize_scalar(
        misfit, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-7}
    )
    instant = float(found.x)
    matrix = columns(instant)
    solution = np.linalg.lstsq(matrix, signal, rcond=None)[0]
    bend = -(solution[2] + 2 * solution[3] * np.maximum(time - instant, 0)) * (time > instant)
    variance = found.fun / max(len(time) - 5, 1)
    covariance = np.linalg.pinv(np.column_stack([matrix, bend]).T @ np.column_stack([matrix, bend]))
    return instant, float(np.sqrt(variance * covariance[-1, -1]))


def _mean(signal: Floats, time: Floats, start: float, end: float) -> float:
    inside = (time >= start) & (time < end)
    return float(signal[inside].mean()) if inside.any() else float("nan")
