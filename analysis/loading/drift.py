"""Remove offset and drift from a velocity and from an AC-coupled force.

Before a press the key is at rest, and afterwards again, at the same place or where the finger
holds it. At rest the velocity of the vibrometer is zero; any other value is an offset. Inverting
the AC coupling turns an offset o into o (1 + w t), and the coupling's memory of earlier motion into
a constant, so that a straight line a + b t describes both.
"""

import math
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.remark import Remark
from sautereau.daq.signals.calibration import MAD_TO_STD, median, white_noise
from sautereau.trajectory.motion import Floats

BLOCK = 1e-3  # s, of the block means by which rest and motion are distinguished
LEAST_REST = 5e-3  # s, shortest rest
AT_START = 0.0, 5e-6  # m, the place of a key that returns, and its standard deviation
RETURNED = 0.05
"""Dimensionless, fraction of the largest deflection within which the key has returned."""
HIGH, LOW = 0.6, 0.35
"""Dimensionless, fractions of the largest deflection: a key that was above the first, below the
second and again above the first was pressed more than once."""
CONSISTENT = 4.0  # Standard deviations within which the two rests and the return must agree


@dataclass(frozen=True)
class Drift:
    """The corrections subtracted from the signals of a press, and the rests they rest on."""

    before: tuple[float, float] | None
    """s, the rest before the press; None where there is none."""
    after: tuple[float, float] | None
    """s, the rest after it."""
    velocity: float = 0.0
    """m/s, largest correction of the velocity."""
    deflection: float = 0.0
    """m, largest resulting correction of the deflection."""
    closure: float | None = None
    """m, remaining deflection in the rest after the press; None where the key does not return."""
    force: float = 0.0
    """N, correction of the measured force, so that it is zero in the rest before the press."""


NO_DRIFT = Drift(None, None)  # No correction


@dataclass(frozen=True)
class Rests:
    """Rows of the rests before and after a press; empty slices where there is none."""

    before: slice
    after: slice


def find_rests(velocity: Floats, rate: float) -> Rests:
    """Find the rests at both ends of a recording, from the velocity alone.

    A rest is a steady velocity near zero that lasts for `LEAST_REST` or longer and ends in motion.

    Args:
        velocity: m/s, shape (n,), AC coupling inverted.
        rate: Hz.
    """
    size = max(1, round(BLOCK * rate))
    n_blocks = len(velocity) // size
    nothing = Rests(slice(0, 0), slice(len(velocity), len(velocity)))
    if n_blocks < 3 * LEAST_REST / BLOCK:
        return nothing
    weights = np.full(size, 1 / size)
    forwards = velocity[: n_blocks * size].reshape(-1, size) @ weights
    backwards = (velocity[len(velocity) - n_blocks * size :].reshape(-1, size) @ weights)[::-1]
    fastest = float(np.abs(forwards).max())
    # From 0.3 % of the largest speed on, the key moves.
    least = max(3e-3 * fastest, 6 * white_noise(velocity) / math.sqrt(size))
    ends = forwards, backwards
    levels = [median(means[: int(LEAST_REST / BLOCK)]) for means in ends]
    common = abs(levels[0] - levels[1]) <= least
    # An offset, where both ends have the same speed.
    common = common and max(map(abs, levels)) <= 0.2 * fastest
    lengths = [
        _steady(means, level, least, fastest) * size
        if common or abs(level) <= 0.02 * fastest  # A larger steady speed is motion, not offset
        else 0
        for means, level in zip(ends, levels, strict=True)
    ]
    if sum(lengths) >= len(velocity):  # it did not move
        return nothing
    first, last = (n if n >= LEAST_REST * rate else 0 for n in lengths)
    return Rests(slice(0, first), slice(len(velocity) - last, len(velocity)))


def departure(force: Floats, rate: float) -> int:
    """Return the sample at which a force leaves its level at the start; 0 without a rest.

    Args:
        force: N, shape (n,).
        rate: Hz.
    """
    size = max(1, round(BLOCK / 2 * rate))
    means = block_means(force, size)
    if not len(means):
        return 0
    level = median(means[: round(2 * LEAST_REST / BLOCK)])
    away = np.abs(means - level)
    # From 2 % of the largest change on, the force is not at rest.
    moving = away > max(0.02 * float(away.max()), 6 * white_noise(force) / math.sqrt(size))
    first = int(np.argmax(moving)) * size
    return first if first >= LEAST_REST * rate else 0


