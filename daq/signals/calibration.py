"""Calibration: volts to SI units and back, inverse of the AC coupling, age of the calibration.

A recording holds raw volts; this module converts them to the measured quantity, such as
newtons. The sensor's delay is compensated in `daq.signals.delays`.
"""

import math
from datetime import date

import numpy as np
from numpy.typing import NDArray

from sautereau.rig.acquisition import Channel

CALIBRATION_LIFE = 366
"""Days after which a calibration is reported as old."""
NOISE_ROWS = 2048
"""Approximate number of second differences used to estimate the noise of a long signal."""

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
    restored = np.cumsum(y)
    restored -= y[0] / 2
    restored *= step
    restored += (1 - step / 2) * y  # half of the last sample is not in the integral
    return restored


def correct(volts: Signal, channel: Channel, rate: float) -> Signal:
    """Convert raw volts to SI values and invert the AC coupling.

    Args:
        volts: Raw volts, shape (n_samples,), V, starting at rest.
        channel: Channel with its calibration.
        rate: Sampling rate, Hz.

    Returns:
        Shape (n_samples,), in ``channel.unit``; the delay is not compensated, see
        `daq.signals.delays`.
    """
    return undo_high_pass(to_si(volts, channel), channel.high_pass, rate)


def white_noise(signal: Signal) -> float:
    """Return the standard deviation of the white noise in a signal, in its unit.

    It follows from the median of the second differences, on which motion has hardly any effect.
    Of a long signal only `NOISE_ROWS` of them are used, which gives it to 2.6 %.
    """
    n = len(signal) - 2
    if n < 1:
        return 0.0
    step = max(1, round(n / NOISE_ROWS))
    with np.errstate(over="ignore", invalid="ignore"):  # samples may be any double
        second = signal[2::step] - 2 * signal[1:-1:step] + signal[:n:step]
        second = second[np.isfinite(second)]
    if not len(second):
        return 0.0
    second -= _median(second)
    return 1.4826 * _median(np.abs(second, out=second)) / math.sqrt(6)


def _median(signal: Signal) -> float:
    """Return the median, of an even number the upper of the two; faster than numpy's."""
    middle = len(signal) // 2
    return float(np.partition(signal, middle)[middle])


def calibration_warning(channel: Channel, on: date) -> str | None:
    """Return a warning about the age of a channel's calibration; None if there is none.

    Args:
        channel: Channel with the date of its calibration.
        on: Day of the recording.
    """
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
