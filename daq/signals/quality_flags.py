"""Quality flags: stretches of a signal that are unreliable. They are reported, never corrected."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sautereau.daq.signals.calibration import white_noise
from sautereau.rig.acquisition import Channel

CLIPPING_MARGIN = 1e-3
"""Dimensionless, fraction of the range about its end within which a sample counts as clipped."""
FLAT = 8  # Smallest number of samples without noise that counts as a saturated amplifier
DROP_OUT_SEED = 7.0
"""Least deviation of a drop-out from the median, in standard deviations of the noise."""
DROP_OUT_JUMP = 60e-6  # Time in s, at least one sample, within which a drop-out starts and ends
FASTEST = 8.0
"""Acceleration at the laser, m/s^2, that a key can have at a release: that of 0.3 N at the jack.
Slower changes are not drop-outs."""
FASTEST_IMPACT = 100.0
"""The same of a key that meets its felts, m/s^2. It is used if a sample is longer than
`DROP_OUT_JUMP`: an impact may then begin and end within one sample, as a drop-out does."""

Signal = NDArray[np.float64]
Kind = Literal["clipped", "overload", "drop-out"]
HOW_TO_FIX: dict[Kind, str] = {
    "clipped": "use a larger range or a lower gain",
    "overload": "lower the gain of the amplifier, and let it recover before the next press",
    "drop-out": "aim the laser at a brighter spot, or put reflecting tape under it",
}


@dataclass(frozen=True)
class QualityFlag:
    """An unreliable stretch of one channel, ``start <= t < stop``."""

    kind: Kind
    """`clipped`: at the end of the range; `overload`: beyond it, or a saturated amplifier;
    `drop-out`: a short loss of a vibrometer's signal."""
    channel: str
    """Name of the channel."""
    start: float
    """Time of its first sample after the trigger, s, the sensor's delay compensated."""
    stop: float
    """Time of the sample after its last, s."""


def find_quality_flags(
    volts: Signal, channel: Channel, rate: float, first_sample: int = 0
) -> list[QualityFlag]:
    """Find the unreliable stretches of a channel.

    Args:
        volts: Raw volts, shape (n_samples,), V.
        rate: Sampling rate, Hz.
        first_sample: Index of the first sample, counted from the trigger.

    Returns:
        The flags in order of time.
    """
    # Samples may be any double, whose differences may overflow.
    with np.errstate(over="ignore", invalid="ignore"):
        volts = np.asarray(volts, dtype=float)
        noise, magnitude = white_noise(volts), np.abs(volts)
        high = magnitude >= channel.range * (1 - CLIPPING_MARGIN)
        # Kind, first sample and sample after the last of each flag.
        found: list[tuple[Kind, int, int]] = []
        for start, stop in runs_of(high):
            beyond = magnitude[start:stop].max() > channel.range * (1 + CLIPPING_MARGIN)
            found.append(("overload" if beyond else "clipped", start, stop))
        for start, stop in _saturated(volts, magnitude, noise, channel.range, high):
            found.append(("overload", start, stop))
        if channel.quantity == "velocity":
            for start, stop in _drop_outs(volts, channel, rate, noise, high):
                found.append(("drop-out", start, stop))

    def time(sample: int) -> float:
        return (first_sample + sample) / rate - channel.lag

    found.sort(key=lambda stretch: stretch[1:])
    return [QualityFlag(kind, channel.name, time(a), time(b)) for kind, a, b in found]


def quality_warnings(flags: Iterable[QualityFlag]) -> list[str]:
    """Return one line for each kind of flag in each channel."""
    groups: dict[tuple[str, Kind], list[QualityFlag]] = {}
    for flag in flags:
        groups.setdefault((flag.channel, flag.kind), []).append(flag)
    lines = []
    for (channel, kind), group in groups.items():
        length = sum(flag.stop - flag.start for flag in group)
        stretches = f"{len(group)} stretch{'es' * (len(group) > 1)}"
        lines.append(
            f"{channel}: {kind} in {stretches}, {length * 1e3:.3g} ms in total, first at"
            f" {group[0].start * 1e3:.5g} ms after the trigger; {HOW_TO_FIX[kind]}"
        )
    return lines