def without_drift(
    velocity: Floats,
    rests: Rests,
    rate: float,
    start: float,
    corner: float,
    place: tuple[float, float] | None,
    tolerance: float = 0.0,
) -> tuple[Floats, Drift, list[Remark]]:
    """Subtract the drift of a velocity, so that its integral drifts by micrometres only.

    If the two rests and the place after the press agree on a straight line, it is subtracted. If
    not, the velocity at rest was no offset of the sensor, and only the constant is subtracted
    that brings the key back. Without a return, the line follows from the rests alone.

    Args:
        velocity: m/s, shape (n,), AC coupling inverted.
        rate: Hz.
        start: s after the trigger, of the first row.
        corner: Hz, of the AC coupling; 0 for none.
        place: m at the laser, where the key rests after the press, from its rest before, and the
            standard uncertainty; None if the planned motion does not end where it starts.
        tolerance: Dimensionless, fraction of the largest deflection up to which a doubtful
            correction is no warning.

    Returns:
        The corrected velocity, the corrections, and what is to be said about them.
    """
    n = len(velocity)
    before = _span(rests.before, rate, start)
    after = _span(rests.after, rate, start)
    omega = 2 * math.pi * corner
    if before is None:
        text = (
            "no rest before the press: offset and drift of the sensors remain in the signals;"
            " start recording before the motion"
        )
        return velocity, Drift(None, after), [Remark(text)]
    level, std = _level(velocity[rests.before])
    middle = _middle(rests.before, rate)
    if after is None:
        first = level / (1 + omega * middle)
        line = first, first * omega
        taken = _taken(line, n, rate)
        corrected = without_line(velocity, line, rate)
        deflection = np.cumsum(corrected) / rate
        largest, above = float(np.abs(deflection).max()), max(0.0, -float(deflection.min()))
        # The rail stops the key: what is above its rest is an error, wherever it started.
        wrong = max(taken[1], above) > tolerance * largest
        text = (
            f"no rest after the press: the mean velocity at rest, {abs(level) * 1e6:.3g} µm/s, is"
            f" subtracted as an offset without a check at the end, {taken[1] * 1e3:.2g} mm of"
            f" {largest * 1e3:.2g} mm of deflection; record for longer"
        )
        if above > tolerance * largest:
            text += (
                f", and check the sensor's corner frequency: the key seems to rise by"
                f" {above * 1e3:.2g} mm above its rest, where the rail stops a rigid key"
            )
        return corrected, Drift(before, None, *taken), [Remark(text, doubt=wrong)]
    late, late_std = _level(velocity[rests.after])
    middles = middle, _middle(rests.after, rate)
    between = slice(*(int(t * rate) for t in middles))
    moved = velocity[between]
    size = max(1, round(BLOCK * rate))
    whole = len(moved) // size * size
    blocks = moved[:whole].reshape(-1, size) @ np.ones(size)
    deflection = np.cumsum(np.append(blocks, moved[whole:].sum()))
    end = float(deflection[-1] - (moved[0] + moved[-1]) / 2) / rate  # by trapezia
    largest = max(float(deflection.max()), -float(deflection.min())) / rate
    duration = middles[1] - middles[0]
    rows = [[1.0, middles[0]], [1.0, middles[1]]]
    seen, stds = [level, late], [std, late_std]
    gone = end - duration * (level + late) / 2  # Without the line through the rests
    back = place is not None and min(abs(end), abs(gone)) <= RETURNED * largest
    said = []
    if place and back:
        rows.append([duration, (middles[1] ** 2 - middles[0] ** 2) / 2])
        seen, stds = [*seen, end - place[0]], [*stds, place[1]]
        # A key that the finger holds still moves with it, by about this way within the rest.
        stds[1] = math.hypot(stds[1], place[0] / (after[1] - after[0]))
    elif place:
        text = (
            f"the key did not return: {gone * 1e3:.3g} mm of {largest * 1e3:.3g} mm at the laser"
            " remain; check whether the jack hangs, and the sensor's corner frequency"
        )
        said.append(Remark(text))
    matrix, values = np.array(rows), np.array(seen)
    weights = 1 / np.array(stds)
    fitted = np.linalg.lstsq(matrix * weights[:, None], values * weights, rcond=None)[0]
    line = float(fitted[0]), float(fitted[1])
    if np.abs((matrix @ fitted - values) * weights).max() > CONSISTENT:
        line = (end - (place[0] if place else 0.0)) / duration, 0.0
        text = (
            f"the velocity at rest is {level * 1e6:.3g} and {late * 1e6:.3g} µm/s, but the"
            f" deflection of {largest * 1e3:.3g} mm returns to {end * 1e3:.3g} mm: no offset of the"
            " sensor explains both; check its corner frequency, its delay, and whether the key is"
            " really at rest"
        )
        said.append(Remark(text, doubt=abs(end) > tolerance * largest))
    closure = None
    if back:
        rows = between.stop - between.start
        closure = end - (line[0] + line[1] * _middle(between, rate)) * rows / rate
    found = Drift(before, after, *_taken(line, n, rate), closure)
    return without_line(velocity, line, rate), found, said


