"""Find the presses in a recording in which the key is pressed several times.

Between two presses there is a pause: the key is at rest where it was before the press, and the
force at its level there. A key that is held down is at rest as well, but in another place. The
place follows from the velocity relative to that in the rests beside it, and every level is compared
with that in the previous pause, so that offsets and drifts of the sensors have little effect. All
this is found in means over blocks of 1 ms.

The force alone does not show where the key is: after a release it may be back at its level at rest
until the key reaches the front felt. A pause is then longer than this can last.
"""

import itertools
import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.drift import BLOCK, HIGH, LOW, block_means
from sautereau.analysis.loading.press import SIGNALS, Press
from sautereau.daq.file.recorded import Recorded
from sautereau.daq.signals.calibration import median, to_si, undo_high_pass, white_noise
from sautereau.daq.signals.quality_flags import runs_of
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

PAUSE = 0.04  # s, shortest pause that separates two presses
REST = 0.5  # s, longest part of a pause that a press keeps before and after it
STEADY = {"velocity": 0.01, "force": 0.025}
"""Dimensionless, fractions of that range within which a signal at rest stays."""
NOISE = 8.0  # The same in standard deviations of the noise, if that is larger
BACK = 0.1  # Dimensionless, fraction of the largest press within which the key is back
LEAST = {"velocity": 0.5e-3, "force": 0.05}
"""m and N, least deflection at the laser, or force, of the largest press."""

AGAIN = (
    f"the key goes down again without {PAUSE * 1e3:g} ms at rest in between: it was split where the"
    " key is highest, and what the start of a part has of the press before may disturb its contact"
)
NO_END = "the recording ends before key and force are back at rest"


@dataclass(frozen=True)
class Span:
    """Consecutive samples of a recording, counted from its first."""

    start: int
    stop: int
    """Index after the last."""
    doubts: tuple[str, ...] = ()


@dataclass(frozen=True)
class Found:
    """What a recording holds."""

    presses: tuple[Span, ...]
    """Each with up to `REST` of the pauses before and after it."""
    others: tuple[Span, ...]
    """Smaller motion, and motion before the first rest; in none of the presses."""
    pause: float
    """s, shortest pause that separates presses."""


def presses_of(recorded: Recorded) -> Found:
    """Find the presses of a recording; see `find_presses`.

    Raises:
        AnalysisError: It has neither force nor velocity, or as `find_presses`.
    """
    rate, means = recorded.rate, {}
    size = block_size(rate)
    for name in SIGNALS:
        if channel := recorded.rig.daq.channel(name):
            found = to_si(block_means(recorded.volts[channel.name], size), channel)
            means[name] = undo_high_pass(found, channel.high_pass, rate / size)
    if not means:
        raise AnalysisError(f"recording {recorded.path}: it has no force and no velocity channel")
    try:
        return find_presses(means, rate, recorded.n_samples, recorded.rig)
    except AnalysisError as error:
        raise AnalysisError(f"recording {recorded.path}: {error}") from error


def find_presses(means: Mapping[str, Floats], rate: float, n_samples: int, rig: Rig) -> Found:
    """Find the presses in velocity, force or both.

    Args:
        means: Block means in SI units, AC coupling inverted; the velocity first.
        rate: Hz, of the samples.
        n_samples: Of the recording.
        rig: With the planned press.

    Raises:
        AnalysisError: There is no press, no rest, or the key is not up in the first rest.
    """
    size = block_size(rate)
    step, count = size / rate, n_samples // size
    if not all(np.isfinite(one).all() for one in means.values()):
        raise AnalysisError("it has samples that are not numbers; record again")
    levels = {
        # The median over 5 blocks removes drop-outs and spikes.
        name: _without_trend(ndimage.median_filter(one, 5))
        for name, one in means.items()
    }
    # The shortest pause in the force alone is twice the rise of the rig's jack.
    slowest = 2.0 * rig.press.jack_rise / rig.press.jack_speed
    pause = PAUSE if "velocity" in levels else max(PAUSE, slowest)
    rests = _rests(levels, means, step, pause) if count else []
    if not rests:
        raise AnalysisError(
            f"its signals are nowhere at rest for {pause * 1e3:.3g} ms, so that no press has a"
            " beginning; record a rest before and after each press"
        )
    if "velocity" in levels:
        # The integral of the velocity relative to that in the rests beside each block [m].
        velocity = levels["velocity"]
        middles = [(rows.start + rows.stop - 1) / 2 for rows in rests]
        offsets = [float(velocity[rows].mean()) for rows in rests]
        relative = velocity - np.interp(np.arange(len(velocity)), middles, offsets)
        levels["velocity"] = np.cumsum(relative) * step
    largest = {name: _largest(level, rests) for name, level in levels.items()}
    path = next(iter(levels))
    if largest[path] < max(LEAST[path], NOISE * white_noise(means[path]) * (path == "force")):
        raise AnalysisError("it shows no press; check the channels, and the signs of the sensors")
    pauses = _pauses(levels, rests, largest)
    presses, others = _between(levels[path], pauses, largest[path], step, path == "velocity")
    if pauses[0].start * step > PAUSE:
        others.insert(0, Span(0, pauses[0].start))
    return Found(
        tuple(_samples(one, size, n_samples) for one in presses),
        tuple(_samples(one, size, n_samples) for one in others),
        pause,
    )


