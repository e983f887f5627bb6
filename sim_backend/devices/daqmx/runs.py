"""Acquisitions on the simulated card: armed, triggered, and computed when they are read."""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np

from sautereau.analysis.model.choirs import choirs
from sautereau.analysis.model.string.string import ModalState, ModalString
from sautereau.rig.acquisition import Channel
from sautereau.rig.schema import Rig
from sautereau.sim_backend.clock import FairLock
from sautereau.sim_backend.devices.daqmx.card import ENDLESS, TaskSetup
from sautereau.sim_backend.fault_tables import Faults
from sautereau.sim_backend.physics.events import Motions
from sautereau.sim_backend.scene import Scene
from sautereau.sim_backend.sensors.chain import Function, OpenInput, SensorChain
from sautereau.sim_backend.sensors.simulated import SIMULATED, SimulatedQuantity, Source
from sautereau.trajectory.motion import Floats


@dataclass(frozen=True)
class RunFault:
    """A premature end of an acquisition."""

    sample: int
    """Number of the first sample that is not acquired."""
    error: Callable[[], Exception]
    """Makes the error that a read of it, or of a later sample, raises."""


@dataclass(frozen=True)
class Wiring:
    """What all acquisitions of a card have in common: the sensors of the bench at its inputs."""

    rig: Rig
    """The simulated bench, with the calibrations of its sensors."""
    scene: Scene
    """Its sensors, ideal where it has none, and their faults."""
    seed: int
    """Seed of the noise."""
    lock: FairLock
    """Guards the bench; notified whenever requested samples are complete."""
    paced: bool = False
    """Whether simulated time follows real time: it passes as long as an acquisition runs."""
    passed: Callable[[], float] = lambda: math.inf
    """Simulated time by the real clock, s: samples of later times are not acquired yet."""
    modes: Callable[[int, Floats], ModalState] | None = None
    """Motion of the modes of a string, by its number from 1, at past simulated times [s]."""

    def of_string(self, channel: Channel, simulated: SimulatedQuantity) -> Function | None:
        """Return the quantity of a string over simulated times [s]; None for any other."""
        if simulated.of_string is None or self.modes is None:
            return None
        measured, modes = simulated.of_string, self.modes
        string = choirs(self.rig)[channel.string - 1].string

        def at(times: Floats) -> Floats:
            found = modes(channel.string, times)
            return measured(ModalString(string, found.q.shape[1]), found, channel.place)

        return at


