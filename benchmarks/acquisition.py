"""CPU time of acquiring sixteen channels continuously, and the overhead of a press.

The card runs in its own process and in real time, so that a slow client loses samples.
"""

import math
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from benchmarks.figures import Figure, check, median_time
from benchmarks.recording import SIXTEEN, sixteen
from sautereau.rig.acquisition import Daq
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.schema import Rig
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.device_types import IDEAL
from sautereau.sim_backend.devices.daqmx.card import Module, TaskSetup
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.motion import Floats

DURATION = 10.0  # Duration of the acquisition in real time, s; the cost does not depend on it
EDGES = 100  # Edges that are dated
PERIOD = 2048  # Samples after which the card's signal repeats


class PacedRun:
    """Samples in real time."""

    def __init__(self, setup: TaskSetup):
        noise = np.random.default_rng(1).uniform(-4, 4, (len(setup.terminals), PERIOD))
        self._twice = np.concatenate([noise, noise], axis=1)
        self._rate, self._end = setup.rate, setup.n_samples
        self._start = time.monotonic()

    def wait_for(self, n: int, timeout: float) -> int:
        due = self._start + n / self._rate
        time.sleep(min(max(0.0, due - time.monotonic()), timeout))
        return min(self._end, int((time.monotonic() - self._start) * self._rate))

    def read(self, first: int, n: int) -> Floats:
        begin = first % PERIOD
        return self._twice[:, begin : begin + n]

    @property
    def acquired(self) -> int:
        return self.wait_for(0, 0.0)

    def stop(self) -> None:
        """Do nothing: nothing runs between two calls."""


class FreeRun(PacedRun):
    """Samples as soon as they are requested."""

    def wait_for(self, n: int, timeout: float) -> int:
        return min(self._end, n)


class Card:
    """A card with sixteen inputs, in real time or not."""

    modules = (Module("Dev1", IDEAL, tuple(f"ai{n}" for n in range(SIXTEEN))),)

    def __init__(self, paced: bool):
        self.paced = paced

    def check(self) -> None:
        """It stays connected."""

    def start(self, setup: TaskSetup) -> PacedRun:
        return (PacedRun if self.paced else FreeRun)(setup)


def run() -> list[Figure]:
    """Return the client's CPU load, and the time to connect and close for a press."""
    with served() as address:
        rig = sixteen(load_rig()).replaced({"daq.address": address, "daq.block": PERIOD})
        figures = [*_continuous(rig), _dated(rig), _overhead(rig.daq)]
    return [*figures, *_edges(0.0), *_edges(0.05)]


def _continuous(rig: Rig) -> list[Figure]:
    """Read with and without recording; an overrun would raise an error."""
    from sautereau.daq.source.acquisition import Acquisition
    from sautereau.daq.source.continuous import record

    n = int(DURATION * rig.daq.sample_rate)
    with Acquisition(rig.daq, None, triggered=False) as acquisition:
        acquisition.start()
        blocks = acquisition.blocks()
        next(blocks)
        start, busy, count = time.perf_counter(), time.process_time(), 0
        while count < n:
            count += next(blocks).volts.shape[1]
        busy = time.process_time() - busy
        elapsed = time.perf_counter() - start
    check(elapsed > 0.9 * DURATION, f"{DURATION:g} s were acquired in {elapsed:.3g} s")
    read = busy / elapsed
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.mcap"
        start, busy = time.perf_counter(), time.process_time()
        written = record(rig, path, DURATION)
        check(written == n, f"{written} of {n} samples are recorded")
        recorded = (time.process_time() - busy) / (time.perf_counter() - start)
    what = f"{SIXTEEN} channels at 51.2 kHz, {DURATION:g} s in real time, of one core:"
    return [
        Figure(f"{what} reading", read * 100, "%", "limit", 40.0),
        Figure(f"{what} reading and recording", recorded * 100, "%", "limit", 40.0),
    ]


