"""The sensor chains: from the true motion and force to converted volts."""

import numpy as np
from scipy import signal

from .conditions import Conditions, Sensor


def white(rng: np.random.Generator, count: int, rms: float, band: float, rate: float) -> np.ndarray:
    """Return white noise whose part below ``band`` (Hz) has that rms; shape (count,)."""
    return rng.standard_normal(count) * rms * np.sqrt(max(rate / 2 / band, 1.0))


def pink(rng: np.random.Generator, count: int, rms: float, rate: float) -> np.ndarray:
    """Return 1/f noise of that rms between 1 Hz and 1 kHz; shape (count,)."""
    spectrum = np.fft.rfft(rng.standard_normal(count))
    frequency = np.fft.rfftfreq(count, 1 / rate)
    shaped = np.zeros(len(frequency))
    shaped[1:] = np.sqrt(rate / 2 / frequency[1:] / np.log(1000.0))
    return rms * np.fft.irfft(spectrum * shaped, count)


def lagged(values: np.ndarray, delay: float, rate: float) -> np.ndarray:
    """Return the signal delayed, by linear interpolation between the fine samples."""
    index = np.arange(len(values)) - delay * rate
    return np.interp(index, np.arange(len(values)), values)


def filtered(values: np.ndarray, sensor: Sensor, rate: float) -> np.ndarray:
    """Return the signal after the low-pass (Butterworth) and the AC coupling (first order)."""
    low = signal.butter(sensor.low_pass_order, sensor.low_pass, fs=rate, output="sos")
    values = signal.sosfilt(low, values, zi=signal.sosfilt_zi(low) * values[0])[0]
    if not sensor.high_pass:
        return values
    high = signal.butter(1, sensor.high_pass, "high", fs=rate, output="sos")
    return signal.sosfilt(high, values, zi=signal.sosfilt_zi(high) * values[0])[0]


def speckled(
    rng: np.random.Generator, values: np.ndarray, sensor: Sensor, rate: float
) -> np.ndarray:
    """Return a vibrometer's signal with drop-outs, in which it shows a false constant velocity."""
    count = rng.poisson(sensor.drop_outs * len(values) / rate / sensor.drop_out)
    values = values.copy()
    for start in rng.integers(0, len(values), count):
        stop = start + max(int(rng.exponential(sensor.drop_out) * rate), 1)
        false = rng.uniform(-0.5, 0.5) * sensor.range * sensor.scale
        values[start:stop] = values[start:stop] * rng.uniform(0, 0.5) + false
    return values


def converted(values: np.ndarray, sensor: Sensor) -> np.ndarray:
    """Return the volts of a converter of that range and resolution."""
    step = 2 * sensor.range / 2**sensor.bits
    volts = np.clip(values / sensor.scale, -sensor.range, sensor.range - step)
    return np.round(volts / step) * step


def measure(
    rng: np.random.Generator,
    velocity: np.ndarray,
    force: np.ndarray,
    conditions: Conditions,
    fine: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the volts of both channels at the converter's rate.

    Args:
        velocity: m/s, true, at the rate ``fine``; shape (n,).
        force: N, true; shape (n,).
        fine: Hz.
    """
    count = len(velocity)
    times = np.arange(count) / fine
    sampled = np.arange(int(times[-1] * conditions.rate) + 1) / conditions.rate
    results = []
    acceleration = np.gradient(velocity, 1 / fine)
    for sensor, true, other in (
        (conditions.velocity, velocity, np.zeros(count)),
        (conditions.force, force, acceleration),
    ):
        values = sensor.gain * (true + sensor.cross_talk * other)
        if sensor.drop_outs:
            values = speckled(rng, values, sensor, fine)
        values = lagged(values, sensor.delay + sensor.delay_error, fine)
        values = values + white(rng, count, sensor.noise, sensor.low_pass, fine)
        phase = rng.uniform(0, 2 * np.pi)
        values += sensor.hum * np.sin(2 * np.pi * sensor.hum_frequency * times + phase)
        values += 0.3 * sensor.hum * np.sin(6 * np.pi * sensor.hum_frequency * times + 2 * phase)
        values += sensor.drift * times + pink(rng, count, sensor.pink, fine)
        values = filtered(values, sensor, fine)
        if conditions.anti_alias and conditions.rate < fine / 2:
            taps = int(40 * fine / conditions.rate) | 1
            window = signal.firwin(taps, 0.45 * conditions.rate, fs=fine, window=("kaiser", 8.0))
            padded = np.pad(values, taps // 2, mode="edge")
            values = signal.fftconvolve(padded, window, "valid")
        results.append(converted(np.interp(sampled, times, values), sensor))
    return results[0], results[1]
