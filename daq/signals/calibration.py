"""Calibration: volts to SI units and back, inverse of AC coupling and delay, age of calibration.

A recording holds raw volts; this module converts them to the measured quantity, such as newtons.
"""

import math
from datetime import date
from functools import cache

import numpy as np
from numpy.typing import NDArray

from sautereau.rig.acquisition import Channel

CALIBRATION_LIFE = 366  # Days after which a calibration is reported as old
NOISE_ROWS = 2048
"""Approximate number of second differences used to estimate the noise of a long signal."""
HALF_WIDTH = 16
"""Samples on either side used to interpolate a value; fewer at the ends of the record."""
WIDTH = 2 * HALF_WIDTH  # Samples used to interpolate a value
INTEGER_TOLERANCE = 1e-9
"""Samples by which a delay may differ from an integer number of them and count as one."""
MAD_TO_STD = 1.4826  # Standard deviation of normal values over the median of their absolute values

Signal = NDArray[np.float64]


def to_si(volts: Signal, channel: Channel) -> Signal:
    """Convert volts (V) to the channel's SI unit, any shape."""
    return np.asarray(volts, dtype=float) * channel.scale


def to_volts(values: Signal, channel: Channel) -> Signal:
    """Convert values in the channel's SI unit to volts (V), any shape."""
    return np.asarray(values, dtype=float) / channel.scale


def undo_high_pass(values: Signal, corner: float, rate: float) -> Signal:
    """Invert a first-order high-pass, for a signal at rest before the recording.

    The filter is y' + w y = x', with y = x = 0 before the first sample, so that
    x = y + w * integral of y. With the trapezoidal rule and w / rate = 2 tan(pi corner / rate),
    this is the exact inverse of the sampled filter, and of the analogue one to second order in
    the step. An offset of y becomes a ramp of x with w times its value as slope: subtract the
    offset first.

    Args:
        values: Filtered signal, shape (n_samples,), in any unit.
        corner: Corner frequency of the high-pass, Hz; 0 returns a copy of the signal.
        rate: Sampling rate, Hz.

    Returns:
        Shape (n_samples,), in the unit of ``values``.
    """
    y = np.asarray(values, dtype=float)
    if corner <= 0 or y.size == 0:
        return y.copy()
    step = 2 * math.tan(math.pi * corner / rate)
    found = np.cumsum(y)
    found -= y[0] / 2
    found *= step
    found += (1 - step / 2) * y  # half of the last sample is not in the integral
    return found


def restored(volts: Signal, channel: Channel, rate: float, early: int = 0) -> Signal:
    """Convert raw volts to SI values, with AC coupling inverted and delay compensated.

    Args:
        volts: Raw volts, shape (n_samples,), V, starting at rest.
        rate: Sampling rate, Hz.
        early: Further delay to compensate, in samples.

    Returns:
        In ``channel.unit``, as of `undelayed`.
    """
    values = undo_high_pass(to_si(volts, channel), channel.high_pass, rate)
    return undelayed(values, channel.lag * rate + early)


def white_noise(signal: Signal, longest: int = 1) -> float:
    """Return the standard deviation of the white noise in a signal, in its unit.

    It is computed from the median of the second differences, on which motion has little effect.
    For a long signal only `NOISE_ROWS` of them are used; the result is then accurate to 2.6 %. A
    low-pass reduces the differences between neighbouring samples, but not those between the means
    of blocks. Blocks therefore give the density of noise in a part of the band as well.

    Args:
        signal: Shape (n,), in any unit.
        longest: Samples of the longest block. The result is the largest of those for blocks of 1,
            2, 4 ... samples.
    """
    largest, block = 0.0, 1
    while block <= longest and len(signal) >= 3 * block:
        largest = max(largest, math.sqrt(block) * _second_difference(signal, block))
        block *= 2
    return largest


def robust_std(signal: Signal) -> float:
    """Return the standard deviation of most of a signal, from its median absolute deviation."""
    return MAD_TO_STD * median(np.abs(signal - median(signal)))


def _second_difference(signal: Signal, block: int) -> float:
    """Return the standard deviation of the means of blocks, from their second differences."""
    n = len(signal) // block
    step = max(1, round((n - 2) / NOISE_ROWS))
    with np.errstate(over="ignore", invalid="ignore"):  # samples may be any double
        if block > 1:
            signal = signal[: n * block].reshape(n, block) @ np.full(block, 1 / block)
        second = signal[2::step] - 2 * signal[1:-1:step] + signal[: n - 2 : step]
        if not math.isfinite(second.sum()):
            second = second[np.isfinite(second)]
    if not len(second):
        return 0.0
    # Of a motion, only its acceleration within two samples contributes to the second differences.
    return MAD_TO_STD * median(np.abs(second, out=second)) / math.sqrt(6)


