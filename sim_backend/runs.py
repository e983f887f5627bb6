"""An acquisition on the simulated card: armed, triggered, sampled as time goes on."""

import threading

import numpy as np

from rig.schema import Rig
from sim_backend.scene import Sensors
from sim_backend.sensors import SensorChain
from sim_backend.world import Motions
from trajectory.motion import Floats


class SampledRun:
    """Samples of the bench, a whole controller sample's worth at a time.

    Args:
        rig: The bench as it is wired, with its sensors' charts.
        terminals: Which inputs, in order.
        rate: Hz.
        n_samples: Samples of each channel.
        sensors: What the sensors add to the truth.
        seed: Of the noise.
        rest: Force of the finger before the trigger [N].
        changed: Notified whenever there are more samples; its lock guards the bench.
    """

    def __init__(
        self,
        rig: Rig,
        terminals: tuple[str, ...],
        rate: float,
        n_samples: int,
        sensors: Sensors | None,
        seed: tuple[int, ...],
        rest: float,
        changed: threading.Condition,
    ):
        self.n_samples = n_samples
        self.rate = rate
        self.trigger_time: float | None = None
        """s on the world's clock."""
        self.stopped = False
        self.unwired = False
        """Whether it waits for a terminal to which nothing is wired."""
        self._laser_arm = rig.key.laser_arm
        self._changed = changed
        by_terminal = {channel.terminal: channel for channel in rig.daq.channels}
        self._chains = [
            SensorChain(
                by_terminal[name],
                sensors,
                rate,
                rest if by_terminal[name].quantity == "force" else 0.0,
                np.random.default_rng([*seed, i]),
            )
            for i, name in enumerate(terminals)
        ]
        self._blocks: list[Floats] = [np.empty((len(terminals), 0))]
        self._done = 0

    @property
    def waiting_for_time(self) -> bool:
        """Whether samples will come as soon as time goes on."""
        return self.trigger_time is not None and self._done < self.n_samples and not self.stopped

    def trigger(self, time: float) -> None:
        """Begin at a moment [s] of the world's clock; a second edge changes nothing."""
        if self.trigger_time is None and not self.stopped:
            self.trigger_time = time

    def feed(self, motions: Motions, releases: list[float]) -> None:
        """Sample what happened in one controller sample.

        Args:
            motions: What happened.
            releases: s on the world's clock, when strings were let go meanwhile.
        """
        if not self.waiting_for_time or self.trigger_time is None:
            return
        times = motions.time - self.trigger_time
        jumps = [release - self.trigger_time for release in releases]
        available = min(self.n_samples, int(times[-1] * self.rate * (1 + 1e-12)) + 1)
        columns = []
        for chain in self._chains:
            if chain.channel.quantity == "force":
                chain.input.extend(times, motions.finger_force, jumps)
            else:
                chain.input.extend(times, motions.spin * self._laser_arm, [])
            columns.append(chain.volts(self._done, available - self._done))
        self._blocks.append(np.array(columns))
        self._done = available

    def wait_for(self, n: int, timeout: float) -> int:
        """Return the samples now there, after waiting for n of them or timeout [s]."""
        with self._changed:
            self._changed.wait_for(lambda: self._done >= n or self.stopped, timeout)
            return self._done

    def read(self, first: int, n: int) -> Floats:
        """Return samples first to first + n [V], shape (n_channels, n)."""
        with self._changed:
            if len(self._blocks) > 1:
                self._blocks = [np.concatenate(self._blocks, axis=1)]
            return self._blocks[0][:, first : first + n].copy()

    def stop(self) -> None:
        """End the acquisition; harmless when it has ended."""
        with self._changed:
            self.stopped = True
            self._changed.notify_all()