def force_at_rest(
    measured: Floats, noise: float, rate: float, corner: float, *, after_press: bool = False
) -> tuple[float, bool]:
    """Return the level of an AC-coupled force at rest, and whether it is an offset.

    An offset is constant; the rest of an earlier force decays at the rate w. The slope decides;
    where it is not significant, the level counts as an offset, unless there was an earlier press.

    Args:
        measured: N, shape (n,), in the rest before the press, coupling not inverted.
        noise: N, its white noise.
        rate: Hz.
        corner: Hz, of the coupling.
        after_press: Whether an earlier press ended shortly before.
    """
    n, level = len(measured), float(measured.mean())
    time = (np.arange(n) - (n - 1) / 2) / rate
    slope = float(time @ measured / (time @ time))
    std = noise * math.sqrt(12 / n) / (n - 1) * rate
    decay = -2 * math.pi * corner * level
    if abs(decay) <= CONSISTENT * std:
        return level, not after_press
    return level, abs(slope - decay) >= abs(slope)


def block_means(signal: Floats, size: int) -> Floats:
    """Return the means over blocks of so many samples; those left at the end are omitted."""
    return signal[: len(signal) // size * size].reshape(-1, size).mean(1)


def _steady(means: Floats, level: float, least: float, fastest: float) -> int:
    """Return the number of blocks at this level, counted from the first."""
    # The scatter of the first block means contains 1/f noise, which `white_noise` omits.
    steps = np.abs(np.diff(means[: 2 * round(LEAST_REST / BLOCK)]))
    scatter = median(steps) * MAD_TO_STD / math.sqrt(2)
    # A scatter at rest below 5 % of the largest speed is noise.
    moving = np.abs(means - level) > max(least, min(6 * scatter, 0.05 * fastest))
    # Two blocks beside the motion count as motion.
    return max(0, int(np.argmax(moving)) - 2) if moving.any() else len(means)


def _span(rows: slice, rate: float, start: float) -> tuple[float, float] | None:
    if rows.stop == rows.start:
        return None
    return start + rows.start / rate, start + rows.stop / rate


def _level(signal: Floats) -> tuple[float, float]:
    # The smallest standard deviation of a mean velocity is 0.01 mm/s.
    return float(signal.mean()), max(1e-5, white_noise(signal) / math.sqrt(len(signal)))


def _middle(rows: slice, rate: float) -> float:
    """Return the mean time of rows [s] after the first row of the recording."""
    return (rows.start + rows.stop - 1) / 2 / rate


def without_line(signal: Floats, line: tuple[float, float], rate: float) -> Floats:
    """Return a signal minus the line with this value at row 0 and this slope [per s]."""
    off = np.arange(len(signal), dtype=float)
    off *= -line[1] / rate
    off -= line[0]
    off += signal
    return off


def _taken(line: tuple[float, float], n: int, rate: float) -> tuple[float, float]:
    """Return the largest value of a line over n rows [m/s], and of its integral [m]."""
    level, slope = line
    last = (n - 1) / rate
    turn = -level / slope if slope and 0 < -level / slope < last else last
    moved = max(abs(t * (level + slope * t / 2)) for t in (turn, last))
    return max(abs(level), abs(level + slope * last)), moved