def median(signal: Signal) -> float:
    """Return the median, or the upper of the two middle values; faster than numpy's."""
    middle = len(signal) // 2
    return float(np.partition(signal, middle)[middle])


def calibration_warning(channel: Channel, on: date) -> str | None:
    """Return a warning about the age of a channel's calibration; None if there is none."""
    sensor = f"{channel.name}: {channel.sensor}"
    if channel.calibrated is None:
        return f"{sensor} has no date of calibration; set `calibrated` in the rig file"
    age = (on - channel.calibrated).days
    if age < 0:
        return (
            f"{sensor} was calibrated on {channel.calibrated}, {-age} days after the recording of"
            f" {on}; correct `calibrated` in the rig file, or check whether the scale was different"
            " then"
        )
    if age > CALIBRATION_LIFE:
        return (
            f"{sensor} was calibrated on {channel.calibrated}, {age} days before the recording,"
            f" more than {CALIBRATION_LIFE}; have it recalibrated"
        )
    return None


def undelayed(signal: Signal, lag: float) -> Signal:
    """Return a signal with its delay compensated, without extrapolation.

    Values between samples are those of Lagrange's polynomial through `HALF_WIDTH` samples on
    either side: a sine is reproduced to 1e-8 of its amplitude up to 0.2 of the sampling rate, to
    2e-4 at 0.3 and to 5 % at 0.4 (for the worst delay, half a sample). Near the ends the
    polynomial uses equally many samples on both sides, at least one. A NaN affects the values
    within 2 `WIDTH`.

    Args:
        signal: Shape (n,), in any unit.
        lag: Delay in samples, integer or not, not negative.

    Returns:
        Shape (n - lag rounded up,) or empty; sample k is the signal at k + lag.
    """
    integer, part = divmod(lag, 1.0)
    first = int(integer)
    if part > 1 - INTEGER_TOLERANCE:
        first, part = first + 1, 0.0
    if part < INTEGER_TOLERANCE:
        return signal[first:].copy()
    rows = max(0, len(signal) - first - 1)
    # Row k starts HALF_WIDTH - 1 samples before the sample that precedes value k WIDTH.
    blocks = np.zeros((-(-rows // WIDTH) + 1, WIDTH))
    flat, missing = blocks.reshape(-1), max(0, HALF_WIDTH - 1 - first)
    taps = signal[max(0, first - HALF_WIDTH + 1) :]
    flat[missing : missing + len(taps)] = taps
    near, far = _products(part)
    with np.errstate(over="ignore", invalid="ignore"):  # samples may be any double
        products = blocks[:-1] @ near
        products += blocks[1:] @ far
        found = products.reshape(-1)[:rows]
        # At the ends the complete stencil does not fit into the record.
        start = min(missing, rows)
        ends = np.concatenate(
            [np.arange(start), np.arange(max(start, rows + 1 - HALF_WIDTH), rows)]
        )
        halves = np.minimum(first + 1 + ends, rows - ends)
        windows = flat[ends[:, None] + np.arange(WIDTH)]
        found[ends] = (windows * _shortened(part)[halves]).sum(1)
    return found


@cache
def _products(part: float) -> tuple[Signal, Signal]:
    """Return the matrices that give a row of values: for its own samples, for the next row's.

    Matrix products are several times as fast as a correlation.
    """
    weights, index = _lagrange(part, HALF_WIDTH), np.arange(WIDTH)
    shift = index[:, None] - index
    return np.where(shift >= 0, weights[shift], 0.0), np.where(shift < 0, weights[shift], 0.0)


@cache
def _shortened(part: float) -> Signal:
    """Return weights of `WIDTH` samples; row k uses only k of them on either side."""
    weights = np.zeros((HALF_WIDTH, WIDTH))
    for half in range(1, HALF_WIDTH):
        weights[half, HALF_WIDTH - half : HALF_WIDTH + half] = _lagrange(part, half)
    return weights


def _lagrange(part: float, half: int) -> Signal:
    """Return the weights of samples 1 - half to half for the value at ``part``."""
    nodes = np.arange(1 - half, half + 1)
    weights = np.ones(2 * half)
    for i, node in enumerate(nodes):
        others = np.delete(nodes, i)
        weights[i] = np.prod((part - others) / (node - others))
    return weights