class SampledRun:
    """Samples of the bench, computed when they are read.

    Args:
        setup: Analog inputs, rate and number of samples.
        number: Of the run, so that each has different noise.
        rest: Motion of the bench just before; None where it has been at rest without a force.
    """

    def __init__(self, wiring: Wiring, setup: TaskSetup, number: int, rest: Motions | None = None):
        rig, scene, seed = wiring.rig, wiring.scene, wiring.seed
        self.n_samples = n_samples = setup.n_samples
        self.rate = setup.rate
        self.trigger_time: float | None = None
        """s, simulated, of the first sample taken."""
        self.stopped = False
        self._falling, self._starts_falling = setup.falling
        self.unwired = False
        """Whether nothing is wired to the terminal of its trigger."""
        self._before = setup.before
        self._edge = math.inf  # s, simulated, of the last edge
        self._first: int | None = None
        """Number of the first sample kept; None until the edge that decides it."""
        self._fault: RunFault | None = None
        self._end = n_samples
        self._lock = wiring.lock
        self._paced, self._passed, self._buffer = wiring.paced, wiring.passed, setup.buffer
        wired = {rig.daq.physical(channel): channel for channel in rig.daq.channels}
        lags = setup.lags or (0.0,) * len(setup.terminals)
        self._skew = max(0.0, *(-lag for lag in lags))
        self._chains: list[SensorChain | OpenInput] = []
        self._parts: list[tuple[SensorChain, Source]] = []
        """Chain and source of each input that has a sensor."""
        for i, name in enumerate(setup.terminals):
            if name not in wired:
                self._chains.append(OpenInput())
                continue
            simulated = SIMULATED.get(wired[name].quantity)
            value = 0.0
            if simulated.static and rest is not None:
                value = float(simulated.source(rig)(rest)[-1])
            key = np.random.SeedSequence(seed, spawn_key=(2, number, i))
            faults = scene.faults or Faults.model_construct()
            chain = SensorChain(
                wired[name],
                scene.sensors,
                setup.rate,
                value,
                np.random.default_rng([seed, number, i]),
                simulated.faults(faults, np.random.default_rng(key)),
                lags[i],
                setup.converters[i] if setup.converters else None,
                scene.transducer if simulated.on_transducer else None,
                faults.sensor_sign is not None
                and faults.sensor_sign.quantity == wired[name].quantity,
                wiring.of_string(wired[name], simulated),
            )
            self._chains.append(chain)
            self._parts.append((chain, simulated.source(rig)))
        self._fed: list[Motions] = []
        self._volts = np.empty((len(setup.terminals), 0))
        self._time = 0.0
        self._computed = self._done = self._dropped = self._read_to = 0
        self._requested: list[int] = []
        self._goal = n_samples if n_samples < ENDLESS else 0

    @property
    def waiting_for_time(self) -> bool:
        """Whether it needs simulated time: for its samples, or paced because it is not over."""
        if self._paced:
            return not self._complete
        # A continuous acquisition may run ahead of its reader.
        end = min(self._end, self._goal + 10_000)
        return self.trigger_time is not None and self._done < end and not self.stopped

    @property
    def waiting_for_trigger(self) -> bool:
        """Whether an edge on the trigger's terminal would start it."""
        return self._first is None and not self.stopped and not self.unwired

    def waits_for(self, falling: bool) -> bool:
        """Return whether it waits for a rising or a falling edge: its start's, then its own."""
        starts = self._before is not None and self.trigger_time is None
        edge = self._starts_falling if starts else self._falling
        return self.waiting_for_trigger and edge == falling

    @property
    def over(self) -> bool:
        """Whether no further sample will be computed."""
        return self.stopped or (self._first is not None and self._done >= self._end)

    @property
    def _complete(self) -> bool:
        """Whether no further sample will be acquired."""
        return self.stopped or (self.over and self.acquired >= self._done)

    @property
    def due(self) -> bool:
        """Whether a thread waits for samples that are complete."""
        return bool(self._requested) and min(self._requested) <= self._readable

    @property
    def acquired(self) -> int:
        """Samples of each channel acquired since the start, kept or not."""
        if not self._paced or self.trigger_time is None:
            return self._done
        now = self._passed()
        if now < self.trigger_time:
            return 0
        least = 0
        if self._first is not None and now >= self._edge:  # whose sample is computed with a tick
            least = self._first + (self._before or 0) + 1
        now = min(now, self._time) - self.trigger_time
        return max(least, min(self._done, self._converted(now)))

    def _converted(self, elapsed: float) -> int:
        """Return how many samples are converted a time [s] after the first edge or the start."""
        return math.floor((elapsed - self._skew) * self.rate * (1 + 1e-12)) + 1

    @property
    def _readable(self) -> int:
        """Samples that can be read; of a pre-trigger acquisition none before it is complete."""
        if self._before is None:
            return min(self.acquired, self._done)
        complete = self._first is not None and self.acquired >= self._end
        return self._end - (self._first or 0) if complete else 0

    def trigger(self, time: float, fault: RunFault | None = None) -> None:
        """Accept an edge at a simulated time [s], which starts the samples.

        In a pre-trigger acquisition a later edge, with enough samples before it, decides which of
        them are kept. Other edges change nothing.
        """
        if self._first is not None or self.stopped:
            return
        if self.trigger_time is not None:
            edge = math.ceil((time - self.trigger_time) * self.rate * (1 - 1e-12))
            if self._paced:  # its time may have stopped, with the sample of this time taken
                edge = max(edge, self._done)
            self._edge = time
            if edge >= (self._before or 0):
                self._keep(edge - (self._before or 0), fault)
            return
        self.trigger_time = self._edge = time
        if self._before is None:
            self._keep(0, fault)
        else:
            self._end = self._before

    def _keep(self, first: int, fault: RunFault | None) -> None:
        """Keep the samples from one on, up to a fault."""
        self._first, self._fault = first, fault
        self._end = first + (self.n_samples if fault is None else min(fault.sample, self.n_samples))

    def feed(self, motions: Motions) -> None:
        """Store the motion of one controller sample."""
        if self.trigger_time is None or self.over:
            return
        self._time = float(motions.time[-1])
        if self._time < self.trigger_time:
            return
        self._fed.append(motions)
        last = ENDLESS if self._first is None else self._end
        self._done = min(last, self._converted(self._time - self.trigger_time))
        if self._paced and self._done - self._read_to > self._buffer:
            self._end = self._done  # as the driver: unread samples are not overwritten
        if self._first is None and len(self._fed) == 64:
            self._compute(self._done)
            self._drop(self._done - 1 - (self._before or 0))  # an edge now is at the last one

    def wait_for(self, n: int, timeout: float | None) -> int:
        """Return the number of readable samples, after waiting for n of them or timeout [s]."""
        with self._lock:
            self._requested.append(n)
            if n > self._goal:  # the clock may have stopped at the previous goal
                self._goal = n
                self._lock.notify_all()
            try:
                self._lock.wait_for(lambda: self._readable >= n or self._complete, timeout)
            finally:
                self._requested.remove(n)
            if self._fault is not None and self._done >= self._end and n > self._fault.sample:
                raise self._fault.error()
            return self._readable

    def read(self, first: int, n: int) -> Floats:
        """Return samples first to first + n of those kept [V], shape (n_channels, n).

        Earlier samples of an endless run are dropped.
        """
        with self._lock:
            first += self._first or 0
            stop = min(first + n, self._done)
            self._read_to = max(self._read_to, stop)
            if stop > self._computed:
                self._compute(stop)
            volts = self._volts[:, first - self._dropped : stop - self._dropped].copy()
            if self.n_samples == ENDLESS:
                self._drop(first)
            return volts

    def fail(self, error: Callable[[], Exception]) -> None:
        """End the acquisition now; a read of a later sample raises what ``error`` makes."""
        if not self.over:
            self._end = self._done
            if self._first is None:
                self._first = self._done  # no sample is kept without the edge
            self._fault = RunFault(self._done - self._first, error)

    def stop(self) -> None:
        """End the acquisition; harmless when it has ended."""
        with self._lock:
            self.stopped = True
            self._lock.notify_all()

    def _compute(self, stop: int) -> None:
        """Compute the samples from the last computed one to ``stop``."""
        self._feed_chains()
        first, room = self._computed, self._dropped + self._volts.shape[1]
        if stop > room:  # doubled, so that many small reads rarely copy a sample
            more = np.empty((len(self._chains), max(stop - room, self._volts.shape[1])))
            self._volts = np.concatenate([self._volts, more], axis=1)
        for row, chain in zip(self._volts, self._chains, strict=True):
            row[first - self._dropped : stop - self._dropped] = chain.volts(first, stop - first)
        self._computed = stop

    def _drop(self, first: int) -> None:
        """Drop the samples before one, if they are more than the rest."""
        if 2 * (first - self._dropped) > self._volts.shape[1]:
            self._volts = self._volts[:, first - self._dropped :].copy()
            self._dropped = first

    def _feed_chains(self) -> None:
        """Pass the stored motion to the sensors."""
        fed, self._fed = self._fed, []
        if not fed or self.trigger_time is None:
            return
        joined = (np.concatenate([getattr(m, f.name) for m in fed]) for f in fields(Motions))
        motions = Motions(*joined)
        times = motions.time - self.trigger_time
        for chain, source in self._parts:
            chain.input.extend(times, source(motions))


