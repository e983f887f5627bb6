"""The three phases of a press: free, string held, string released.

The finger pushes inertia, friction, weight and string. Taking the inertia away, with the
acceleration that the vibrometer tells, leaves a force that is flat while the key is free,
bends upwards at contact and falls at release. Both are found there as change points.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.errors import AnalysisError
from analysis.press import Press
from daq.sensors import white_noise
from rig.schema import Rig
from trajectory.motion import Floats

DERIVATIVE_WINDOW = 1e-3
"""s, over which velocity is differentiated and lines are fitted beside a step."""
HINGE_WINDOW = 7e-3
"""s, on either side of contact, in which the bend is fitted."""
HINGE_SEARCH = 4e-3
"""s, on either side of a first guess, in which contact is looked for."""
HINGE_MARGIN = 1e-3
"""s, of signal that the fit needs on either side of contact."""
STEP_SIGNIFICANCE = 8.0
"""Standard deviations that a fall of force must exceed to be a release."""
LEAST_STEP = 0.02
"""N, below which a fall of force is no release whatever the noise."""
SPIKE = 5
"""Samples of the running median that keeps a spike of two from looking like a fall."""
EDGE = 3
"""Samples on either side of a fall that the sensor's filter may have spread it over."""
FULL_SPEED = 0.95
"""1, share of the median speed above which the jack counts as neither starting nor ending."""


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
    """Find contact and release in a press; a press without a pluck has none.

    Raises:
        AnalysisError: Force or velocity hold samples that are not numbers.
    """
    data = press.data
    for column in ("force", "velocity"):
        bad = int(np.count_nonzero(~np.isfinite(data[column].to_numpy())))
        if bad:
            raise AnalysisError(
                f"press {press.path}: {bad} samples of its {column} are not finite numbers;"
                " look at the recording, and press again"
            )
    time = data.index.to_numpy()
    force, speed, rise = (data[c].to_numpy() for c in ("force", "jack_speed", "jack_rise"))
    begin, end = _stroke(rise)
    if begin is None:
        most = max(0.0, rise.max(initial=0.0)) * 1e3
        warning = (
            f"the key did not go down: the jack rose by {most:.2g} mm at most;"
            " look at the aim and the sign of the vibrometer"
        )
        return Phases(0.0, 0.0, (), 0.0, None, None, (warning,))
    if end - begin < max(16, 4 * DERIVATIVE_WINDOW * press.rate):
        warning = (
            f"the key moved for only {(end - begin) / press.rate * 1e3:.2g} ms of the recording,"
            " too little to find phases in; record for longer"
        )
        mean = float(speed[begin : end + 1].mean())
        return Phases(float(time[begin]), float(time[end]), (), mean, None, None, (warning,))
    cleared = force - _inertial_force(press.rig, data["velocity"].to_numpy(), press.rate)
    noise = white_noise(force)
    released = _largest_fall(force[:end], press.rate, noise, begin)
    warnings = []
    if speed[end] > 0.5 * speed[begin : end + 1].max():
        warnings.append("the recording ends while the key still goes down; record for longer")
    plucks: tuple[HeldString, ...] = ()
    contact = time[end]
    if released is not None:
        held, weak = _held_string(press, time, force, cleared, begin, released)
        plucks, contact = (held,), held.contact
        warnings += weak
    settled = _at_full_speed(time, speed, time[begin], contact)
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


def _at_full_speed(time: Floats, speed: Floats, start: float, end: float) -> NDArray[np.bool_]:
    """Return which samples of the later half between two instants [s] are neither start nor end."""
    inside = (time >= (start + end) / 2) & (time < end)
    if inside.sum() < 8:
        inside = (time >= start) & (time <= end)
    full = inside & (speed >= FULL_SPEED * np.median(speed[inside]))
    return full if full.sum() >= 8 else inside


def _stroke(rise: Floats) -> tuple[int | None, int]:
    """Return where the jack leaves its rest and where it comes to its highest."""
    top = rise.max(initial=0.0)
    if top < 1e-4:
        return None, len(rise) - 1
    begin = int(np.argmax(rise > 0.005 * top))
    return begin, int(np.argmax(rise > 0.995 * top))


def _inertial_force(rig: Rig, velocity: Floats, rate: float) -> Floats:
    """Return the finger's share [N] that accelerates key and jack."""
    from scipy.signal import savgol_filter

    window = max(5, int(DERIVATIVE_WINDOW * rate) | 1)
    slope = np.asarray(savgol_filter(velocity, window, 2, deriv=1, delta=1 / rate))
    spin = slope / rig.key.laser_arm
    inertia = rig.key.inertia + rig.jack.mass * rig.key.jack_arm**2
    return inertia * spin / rig.key.press_arm


