"""Sensor signals: volts to SI and back, AC coupling undone, delay, clipping.

A recording holds raw volts; what stands here turns them into what the sensor felt.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from rig.schema import Channel

CLIPPING_MARGIN = 1e-3
"""1, share of the range below its end within which a sample counts as clipped."""

Signal = NDArray[np.float64]


class Clipped(NamedTuple):
    """A stretch of samples at the end of the range, ``start <= n < stop``."""

    start: int
    """Index of the first clipped sample."""
    stop: int
    """Index after the last clipped sample."""


def to_si(volts: Signal, channel: Channel) -> Signal:
    """Apply the channel's scale: volts (V) to its SI unit, any shape."""
    return np.asarray(volts, dtype=float) * channel.scale


def to_volts(values: Signal, channel: Channel) -> Signal:
    """Undo `to_si`: values in the channel's SI unit to volts (V), any shape."""
    return np.asarray(values, dtype=float) / channel.scale


def undo_high_pass(values: Signal, corner: float, rate: float) -> Signal:
    """Restore what a first-order high-pass took from a signal at rest before the record.

    The filter is y' + w y = x', with y = x = 0 before the first sample, so that
    x = y + w * integral of y. An offset of y becomes a ramp of x: take it off first.

    Args:
        values: Shape (n_samples,), the filtered signal, in any unit.
        corner: Hz, of the high-pass; 0 returns the signal as it is.
        rate: Hz, of the samples.

    Returns:
        Shape (n_samples,), in the unit of ``values``.
    """
    y = np.asarray(values, dtype=float)
    if corner <= 0 or y.size == 0:
        return y.copy()
    omega = 2 * math.pi * corner
    return y + omega * cumulative_trapezoid(y, dx=1 / rate, initial=0)


def correct(volts: Signal, channel: Channel, rate: float) -> Signal:
    """Turn raw volts into SI values with the droop of the AC coupling undone.

    The delay is a matter of the time axis: see `sample_times`.

    Args:
        volts: Shape (n_samples,), V, from the trigger on.
        channel: The channel as its calibration chart describes it.
        rate: Hz, of the samples.

    Returns:
        Shape (n_samples,), in ``channel.unit``.
    """
    return undo_high_pass(to_si(volts, channel), channel.high_pass, rate)


def time_shift(channel: Channel) -> float:
    """Return what to add to a sample's time to get the motion's (s); never positive."""
    return -channel.delay


def sample_times(n_samples: int, channel: Channel, rate: float) -> Signal:
    """Return when the motion was that each sample shows: n / rate - delay.

    Returns:
        Shape (n_samples,), s, from the trigger; ``rate`` in Hz.
    """
    return np.arange(n_samples) / rate + time_shift(channel)


def clipping(volts: Signal, channel: Channel) -> list[Clipped]:
    """Find where the signal stands at the end of its range.

    Args:
        volts: Shape (n_samples,), V.
        channel: Its ``range`` (V) is the limit, within `CLIPPING_MARGIN` of it.

    Returns:
        One interval for each unbroken stretch, in order; empty where nothing clips.
    """
    at_end = np.abs(np.asarray(volts, dtype=float)) >= channel.range * (1 - CLIPPING_MARGIN)
    edges = np.flatnonzero(np.diff(at_end, prepend=False, append=False))
    return [Clipped(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
