"""The sensor chain: from what happens on the bench to volts at the terminal block."""

import bisect

import numpy as np
from numpy.random import Generator
from scipy import signal

from rig.schema import ForceChannel, VelocityChannel
from sim_backend.scene import Sensors
from trajectory.motion import Floats

ADC_RANGE = 10.0
"""V, the converter's full scale either way."""
ADC_BITS = 24


class Signal:
    """A quantity of the bench over time, linear between instants, with jumps."""

    def __init__(self, value: float):
        self._times, self._values = [0.0], [value]

    def extend(self, times: Floats, values: Floats, jumps: list[float]) -> None:
        """Append instants [s from the trigger]; at a jump both sides are carried on."""
        for jump in jumps:
            k = int(np.searchsorted(times, jump))
            before = (self._times[-1], self._values[-1])
            if k > 0:
                before = (float(times[k - 1]), float(values[k - 1]))
            after = float(values[k]) if k < len(values) else before[1]
            slope = self._slope(times, values, k)
            left = before[1] + slope * (jump - before[0])
            times = np.insert(times, k, [jump, np.nextafter(jump, np.inf)])
            values = np.insert(values, k, [left, after])
        self._times.extend(times.tolist())
        self._values.extend(values.tolist())

    def at(self, times: Floats) -> Floats:
        """Return the value at times [s] that only grow; before the first instant, that at rest.

        Instants that are no longer needed, save two for a slope, are let go.
        """
        past = bisect.bisect_left(self._times, times[0]) - 2 if len(times) else 0
        if past > 0:
            del self._times[:past], self._values[:past]
        return np.interp(times, self._times, self._values)

    def _slope(self, times: Floats, values: Floats, k: int) -> float:
        """Return the slope before instant k, from the two instants before it."""
        t = [*self._times[-2:], *times[:k].tolist()][-2:]
        v = [*self._values[-2:], *values[:k].tolist()][-2:]
        return (v[1] - v[0]) / (t[1] - t[0]) if len(t) == 2 and t[1] > t[0] else 0.0


class SensorChain:
    """One channel: delay, low-pass, AC coupling, noise, hum, range and conversion.

    Args:
        channel: Calibration chart of the sensor, true to the simulated one.
        sensors: What is added to the truth; None for a sensor that adds nothing.
        rate: Hz.
        rest: Value [SI] of the quantity before the trigger.
        random: Source of the noise.
    """

    def __init__(
        self,
        channel: VelocityChannel | ForceChannel,
        sensors: Sensors | None,
        rate: float,
        rest: float,
        random: Generator,
    ):
        self.channel = channel
        self.sensors = sensors
        self.rate = rate
        self.input = Signal(rest)
        self._random = random
        self._phase = random.uniform(0, 2 * np.pi)
        self._filters = []
        if 0 < channel.low_pass < rate / 2:
            self._add_filter(signal.butter(1, channel.low_pass, "low", fs=rate), rest)
        if channel.high_pass > 0:
            self._add_filter(signal.butter(1, channel.high_pass, "high", fs=rate), rest)

    def _add_filter(self, coefficients, rest: float) -> None:
        b, a = coefficients
        self._filters.append([b, a, signal.lfilter_zi(b, a) * rest])

    def volts(self, first: int, n: int) -> Floats:
        """Return n samples [V], the next after ``first``; call it in order."""
        if n == 0:  # of nothing, lfilter returns a state that it has not set
            return np.zeros(0)
        times = np.arange(first, first + n) / self.rate
        value = self.input.at(times - self.channel.delay)
        for state in self._filters:
            b, a, zi = state
            value, state[2] = signal.lfilter(b, a, value, zi=zi)
        sensors = self.sensors
        if sensors is None:
            return value / self.channel.scale
        noise = self._random.standard_normal(n)
        if self.channel.quantity == "velocity":
            value = value + sensors.velocity_noise * noise
        else:
            hum = np.sin(2 * np.pi * sensors.hum_frequency * times + self._phase)
            value = value + sensors.force_noise * noise + sensors.hum * hum
        volts = np.clip(value / self.channel.scale, -self.channel.range, self.channel.range)
        step = 2 * ADC_RANGE / 2**ADC_BITS
        return np.clip(np.rint(volts / step) * step, -ADC_RANGE, ADC_RANGE - step)