def _largest_fall(force: Floats, rate: float, noise: float, begin: int) -> int | None:
    """Return the first sample after the largest sudden fall of force, if one stands out.

    Lines fitted before and after each instant are carried on to it; their gap is a step
    whatever the slope.
    """
    from scipy.ndimage import median_filter

    m = max(4, int(DERIVATIVE_WINDOW * rate))
    # Room for the free phase on one side, for the lines of `_release` on both.
    first, last = begin + 2 * m + EDGE, len(force) - m - EDGE
    if last <= first:
        return None
    force = median_filter(force, SPIKE)
    x = np.arange(m) - (m - 0.5)
    weights = np.linalg.pinv(np.stack([np.ones(m), x], 1))[0]
    before = np.convolve(force, weights[::-1], "valid")
    after = np.convolve(force, weights, "valid")
    fall = before[: len(before) - m] - after[m:]
    best = first + int(np.argmax(fall[first - m : last - m]))
    least = max(LEAST_STEP, STEP_SIGNIFICANCE * noise * np.sqrt(8 / m))
    return best if fall[best - m] > least else None


def _held_string(press, time, force, cleared, begin, released):
    """Return the pluck that ends at a sample, and what is weak about it."""
    rate = press.rate
    margin = int(1.5 * DERIVATIVE_WINDOW * rate)
    release, before, after = _release(time, force, released, rate)
    last = max(released - margin, begin + margin)
    guess = _contact_guess(time, cleared, rate, begin, last)
    contact, std = _contact(time, cleared, rate, begin, last, guess)
    weak = []
    speed = press.data["jack_speed"].to_numpy()[begin:released]
    steady = float(time[begin + np.argmax(speed >= FULL_SPEED * np.median(speed))])
    if contact - steady < 2 * HINGE_MARGIN:
        # It may be anywhere from the beginning: this is the rms distance from there.
        std = max(std, float(contact - time[begin]) / np.sqrt(3))
        weak.append(
            f"contact may lie in the run-up, which ends at {steady * 1e3:.4g} ms and hides it:"
            f" it is uncertain by {std * 1e3:.2g} ms; press more slowly"
        )
    elif std > 0.5e-3:
        weak.append(f"contact is uncertain by {std * 1e3:.2g} ms: the force hardly bends there")
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
    return held, weak


def _contact(
    time: Floats, cleared: Floats, rate: float, begin: int, end: int, guess: float
) -> tuple[float, float]:
    """Return the instant [s] at which the force bends, and its standard uncertainty [s].

    The fit looks a little way to either side of the guess; what it finds at the end of
    that is the next guess.
    """
    reach = int(HINGE_WINDOW * rate)
    contact, std = guess, HINGE_WINDOW
    for _ in range(4):
        middle = int(np.searchsorted(time, guess))
        window = slice(max(begin, middle - reach), min(end, middle + reach))
        contact, std = _hinge(time[window], cleared[window], guess, rate)
        if abs(contact - guess) < 0.9 * HINGE_SEARCH:
            break
        guess = contact
    return contact, std


def _release(time: Floats, force: Floats, near: int, rate: float) -> tuple[float, float, float]:
    """Return the instant [s] of the fall near a sample, and the force [N] on both sides.

    Lines are fitted to both sides; the samples that the sensor's filter spread between
    them are where the fall is half done.
    """
    m = max(4, int(DERIVATIVE_WINDOW * rate))
    left, right = slice(near - EDGE - m, near - EDGE), slice(near + EDGE, near + EDGE + m)
    lines = [np.polyfit(time[s] - time[near], force[s], 1) for s in (left, right)]
    between = slice(near - EDGE, near + EDGE + 1)
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


def _hinge(time: Floats, signal: Floats, guess: float, rate: float) -> tuple[float, float]:
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

    if len(time) < 8:
        return guess, HINGE_WINDOW
    low = max(time[0] + HINGE_MARGIN, guess - HINGE_SEARCH)
    high = min(time[-1] - HINGE_MARGIN, guess + HINGE_SEARCH)
    if high <= low:
        return guess, float(time[-1] - time[0])
    grid = np.linspace(low, high, 41)
    best = grid[int(np.argmin([misfit(instant) for instant in grid]))]
    step = grid[1] - grid[0]
    found: Any = minimize_scalar(
        misfit, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-7}
    )
    instant = float(found.x)
    matrix = columns(instant)
    solution = np.linalg.lstsq(matrix, signal, rcond=None)[0]
    bend = -(solution[2] + 2 * solution[3] * np.maximum(time - instant, 0)) * (time > instant)
    variance = _variance(signal - matrix @ solution, max(1, int(DERIVATIVE_WINDOW * rate)))
    covariance = np.linalg.pinv(np.column_stack([matrix, bend]).T @ np.column_stack([matrix, bend]))
    return instant, float(np.sqrt(variance * covariance[-1, -1]))


def _variance(residual: Floats, width: int) -> float:
    """Return the variance of white noise that would move a fit as much as this noise does.

    The differentiated velocity's noise holds together over ``width`` samples, and its
    sums over blocks of that many show it.
    """
    white = float((residual**2).sum()) / max(len(residual) - 5, 1)
    blocks = len(residual) // width
    if blocks < 8:
        return white
    sums = residual[: blocks * width].reshape(blocks, width).sum(axis=1)
    return max(white, float((sums**2).sum()) / width / (blocks - 5))


def _mean(signal: Floats, time: Floats, start: float, end: float) -> float:
    inside = (time >= start) & (time < end)
    return float(signal[inside].mean()) if inside.any() else float("nan")
