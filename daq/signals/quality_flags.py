"""Stretches of a signal that cannot be believed: found and told, never mended."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sautereau.daq.signals.sensors import white_noise
from sautereau.rig.acquisition import Channel

CLIPPING_MARGIN = 1e-3
"""1, share of the range about its end within which a sample counts as clipped."""
FLAT = 8
"""Samples without noise, at the least, that make a saturated amplifier."""
FLAT_NOISE = 0.05
"""1, share of the signal's own noise below which a step between samples is without noise."""
FLAT_LEVEL = 0.1
"""1, share of the range from which on a flat signal is one of an amplifier."""
LEAST_NOISE = 1e-6
"""1, share of the range below which a signal is too clean for flatness to mean anything."""
DROP_OUT_WINDOW = 3e-3
"""s, of the running median beside which a drop-out stands; it finds those of up to half."""
DROP_OUT_SEED = 7.0
"""Standard deviations of the noise from the median that make a drop-out."""
DROP_OUT_EDGE = 3.0
"""Standard deviations down to which it reaches."""
DROP_OUT_JUMP = 3
"""Samples within which it begins or ends by `DROP_OUT_SHARE` of its depth, as no key can."""
DROP_OUT_SHARE = 0.5
"""1, least share of its depth."""
LEAST_DROP_OUT = 2e-3
"""1, share of the range below which nothing is a drop-out, however small the noise."""

Signal = NDArray[np.float64]
Kind = Literal["clipped", "overload", "drop-out"]
REMEDIES: dict[Kind, str] = {
    "clipped": "take a larger range or a lower gain",
    "overload": "lower the gain of the amplifier, and let it recover before the next press",
    "drop-out": "turn the laser to a brighter spot, or put reflecting tape under it",
}


@dataclass(frozen=True)
class Mark:
    """A stretch of one channel, ``start <= t < stop``."""

    kind: Kind
    """`clipped` stands at the end of the range, `overload` is beyond it or in a saturated
    amplifier, `drop-out` is a moment without a vibrometer's signal."""
    channel: str
    """Name of the channel."""
    start: float
    """s, of its first sample, from the trigger, with the sensor's lag taken back."""
    stop: float
    """s, of the sample after its last."""


def find_marks(volts: Signal, channel: Channel, rate: float, first_sample: int = 0) -> list[Mark]:
    """Find what cannot be believed in a channel.

    Args:
        volts: Shape (n_samples,), V, raw.
        channel: As its calibration chart describes it.
        rate: Hz.
        first_sample: Index of the first, counted from the trigger.

    Returns:
        In the order of time.
    """
    # Samples may be anything that a file can hold, and their differences overflow.
    with np.errstate(over="ignore", invalid="ignore"):
        found = _found(np.asarray(volts, dtype=float), channel, rate)

    def time(sample: int) -> float:
        return (first_sample + sample) / rate - channel.lag

    found.sort(key=lambda mark: mark[1:])
    return [Mark(kind, channel.name, time(a), time(b)) for kind, a, b in found]


def mark_warnings(marks: Iterable[Mark]) -> list[str]:
    """Return one line for each kind of mark in each channel."""
    groups: dict[tuple[str, Kind], list[Mark]] = {}
    for mark in marks:
        groups.setdefault((mark.channel, mark.kind), []).append(mark)
    lines = []
    for (channel, kind), group in groups.items():
        length = sum(mark.stop - mark.start for mark in group)
        lines.append(
            f"{channel}: {kind} in {len(group)} stretches, {length * 1e3:.3g} ms in all, first at"
            f" {group[0].start * 1e3:.5g} ms; {REMEDIES[kind]}"
        )
    return lines


def _found(volts: Signal, channel: Channel, rate: float) -> list[tuple[Kind, int, int]]:
    """Return the marks as kind, first sample and sample after the last."""
    noise, away = white_noise(volts), np.abs(volts)
    high = away >= channel.range * (1 - CLIPPING_MARGIN)
    found: list[tuple[Kind, int, int]] = []
    for start, stop in _runs(high):
        beyond = away[start:stop].max() > channel.range * (1 + CLIPPING_MARGIN)
        found.append(("overload" if beyond else "clipped", start, stop))
    for start, stop in _saturated(volts, away, noise, channel.range, high):
        found.append(("overload", start, stop))
    if channel.quantity == "velocity":
        for start, stop in _drop_outs(volts, noise, channel.range, rate, high):
            found.append(("drop-out", start, stop))
    return found


def _saturated(
    volts: Signal, away: Signal, noise: float, largest: float, known: NDArray[np.bool_]
) -> list[tuple[int, int]]:
    """Return where a noisy signal stands still away from zero, below the end of the range."""
    if noise < LEAST_NOISE * largest or len(volts) < FLAT:
        return []
    steps = np.diff(volts)
    still = np.abs(steps, out=steps) < FLAT_NOISE * noise
    still &= away[1:] > FLAT_LEVEL * largest
    still &= ~(known[1:] | known[:-1])
    return [(a, b + 1) for a, b in _runs(still) if b + 1 - a >= FLAT]


def _drop_outs(
    volts: Signal, noise: float, largest: float, rate: float, known: NDArray[np.bool_]
) -> list[tuple[int, int]]:
    """Return the short dips and spikes beside a running median that begin or end at once.

    A key turning round stands beside the median as well, but slowly.
    """
    window = math.ceil(DROP_OUT_WINDOW * rate) | 1
    if len(volts) < window:
        return []
    unit = max(noise, LEAST_DROP_OUT * largest / DROP_OUT_SEED)
    least = DROP_OUT_SEED * math.sqrt(2) * unit
    jumps = volts[DROP_OUT_JUMP:] - volts[:-DROP_OUT_JUMP]
    np.abs(jumps, out=jumps)
    if not (jumps > least).any():
        return []  # before the median is taken, which is most of the work
    from scipy.ndimage import median_filter

    away = np.abs(volts - median_filter(volts, window, mode="nearest"))
    found = []
    for start, stop in _runs(away > DROP_OUT_EDGE * unit):
        depth = away[start:stop].max()
        jump = jumps[max(0, start - DROP_OUT_JUMP) : stop].max()
        sudden = jump > max(least, DROP_OUT_SHARE * depth)
        if depth > DROP_OUT_SEED * unit and sudden and not known[start:stop].any():
            found.append((start, stop))
    return found


def _runs(which: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the unbroken stretches of True, as first and after last."""
    edges = (1 + np.flatnonzero(which[1:] != which[:-1])).tolist()
    if len(which) and which[0]:
        edges.insert(0, 0)
    if len(which) and which[-1]:
        edges.append(len(which))
    return list(zip(edges[::2], edges[1::2], strict=True))