def _dated(rig: Rig) -> Figure:
    """Date the start of a recording by its samples; the card starts them between two calls."""
    from sautereau.daq.file.reading import read_recording
    from sautereau.daq.source.continuous import record

    with tempfile.TemporaryDirectory() as folder:
        stds: list[float] = []
        for number in range(5):
            path = Path(folder) / f"{number}.mcap"
            record(rig, path, 0.5)
            stds.append(read_recording(path).t0_std or math.inf)
    return Figure(
        "date of the first sample, uncertainty", statistics.median(stds) * 1e3, "ms", "limit", 1.0
    )


def _edges(before: float) -> Iterator[Figure]:
    """Date the edges of the stand-in in real time, with ``before`` s of samples before them."""
    from sautereau.daq.file.reading import read_recording
    from sautereau.daq.file.recorded import SessionInfo
    from sautereau.daq.file.recording import Recording
    from sautereau.daq.source.acquisition import Acquisition

    found: list[tuple[float, float]] = []
    wanted = with_values(load_rig(), {"daq.pre_trigger": f"{before} s"})
    with (
        StandIn(wanted, load_scene("ideal"), paced=True) as stand_in,
        tempfile.TemporaryDirectory() as folder,
    ):
        rig, bench, raised = stand_in.rig, stand_in.bench, bench_edges(stand_in)
        output = rig.controller.trigger_output
        session = SessionInfo(1, datetime.now(UTC).isoformat(), True, "", "")
        for number in range(EDGES):
            bench.receive(f"CB {output}\r".encode())
            path = Path(folder) / f"{number}.mcap"
            with (
                Acquisition(rig.daq, 0.1) as source,
                Recording(path, rig, session=session, scaling=source.scaling) as recording,
            ):
                source.start()
                threading.Timer(0.1, bench.receive, [f"SB {output}\r".encode()]).start()
                for block in source.blocks():
                    recording.write_block(block)
            read = read_recording(path)
            found.append((abs(read.t0_ns / 1e9 - raised[-1]), read.t0_std or math.inf))
    what = f"date of {EDGES} edges with {before:g} s before them:"
    inside = sum(error <= 1.96 * std for error, std in found) / EDGES * 100
    check(inside >= 95, f"{what} {inside:g} % are within their stated 95 %")
    median = statistics.median(error for error, _ in found) * 1e3
    yield Figure(f"{what} median error", median, "ms", "limit", 2.0)


def bench_edges(stand_in: StandIn) -> list[float]:
    """Return a list that receives the dates of a stand-in's edges, s since 1970."""
    card, dates = stand_in.bench.card, list[float]()
    edge = card.edge

    def note(delay: float = 0.0, *, falling: bool = False) -> None:
        now, before = time.time() + delay, len(card.starts)
        edge(delay, falling=falling)
        dates.extend([now] * (len(card.starts) - before))

    card.edge = note
    return dates


def _overhead(daq: Daq) -> Figure:
    """Enter and leave an acquisition of the two channels of a press.

    The peer waits for grpc's `channel_ready_future`: closing then waits for a polling thread.
    """
    import grpc

    from sautereau.daq.source.acquisition import Acquisition

    two = daq.model_copy(update={"channels": daq.channels[:2]})

    def enter_and_leave() -> None:
        with Acquisition(two, 0.5):
            pass

    def ask_and_close() -> None:
        with grpc.insecure_channel(daq.address) as channel:
            grpc.channel_ready_future(channel).result()

    own, peer = median_time(enter_and_leave) * 1e3, median_time(ask_and_close) * 1e3
    what = "a press's task: connect, build, clear, close"
    return Figure(what, own, "ms", "channel_ready_future and close", peer)


@contextmanager
def served(pace: str = "paced") -> Iterator[str]:
    """Serve the card, "paced" or "free", from another process, whose CPU time is not counted."""
    with subprocess.Popen(
        [sys.executable, "-m", "benchmarks.acquisition", pace],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            yield process.stdout.readline().strip() if process.stdout else ""
        finally:
            process.terminate()


def _serve() -> None:
    from sautereau.sim_backend.devices.daqmx.server import DaqmxServer

    with DaqmxServer(Card(sys.argv[1:] == ["paced"])) as server:
        sys.stdout.write(f"{server.address}\n")
        sys.stdout.flush()
        sys.stdin.read()


if __name__ == "__main__":
    _serve()
