"""Long runs: memory, open files, threads and processor time at their start and at their end.

A session on the stand-in in this process, an acquisition from a card in another, which does not
wait for real time, and a campaign of copies. Linux only: it reads /proc.

`python -m benchmarks.load 100000` measures the campaign alone, of as many recordings.
"""

import itertools
import os
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from benchmarks.acquisition import served
from benchmarks.campaign import write_presses
from benchmarks.figures import Figure, check, table
from benchmarks.recording import INDEX, memory
from sautereau.analysis.campaign.run import run_campaign
from sautereau.daq.source.continuous import record
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.progress import progress_to
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.experiment.session import Item, make_presses
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.press import plan_press

PRESSES = 1000
HOURS, RATE = 8.0, 250
"""Of the acquisition, in the card's time; Hz: ten reads per second, the fewest allowed."""
RECORDINGS = 10_000
NOTES = 1000
WARM = 0.1  # Dimensionless fraction of a run after which its start is measured
GROWTH, SLOWER = 30.0, 1.3
"""Limits: MiB by which the memory grows; dimensionless, by which a press takes longer."""
ROW = 2 / 1024
"""Limit: MiB by which the memory grows with each recording of a campaign, a row of its table."""
MORE = 3  # Limit of the growth of open files and threads: gRPC starts and ends some of its own
BARE = {"plectrum": "none", "string": "none", "friction": False, "felt": False, "step": 1e-3}


@dataclass(frozen=True)
class Use:
    """What this process uses."""

    done: int
    memory: float
    """MiB."""
    files: int
    threads: int
    time: float
    """s, of the processor."""
    fixed: float
    """s, of the processor, of a fixed computation at each note: the same work takes up to a third
    longer while other programs use the machine."""


class Watch:
    """Notes what a run uses, at most `NOTES` times: many notes would be what grows."""

    def __init__(self, total: int) -> None:
        self._total, self._uses, self._fixed = total, list[Use](), 0.0

    def __call__(self, done: int) -> None:
        if self._uses and done * NOTES // self._total == self._uses[-1].done * NOTES // self._total:
            return
        folder = Path("/proc/self")
        files, threads = (len(os.listdir(folder / name)) for name in ("fd", "task"))  # noqa: PTH208
        self._fixed += _fixed_work()
        spent = time.process_time() - self._fixed
        self._uses.append(Use(done, memory("VmRSS"), files, threads, spent, self._fixed))

    def figures(self, what: str, unit: str, growth: float = GROWTH) -> list[Figure]:
        """Compare the tenth after the start with the last tenth."""
        uses, n = self._uses, len(self._uses)
        last = uses[-1]
        check(last.done == self._total, f"{what}: {last.done} of {self._total} are done")
        tenth = int(WARM * n)
        warm, second, near = uses[tenth], uses[2 * tenth], uses[-1 - tenth]
        spans = ((warm, second), (near, last))
        start, end = [1e3 * (b.time - a.time) / (b.done - a.done) for a, b in spans]
        slower = (last.fixed - near.fixed) / (second.fixed - warm.fixed)
        pace = f"{what}: processor time of {unit} at the end, at the speed of the start"
        return [
            Figure(f"{what}: memory grows by", last.memory - warm.memory, "MiB", "limit", growth),
            Figure(f"{what}: open files at the end", last.files, "", "limit", warm.files + MORE),
            Figure(f"{what}: threads at the end", last.threads, "", "limit", warm.threads + MORE),
            Figure(pace, end / slower, "ms", "limit", SLOWER * start),
        ]


def _fixed_work() -> float:
    """Return the processor time of a computation that is always the same, s."""
    start = time.thread_time()
    found = {number % 997: str(number) for number in range(15_000)}
    check(len(found) == 997, "the fixed computation is wrong")
    return time.thread_time() - start


def run() -> list[Figure]:
    """Return what long runs use at their end, limited by their start."""
    with tempfile.TemporaryDirectory() as name:
        return [
            *_session(Path(name)),
            *_acquisition(Path(name)),
            *_campaign(Path(name), RECORDINGS),
        ]


def _session(folder: Path) -> list[Figure]:
    watch, made = Watch(PRESSES), itertools.count(1)
    rig = with_values(load_rig(), {"controller.timeout": "20 s", "arm.approach_speed": "5 rad/s"})
    scene = load_scene("ideal").model_copy(update=BARE)
    with StandIn(rig, scene) as stand_in:
        rig, out = stand_in.rig, folder / "session"
        items = [Item(rig, plan_press(rig))] * PRESSES
        make_presses(GalilController(rig), out, items, on_press=lambda *_: watch(next(made)))
    return watch.figures(f"session of {PRESSES} presses", "a press")


def _acquisition(folder: Path) -> list[Figure]:
    watch = Watch(round(HOURS * 3600 * RATE))
    with served("free") as address:
        changes = {"address": address, "sample_rate": float(RATE), "block": RATE // 10}
        rig = load_rig().replaced({f"daq.{name}": value for name, value in changes.items()})
        record(rig, folder / "long.mcap", HOURS * 3600, on_block=watch)
    return watch.figures(f"acquisition of {HOURS:g} h at {RATE} Hz", "a sample", HOURS * INDEX)


def _campaign(folder: Path, total: int) -> list[Figure]:
    watch = Watch(total)
    made = write_presses(folder / "recordings", 2, 2, 5)
    for number in range(len(made), total):
        path = made[number % len(made)]
        path.with_name(f"{path.stem}-{number}.mcap").hardlink_to(path)
    with progress_to(lambda fraction: watch(round(fraction * total))):
        run_campaign(folder / "recordings", folder / "table.parquet")
    return watch.figures(f"campaign of {total} recordings", "a recording", max(GROWTH, total * ROW))


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        print(table("Load", _campaign(Path(name), int(sys.argv[1]))))