def load_first(recorded: Recorded, load: Callable[[Recorded], Press]) -> Press:
    """Return the first press of a recording, loaded by a function.

    In minutes the integral of the velocity drifts by more than a key can move, and what was found
    in all of the recording is of no press. It is then loaded up to the end of the first pause.
    """
    press = load(recorded)
    path, key = press.samples.get("deflection", np.zeros(0)), press.rig.key
    if path.max(initial=0.0) > 2 * key.dip * key.laser_arm / key.press_arm:  # no key goes so far
        with suppress(AnalysisError):
            first, *others = presses_of(recorded).presses
            volts = {name: one[: first.stop] for name, one in recorded.volts.items()}
            if others:
                press = load(replace(recorded, volts=volts))
                return _cut(press, len(press.time))
    return first_press(press)


def first_press(press: Press) -> Press:
    """Return a press, up to the lowest place of its key before it is pressed again.

    Of the force alone, it is the press up to the pause before the next one.
    """
    end = _end_by_force(press) if press.missing == "velocity" else _end_by_key(press)
    return press if end is None else _cut(press, end)


def _cut(press: Press, end: int) -> Press:
    """Return the press up to a row, with a warning that another one follows."""
    warning = (
        f"the key goes down again after {press.time[end - 1] * 1e3:.5g} ms: only the first press is"
        " analysed; `sautereau split` writes each press into a recording of its own"
    )
    return replace(
        press,
        time=press.time[:end],
        samples={name: column[:end] for name, column in press.samples.items()},
        warnings=(*press.warnings, warning),
    )


def _end_by_key(press: Press) -> int | None:
    """Return the row after the first press; None if there is no other one."""
    path = press.samples["deflection"]
    high = HIGH * float(path.max(initial=0.0))
    first = int(np.argmax(path > high))
    back = first + int(np.argmax(path[first:] < LOW / HIGH * high))
    again = back + int(np.argmax(path[back:] > high))
    moved = high >= HIGH * LEAST["velocity"]  # otherwise it is noise
    return back + int(np.argmin(path[back:again])) + 1 if moved and first < back < again else None


def _end_by_force(press: Press) -> int | None:
    """Return the same by the force alone."""
    force, rate = press.samples["force"], press.rate
    try:
        means = block_means(force, block_size(rate))
        found = find_presses({"force": means}, rate, len(force), press.rig).presses
    except AnalysisError:
        return None
    return found[0].stop if len(found) > 1 else None


def block_size(rate: float) -> int:
    """Return the samples of a block of 1 ms."""
    return max(1, round(BLOCK * rate))


def _samples(blocks: Span, size: int, n_samples: int) -> Span:
    """Return a span of blocks in samples; the last block extends to the end."""
    stop = n_samples if blocks.stop == n_samples // size else blocks.stop * size
    return replace(blocks, start=blocks.start * size, stop=stop)


def _between(
    path: Floats, pauses: list[slice], largest: float, step: float, of_key: bool
) -> tuple[list[Span], list[Span]]:
    """Return the presses and other motion between the pauses, in blocks.

    A force may rise twice in a press, which only the path of the key (`of_key`) does not.
    """
    presses, others, count = [], [], len(path)
    for before, after in zip(pauses, [*pauses[1:], slice(count, count)], strict=True):
        motion = path[before.stop : after.start] - _level(path, before)
        high = float(motion.max(initial=0.0))
        if high >= HIGH * largest:
            # With up to `REST` of both pauses, of which 5 ms may still be of the other press.
            edge, rest = round(5e-3 / step), round(REST / step)
            start = max(before.start + edge * (before.start > 0), before.stop - rest)
            stop = min(after.stop - edge * (after.stop < count), after.start + rest)
            turns = [before.stop + turn for turn in _turns(motion, high)] if of_key else []
            ends = [start, *turns, stop]
            again, no_end = (AGAIN,) * bool(turns), (NO_END,) * (after.start == count)
            presses += [
                Span(a, b, again + no_end * (b == stop)) for a, b in itertools.pairwise(ends)
            ]
        elif high > BACK * largest:
            others.append(Span(before.stop, after.start))
    return presses, others


