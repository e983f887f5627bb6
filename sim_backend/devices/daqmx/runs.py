"""An acquisition on the simulated card: armed, triggered, sampled as far as it is read."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.sim_backend.devices.daqmx.card import ENDLESS
from sautereau.sim_backend.fair_lock import Turns
from sautereau.sim_backend.faults.sensing import disturbances
from sautereau.sim_backend.faults.tables import Faults
from sautereau.sim_backend.parts import Sensors
from sautereau.sim_backend.physics.events import Motions
from sautereau.sim_backend.sensors import SensorChain
from sautereau.trajectory.motion import Floats

AHEAD = 10_000
"""Samples, by which time goes on for a continuous acquisition before somebody reads them."""


@dataclass(frozen=True)
class RunFault:
    """An end of an acquisition before its time."""

    sample: int
    """Number of the first sample that does not come."""
    strike: Callable[[], Exception]
    """Makes what a read of it, or of a later one, raises."""


class SampledRun:
    """Samples of the bench; they are computed when somebody reads them.

    Args:
        rig: The bench as it is wired, with its sensors' charts.
        terminals: Which inputs, in order.
        rate: Hz.
        n_samples: Samples of each channel.
        sensors: What the sensors add to the truth.
        seed: Of the noise.
        number: Of the run, so that each has a noise of its own.
        rest: Force of the finger before the trigger [N].
        turns: Notified whenever somebody's samples are there; guards the bench.
        faults: What goes wrong in the sensors.
    """

    def __init__(
        self,
        rig: Rig,
        terminals: tuple[str, ...],
        rate: float,
        n_samples: int,
        sensors: Sensors | None,
        seed: int,
        number: int,
        rest: float,
        turns: Turns,
        faults: Faults | None = None,
    ):
        self.n_samples = n_samples
        self.rate = rate
        self.trigger_time: float | None = None
        """s on the world's clock."""
        self.stopped = False
        self.unwired = False
        """Whether it waits for a terminal to which nothing is wired."""
        self._fault: RunFault | None = None
        self._end = n_samples
        self._laser_arm = rig.key.laser_arm
        self._turns = turns
        by_terminal = {channel.terminal: channel for channel in rig.daq.channels}
        self._chains = [
            SensorChain(
                channel := by_terminal[name],
                sensors,
                rate,
                rest if channel.quantity == "force" else 0.0,
                np.random.default_rng([seed, number, i]),
                disturbances(faults, channel.quantity, seed, number, i),
            )
            for i, name in enumerate(terminals)
        ]
        self._fed: list[tuple[Motions, Sequence[float]]] = []
        self._volts = np.empty((len(terminals), 0))
        self._computed = self._done = 0
        self._wanted: list[int] = []
        self._wished = n_samples if n_samples < ENDLESS else 0

    @property
    def waiting_for_time(self) -> bool:
        """Whether samples will come as soon as time goes on."""
        end = min(self._end, self._wished + AHEAD)
        return self.trigger_time is not None and self._done < end and not self.stopped

    @property
    def waiting_for_trigger(self) -> bool:
        """Whether an edge on the trigger's terminal would start it."""
        return self.trigger_time is None and not self.stopped and not self.unwired

    @property
    def over(self) -> bool:
        """Whether no sample will come any more."""
        return self.stopped or self._done >= self._end

    @property
    def due(self) -> bool:
        """Whether somebody waits for samples that are there."""
        return bool(self._wanted) and min(self._wanted) <= self._shown

    @property
    def _shown(self) -> int:
        """Samples that a read can have."""
        return self._done

    @property
    def _last(self) -> int:
        """Samples after which no more are taken."""
        return self._end

    def trigger(self, time: float, fault: RunFault | None = None) -> None:
        """Begin at a moment [s] of the world's clock; a second edge changes nothing."""
        if self.trigger_time is None and not self.stopped:
            self.trigger_time = time
            self._fault = fault
            self._end = self.n_samples if fault is None else min(fault.sample, self.n_samples)

    def feed(self, motions: Motions, jumps: Sequence[float] = ()) -> None:
        """Note what happened in one controller sample.

        Args:
            motions: What happened.
            jumps: s on the world's clock, at which the finger's force jumped meanwhile.
        """
        if self.trigger_time is None or self.over:
            return
        self._fed.append((motions, jumps))
        elapsed = float(motions.time[-1]) - self.trigger_time
        self._done = min(self._last, int(elapsed * self.rate * (1 + 1e-12)) + 1)

    def wait_for(self, n: int, timeout: float | None) -> int:
        """Return the samples now there, after waiting for n of them or timeout [s]."""
        with self._turns:
            self._wanted.append(n)
            if n > self._wished:  # for which a clock that had gone far enough must go on
                self._wished = n
                self._turns.notify_all()
            try:
                self._turns.wait_for(lambda: self._shown >= n or self.over, timeout)
            finally:
                self._wanted.remove(n)
            if self._fault is not None and self._done >= self._end and n > self._fault.sample:
                raise self._fault.strike()
            return self._shown

    def read(self, first: int, n: int) -> Floats:
        """Return samples first to first + n [V], shape (n_channels, n)."""
        with self._turns:
            stop = min(first + n, self._done)
            if stop > self._computed:
                self._compute(stop)
            return self._volts[:, first:stop].copy()

    def fail(self, strike: Callable[[], Exception]) -> None:
        """End the acquisition where it is; whoever waits for more is raised what this makes."""
        if not self.over:
            self._end = self._done
            self._fault = RunFault(self._done, strike)

    def stop(self) -> None:
        """End the acquisition; harmless when it has ended."""
        with self._turns:
            self.stopped = True
            self._turns.notify_all()

    def _compute(self, stop: int) -> None:
        """Let the sensors show the samples from the last computed one to ``stop``."""
        self._hand_over()
        first, room = self._computed, self._volts.shape[1]
        if stop > room:  # doubled, so that many small reads copy no sample often
            more = np.empty((len(self._chains), max(stop - room, room)))
            self._volts = np.concatenate([self._volts, more], axis=1)
        for row, chain in zip(self._volts, self._chains, strict=True):
            row[first:stop] = chain.volts(first, stop - first)
        self._computed = stop

    def _hand_over(self) -> None:
        """Give what was noted to the sensors."""
        fed, self._fed = self._fed, []
        if not fed or self.trigger_time is None:
            return
        times = np.concatenate([motions.time for motions, _ in fed]) - self.trigger_time
        jumps = [jump - self.trigger_time for _, jumps in fed for jump in jumps]
        for chain in self._chains:
            if chain.channel.quantity == "force":
                force = np.concatenate([motions.finger_force for motions, _ in fed])
                chain.input.extend(times, force, jumps)
            else:
                spin = np.concatenate([motions.angular_velocity for motions, _ in fed])
                chain.input.extend(times, spin * self._laser_arm, ())
