"""Sensor signals: volts to SI and back, AC coupling undone, the age of the calibration.

A recording holds raw volts; what stands here turns them into what the sensor felt. The lag
behind the motion is taken back in `daq.signals.delays`.
"""

import math
from datetime import date

import numpy as np
from numpy.typing import NDArray

from sautereau.rig.acquisition import Channel

CALIBRATION_LIFE = 366
"""Days after which a calibration is told to be old."""
NOISE_ROWS = 2048
"""Second differences from which a noise is told, about, where there are so many."""

Signal = NDArray[np.float64]


def to_si(volts: Signal, channel: Channel) -> Signal:
    """Apply the channel's scale: volts (V) to its SI unit, any shape."""
    return np.asarray(volts, dtype=float) * channel.scale


def to_volts(values: Signal, channel: Channel) -> Signal:
    """Undo `to_si`: values in the channel's SI unit to volts (V), any shape."""
    return np.asarray(values, dtype=float) / channel.scale


def undo_high_pass(values: Signal, corner: float, rate: float) -> Signal:
    """Restore what a first-order high-pass took from a signal at rest before the record.

    The filter is y' + w y = x', with y = x = 0 before the first sample, so that
    x = y + w * integral of y. By trapezia, with w / rate = 2 tan(pi corner / rate), that is the
    exact inverse of the sampled filter, and of the analogue one up to second order of the
    step. An offset of y becomes a ramp of x, w times as steep: take it off first.

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
    step = 2 * math.tan(math.pi * corner / rate)
    restored = np.cumsum(y)
    restored -= y[0] / 2
    restored *= step
    restored += (1 - step / 2) * y  # half of the last sample is not in the integral
    return restored


def correct(volts: Signal, channel: Channel, rate: float) -> Signal:
    """Turn raw volts into SI values with the droop of the AC coupling undone.

    Args:
        volts: Shape (n_samples,), V, from rest on.
        channel: The channel as its calibration chart describes it.
        rate: Hz, of the samples.

    Returns:
        Shape (n_samples,), in ``channel.unit``; the lag is still in it, see `daq.signals.delays`.
    """
    return undo_high_pass(to_si(volts, channel), channel.high_pass, rate)


def white_noise(signal: Signal) -> float:
    """Return the standard deviation of the white noise in a signal, in its unit.

    It comes from the median of the second differences, which motion hardly touches. Of a long
    signal every so many are enough: `NOISE_ROWS` tell it to 2.6 %.
    """
    n = len(signal) - 2
    if n < 1:
        return 0.0
    step = max(1, round(n / NOISE_ROWS))
    with np.errstate(over="ignore", invalid="ignore"):  # samples may be anything
        second = signal[2::step] - 2 * signal[1:-1:step] + signal[:n:step]
        second = second[np.isfinite(second)]
    if not len(second):
        return 0.0
    second -= _median(second)
    return 1.4826 * _median(np.abs(second, out=second)) / math.sqrt(6)


def _median(signal: Signal) -> float:
    """Return the median, of an even number the upper of the two, sooner than numpy's own."""
    middle = len(signal) // 2
    return float(np.partition(signal, middle)[middle])


def calibration_warning(channel: Channel, on: date) -> str | None:
    """Tell what is wrong with the age of a channel's calibration, if anything is.

    Args:
        channel: Its ``calibrated`` is the chart's date.
        on: Day of the recording.
    """
    who = f"{channel.name}: {channel.sensor}"
    if channel.calibrated is None:
        return f"{who} has no date of calibration; give `calibrated` from its chart in the rig"
    age = (on - channel.calibrated).days
    if age < 0:
        return (
            f"{who} was calibrated on {channel.calibrated}, {-age} days after the recording of"
            f" {on}; mend `calibrated` in the rig, or see whether the scale was another then"
        )
    if age > CALIBRATION_LIFE:
        return (
            f"{who} was calibrated on {channel.calibrated}, {age} days before the recording, more"
            f" than {CALIBRATION_LIFE}; have it calibrated anew"
        )
    return None
