"""The sensor chain of one channel: from the measured quantity to volts at the terminal block."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator
from scipy import signal

from sautereau.rig.acquisition import Channel
from sautereau.sim_backend.parts import Sensors, Transducer
from sautereau.sim_backend.sensors.simulated import SIMULATED, Disturbance
from sautereau.trajectory.motion import Floats


@dataclass(frozen=True)
class Converter:
    """Rounds volts to its steps, and clips them at its range."""

    range: float
    """V, full scale either way."""
    bits: int

    def convert(self, volts: Floats) -> Floats:
        """Return what it reads [V]."""
        step = 2 * self.range / 2**self.bits
        return np.clip(np.rint(volts / step) * step, -self.range, self.range - step)


IDEAL_CONVERTER = Converter(range=10.0, bits=24)
"""Converter of the ideal card, if the scene has sensors."""


Function = Callable[[Floats], Floats]


class Signal:
    """A quantity over time, linear between instants, with jumps."""

    def __init__(self, value: float):
        self._times, self._values = np.zeros(1), np.array([value])

    def extend(self, times: Floats, values: Floats) -> None:
        """Append instants [s from the trigger]; two equal ones are both sides of a jump."""
        self._times = np.concatenate([self._times, times])
        self._values = np.concatenate([self._values, values])

    def at(self, times: Floats) -> Floats:
        """Return the value at times [s] that only grow; before the first instant, that at rest.

        At a jump it is the value after it. Earlier instants are dropped.
        """
        if len(times):
            past = max(0, int(np.searchsorted(self._times, times[0])) - 1)
            self._times, self._values = self._times[past:], self._values[past:]
        return np.interp(times, self._times, self._values)


class SensorChain:
    """One channel: delay, resonance, low-pass, AC coupling, noise, hum, range and conversion.

    Args:
        channel: Calibration of the sensor, which holds for the simulated one.
        sensors: Noise and hum; None for a sensor without noise, range and converter.
        rate: Hz.
        rest: Value [SI] of the quantity before the trigger.
        disturbances: Faults of the sensor, in the order in which they act.
        lag: s, by which the card's samples lag its terminal; negative where they are later.
        converter: Of the card; None for an ideal card.
        transducer: Its resonance; None for a sensor without one.
        reversed_sign: Whether its output has the opposite sign.
        function: Of the input, to which it is applied before all else; None for the input itself.
    """

    def __init__(
        self,
        channel: Channel,
        sensors: Sensors | None,
        rate: float,
        rest: float,
        random: Generator,
        disturbances: Sequence[Disturbance] = (),
        lag: float = 0.0,
        converter: Converter | None = None,
        transducer: Transducer | None = None,
        reversed_sign: bool = False,
        function: Function | None = None,
    ):
        self.channel = channel
        self._scale = -channel.scale if reversed_sign else channel.scale
        self._sensors, self._function = sensors, function
        self.rate = rate
        self.input = Signal(rest)
        self._random = random
        self._disturbances = disturbances
        self._lag, self._converter = lag, converter
        self._phase = random.uniform(0, 2 * np.pi)
        self._resonance = _oscillator(transducer, rate) if transducer else ([1.0], [1.0])
        self._state = rest * signal.lfilter_zi(*self._resonance) if transducer else np.zeros(0)
        filters: list[Any] = _low_pass(channel, rate)
        if channel.high_pass > 0:
            filters.append(signal.butter(1, channel.high_pass, "high", fs=rate, output="sos"))
        self._filters = [[sections, signal.sosfilt_zi(sections) * rest] for sections in filters]

    def volts(self, first: int, n: int) -> Floats:
        """Return n samples [V] from sample ``first`` on; call it in order."""
        if n == 0:  # for no samples, lfilter returns a state that it has not set
            return np.zeros(0)
        times = np.arange(first, first + n) / self.rate - self._lag
        value = self.input.at(times - self.channel.delay)
        value = value if self._function is None else self._function(value)
        value, self._state = signal.lfilter(*self._resonance, value, zi=self._state)
        for disturbance in self._disturbances:
            value = disturbance.disturb(times, value)
        for one in self._filters:
            sections, state = one
            value, one[1] = signal.sosfilt(sections, value, zi=state)
        sensors = self._sensors
        if sensors is None:
            volts = value / self._scale
            return volts if self._converter is None else self._converter.convert(volts)
        simulated = SIMULATED.get(self.channel.quantity)
        value = value + simulated.noise(sensors) * self._random.standard_normal(n)
        if hum := simulated.hum(sensors):
            value += hum * np.sin(2 * np.pi * sensors.hum_frequency * times + self._phase)
        volts = np.clip(value / self._scale, -self.channel.range, self.channel.range)
        return (self._converter or IDEAL_CONVERTER).convert(volts)


def _low_pass(channel: Channel, rate: float) -> list[Any]:
    """Return the sections of a channel's low-pass in a list, which is empty without one.

    With an order it is a Butterworth filter that delays slow signals as the analogue one does, at
    any corner. Without, it is of first order, and adds little to `delay`, which contains its delay.

    Args:
        rate: Hz, of the samples.
    """
    corner, order = channel.low_pass, channel.low_pass_order
    if order:
        poles: Any = signal.butter(order, 2 * np.pi * corner, analog=True, output="zpk")
        return [signal.zpk2sos(*signal.bilinear_zpk(*poles, fs=rate))]
    if 0 < corner < rate / 2:
        return [signal.butter(1, corner, fs=rate, output="sos")]
    return []


def _oscillator(transducer: Transducer, rate: float) -> tuple[Floats, Floats]:
    """Return the filter of w^2 / (s^2 + 2 zeta w s + w^2), exact for an input linear in between.

    Args:
        transducer: With w and zeta.
        rate: Hz, of the samples.
    """
    w = 2 * np.pi * transducer.resonance
    continuous = [w * w], [1.0, 2 * transducer.damping * w, w * w]
    filtered: Any = signal.cont2discrete(continuous, 1 / rate, method="foh")
    return np.ravel(filtered[0]), np.ravel(filtered[1])


class OpenInput:
    """An input to which no sensor is connected; it reads 0 V."""

    def volts(self, first: int, n: int) -> Floats:
        """Return n samples [V] from sample ``first`` on."""
        return np.zeros(n)
