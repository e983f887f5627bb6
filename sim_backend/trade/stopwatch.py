"""How long an engine takes for a drive, its world's building left out."""

import statistics
import time

from sautereau.rig.schema import Rig
from sautereau.sim_backend.physics.drive import Drive
from sautereau.sim_backend.physics.finger import Reference
from sautereau.sim_backend.physics.observation import Observation, observe
from sautereau.sim_backend.scene import Scene

RUNS = (3, 99)
"""Runs of which the median counts, at least and at most."""
ENOUGH = 0.3
"""s, of runs after which there are no more."""


class Stopwatch:
    """A drive that notes when it was first asked, which is when the world has been built."""

    def __init__(self, drive: Drive):
        self.start = drive.start
        self.samples = drive.samples
        self.begun: float | None = None
        """s of the clock on the wall; None before."""
        self._drive = drive

    def reference(self, sample: int) -> Reference:
        """Return the drive's own reference."""
        if self.begun is None:
            self.begun = time.perf_counter()
        return self._drive.reference(sample)


def timed(rig: Rig, scene: Scene, drive: Drive) -> tuple[Observation, float]:
    """Return what happens in a drive, and the median of simulated over real time.

    Args:
        rig: The nominal bench.
        scene: With its step and engine settled.
        drive: What is played.

    Raises:
        SceneError: The scene cannot be simulated.
    """
    simulated = drive.samples * rig.controller.sample_period
    least, most = RUNS
    times: list[float] = []
    while True:
        watch = Stopwatch(drive)
        found = observe(rig, scene, watch)
        ended = time.perf_counter()
        times.append(ended - (ended if watch.begun is None else watch.begun))
        if len(times) == most or (len(times) >= least and sum(times) > ENOUGH):
            return found, simulated / max(statistics.median(times), 1e-9)