def _saturated(
    volts: Signal, magnitude: Signal, noise: float, largest: float, known: NDArray[np.bool_]
) -> list[tuple[int, int]]:
    """Return where a noisy signal is flat, away from zero and below the end of the range."""
    if noise < 1e-6 * largest or len(volts) < FLAT:  # Too little noise to judge
        return []
    # Smaller steps are flat. An amplifier may saturate far below the range of the card.
    least, level = 0.05 * noise, 0.1 * min(largest, float(magnitude.max()))
    # A flat stretch contains four samples of which the first has an index divisible by four.
    fours = volts[: len(volts) // 4 * 4].reshape(-1, 4)
    pairs = (np.abs(fours[:, 1] - fours[:, 0]) < least) & (np.abs(fours[:, 1]) > level)
    if not (np.abs(np.diff(fours[np.flatnonzero(pairs)])) < least).all(1).any():
        return []
    flat = np.abs(np.diff(volts)) < least
    flat &= magnitude[1:] > level
    flat &= ~(known[1:] | known[:-1])
    found = [(start, stop + 1) for start, stop in runs_of(flat) if stop + 1 - start >= FLAT]
    if not found:
        return []
    # With less noise in counts of the converter, equal samples do not show saturation.
    return [] if noise < 2.0 * _count(volts) else found


def _count(volts: Signal) -> float:
    """Return the smallest difference of samples, one count of a coarse converter; 0 without any."""
    levels = np.unique(volts[:2048])
    return float(np.diff(levels).min()) if len(levels) > 1 else 0.0


def _drop_outs(
    volts: Signal, channel: Channel, rate: float, noise: float, known: NDArray[np.bool_]
) -> list[tuple[int, int]]:
    """Return short deviations from a running median that start and end suddenly.

    A key that reverses its motion, as at a release, deviates from the median too, but slowly. After
    an impact the deviation starts suddenly and ends slowly. A vibrating key deviates before and
    after as well.
    """
    window = math.ceil(3e-3 * rate) | 1  # s; it finds drop-outs of up to half this length
    if len(volts) < window:
        return []
    step = max(1, round(DROP_OUT_JUMP * rate))
    # A drop-out is at least 0.2 % of the range deep, whatever the noise.
    unit = max(noise, 2e-3 * channel.range / DROP_OUT_SEED)
    fastest = FASTEST if DROP_OUT_JUMP * rate >= 1 else FASTEST_IMPACT
    fastest *= step / rate / channel.scale
    jumps = volts[step:] - volts[:-step]
    highest = max(jumps.max(), -jumps.min())
    # Before computing the resolution, the noise of blocks and the median: most of the work.
    if not highest > max(DROP_OUT_SEED * math.sqrt(2) * unit, fastest):
        return []
    # The median difference of samples does not show the rounding to a coarse converter's counts.
    unit = max(white_noise(volts, step), unit, _count(volts) / math.sqrt(12))
    least = max(DROP_OUT_SEED * math.sqrt(2) * unit, fastest)
    if not highest > least:
        return []
    from scipy.ndimage import median_filter

    deviation = volts - median_filter(volts, window, mode="nearest")
    magnitude = np.abs(deviation)
    runs = np.array(runs_of(magnitude > 3.0 * unit), int).reshape(-1, 2)
    depths = np.maximum.reduceat(np.append(magnitude, 0.0), runs.ravel())[::2]
    deep = depths > DROP_OUT_SEED * unit
    found = []
    for (start, stop), depth in zip(runs[deep].tolist(), depths[deep].tolist(), strict=True):
        away = np.sign(deviation[start + int(np.argmax(magnitude[start:stop]))])
        inside = away * jumps[max(0, start - step) : stop]
        starts, ends = int(np.argmax(inside)), int(np.argmin(inside))
        # Beside another drop-out the median is not that of the motion.
        close = bool(found) and start - found[-1][1] < window
        edge = (max if close else min)(inside[starts], -inside[ends])
        sudden = edge > max(least, 0.5 * depth) and (close or starts < ends)
        wide = stop - start + 1
        beside = np.concatenate([deviation[max(0, start - wide) : start], deviation[stop:][:wide]])
        # No deviation of a vibrating key longer than 0.5 ms starts or ends suddenly.
        slower = stop - start > 0.5e-3 * rate > 4 * step
        # A vibrating key deviates beside a drop-out as well.
        sudden &= slower or np.abs(beside).max(initial=0.0) < 0.4 * depth
        if sudden and not known[start:stop].any():
            found.append((start, stop))
    return found


def runs_of(which: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the uninterrupted stretches of True: first index and index after the last."""
    if not which.any():
        return []
    edges = np.flatnonzero(np.diff(which, prepend=False, append=False)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))