class RetriggeredRun(SampledRun):
    """Parts of equally many samples, one for each edge; their samples are counted together.

    An edge during a part is ignored. Arguments as of `SampledRun`; the setup's `per_trigger` is the
    length of a part.
    """

    def __init__(self, wiring: Wiring, setup: TaskSetup, number: int, rest: Motions | None = None):
        super().__init__(wiring, setup, number, rest)
        self._first = 0
        self._length = length = setup.per_trigger or 0
        self._of_each_part = wiring, replace(setup, n_samples=length, buffer=ENDLESS), number
        self._rest = rest
        self._runs: list[SampledRun] = []
        self._dropped_parts = 0

    @property
    def waiting_for_time(self) -> bool:
        if self._paced:
            return super().waiting_for_time
        return bool(self._runs) and self._runs[-1].waiting_for_time and not self.over

    @property
    def waiting_for_trigger(self) -> bool:
        """Whether an edge on the trigger's terminal would start a part."""
        between = not self._runs or self._runs[-1].over
        return between and not self.over and not self.unwired

    def trigger(self, time: float, fault: RunFault | None = None) -> None:
        """Start a part at a simulated time [s], unless one is being acquired."""
        if not self.waiting_for_trigger:
            return
        wiring, setup, number = self._of_each_part
        number += (self._dropped_parts + len(self._runs)) << 32
        self._runs.append(SampledRun(wiring, setup, number, self._rest))
        self._runs[-1].trigger(time)
        if fault is not None and fault.sample < self._length:
            self._end = self._done + fault.sample
            self._fault = RunFault(self._end, fault.error)

    def feed(self, motions: Motions) -> None:
        self._rest = motions
        if self._runs:
            self._runs[-1].feed(motions)
            before = (self._dropped_parts + len(self._runs) - 1) * self._length
            self._done = min(self._end, before + self._runs[-1]._done)

    def read(self, first: int, n: int) -> Floats:
        """Return samples first to first + n [V], shape (n_channels, n); drop earlier parts."""
        with self._lock:
            stop, pieces = min(first + n, self._done), [self._volts]
            drop = max(0, min(first // self._length - self._dropped_parts, len(self._runs) - 1))
            del self._runs[:drop]
            self._dropped_parts += drop
        while first < stop:
            part, at = divmod(first, self._length)
            count = min(self._length - at, stop - first)
            pieces.append(self._runs[part - self._dropped_parts].read(at, count))
            first += count
        return np.concatenate(pieces, axis=1)