def _rests(
    levels: Mapping[str, Floats], means: Mapping[str, Floats], step: float, pause: float
) -> list[slice]:
    """Return the blocks in which all signals are steady for so long [s], as slices."""
    width = 2 * round(PAUSE / step / 2) + 1
    at_rest = np.ones(min(map(len, levels.values()), default=0), bool)
    for name, level in levels.items():
        # The range within 1 s on either side is that of one press.
        spread = float(_range(level, 2 * round(1.0 / step) + 1).max())
        least = max(STEADY[name] * spread, NOISE * white_noise(means[name]))
        # All blocks of a window whose range is that small.
        at_rest &= ndimage.binary_dilation(_range(level, width) <= least, np.ones(width))
        if name == "velocity":  # of which an offset changes slowly
            parts = np.array_split(level, max(1, round(len(level) * step / 5.0)))  # Medians of 5 s
            middles = np.cumsum([len(part) for part in parts]) - len(parts[0]) / 2
            offset = np.interp(np.arange(len(level)), middles, list(map(median, parts)))
            # A steady velocity up to 2 % of that range is an offset.
            at_rest &= np.abs(level - offset) < max(0.02 * spread, least)
    ends = (0, len(at_rest))
    # A rest at an end of the recording separates nothing, so that it may be shorter.
    return [
        rows
        for rows in (slice(*run) for run in runs_of(at_rest))
        if (rows.stop - rows.start) * step >= pause
        or ((rows.start in ends or rows.stop in ends) and 2 * (rows.stop - rows.start) >= width)
    ]


def _without_trend(level: Floats) -> Floats:
    """Return a signal minus the line through that third of its values that is closest to a line.

    Inverting the AC coupling has made this line of an offset. The search starts from the line
    through all values, and from that through both ends.
    """
    time, third = np.arange(len(level)), len(level) // 3 + 1
    best = math.inf, level
    for kept in (time, np.concatenate([time[:third][:20], time[-third:][-20:]])):
        # Lines through the third of the values that is closest to the previous one.
        for _ in range(10 if len(level) > 2 else 0):
            off = level - np.polyval(np.polyfit(time[kept], level[kept], 1), time)
            kept = np.argpartition(np.abs(off), third - 1)[:third]
            best = min(best, (float(off[kept] @ off[kept]), off), key=lambda fit: fit[0])
    return best[1]


def _range(level: Floats, width: int) -> Floats:
    """Return the range of the values in a window around each block."""
    return ndimage.maximum_filter1d(level, width) - ndimage.minimum_filter1d(level, width)


def _level(path: Floats, rest: slice) -> float:
    return median(path[rest])


def _largest(path: Floats, rests: list[slice]) -> float:
    """Return the largest value after a rest, relative to that rest."""
    stops = [*(rows.start for rows in rests[1:]), len(path)]
    return max(
        float(path[rows.stop : stop].max(initial=-np.inf)) - _level(path, rows)
        for rows, stop in zip(rests, stops, strict=True)
    )


def _pauses(
    levels: Mapping[str, Floats], rests: list[slice], largest: Mapping[str, float]
) -> list[slice]:
    """Return the rests in which all signals are back at their level in the pause before.

    Raises:
        AnalysisError: The key is not up in the first rest.
    """
    path = next(iter(levels))
    # Of the force: a finger may stay on the key.
    limits = {name: (BACK if name == path else 0.25) * largest[name] for name in levels}
    pauses = rests[:1]
    for rest in rests[1:]:
        moved = {name: _level(one, rest) - _level(one, pauses[-1]) for name, one in levels.items()}
        if moved[path] < -0.3 * largest[path]:  # No rest is that far below the previous pause
            raise AnalysisError(
                "the key goes up from its first rest: the recording starts while it is held down,"
                " or a sensor has the opposite sign; record a rest with the key up first, or import"
                " with --invert"
            )
        if all(abs(moved[name]) <= limits[name] for name in levels):
            pauses.append(rest)
    return pauses


def _turns(deflection: Floats, high: float) -> list[int]:
    """Return where the key is highest between going up and going down again."""
    turns, down = [], np.flatnonzero(deflection > HIGH * high)
    for last, first in itertools.pairwise(down.tolist()):
        between = deflection[last:first]
        if first > last + 1 and between.min() < LOW * high:
            turns.append(last + int(np.argmin(between)))
    return turns
