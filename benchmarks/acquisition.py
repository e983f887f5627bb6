"""Sixteen channels continuously, from a card in a process of its own; and what a press pays.

The card is paced by the clock on the wall, so that a client that is too slow loses samples.
"""

import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.figures import Figure, median_time
from sautereau.rig.acquisition import Daq
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig

if TYPE_CHECKING:
    from collections.abc import Iterator

    from sautereau.sim_backend.devices.daqmx.card import TaskSetup
    from sautereau.trajectory.motion import Floats

CHANNELS = 16
DURATION = 10.0
"""s, of the paced acquisition; what it costs does not grow with it, for the buffer is a ring."""
PERIOD = 2048
"""Samples, after which the card shows the same again."""


class PacedRun:
    """Samples that come with the clock on the wall."""

    def __init__(self, setup: "TaskSetup"):
        noise = np.random.default_rng(1).uniform(-4, 4, (len(setup.terminals), PERIOD))
        self._twice = np.concatenate([noise, noise], axis=1)
        self._rate, self._end = setup.rate, setup.n_samples
        self._begun = time.monotonic()
        self._stopped = False

    def wait_for(self, n: int, timeout: float) -> int:
        due = self._begun + n / self._rate
        time.sleep(min(max(0.0, due - time.monotonic()), timeout))
        return min(self._end, int((time.monotonic() - self._begun) * self._rate))

    def read(self, first: int, n: int) -> "Floats":
        begin = first % PERIOD
        return self._twice[:, begin : begin + n]

    def stop(self) -> None:
        self._stopped = True


class PacedCard:
    """A card of sixteen inputs that waits for nobody."""

    name = "Dev1"
    terminals = tuple(f"ai{n}" for n in range(CHANNELS))
    paced = True

    def start(self, setup: "TaskSetup") -> PacedRun:
        return PacedRun(setup)


def run() -> list[Figure]:
    """Return the client's share of a core, and what connecting and closing costs a press."""
    with _served() as address:
        rig = _rig(address)
        return [*_continuous(rig), _overhead(rig.daq)]


def _continuous(rig: Rig) -> list[Figure]:
    """Read with and without recording; an overrun would end it with an error."""
    from sautereau.daq.source.acquisition import Acquisition
    from sautereau.daq.source.continuous import record

    n = int(DURATION * rig.daq.sample_rate)
    with Acquisition(rig.daq, None, triggered=False) as acquisition:
        acquisition.start()
        blocks = acquisition.blocks()
        next(blocks)
        begun, busy, count = time.perf_counter(), time.process_time(), 0
        while count < n:
            count += next(blocks).volts.shape[1]
        busy = time.process_time() - busy
        elapsed = time.perf_counter() - begun
    assert elapsed > 0.9 * DURATION
    read = busy / elapsed
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.mcap"
        begun, busy = time.perf_counter(), time.process_time()
        assert record(rig, path, DURATION) == n
        recorded = (time.process_time() - busy) / (time.perf_counter() - begun)
    what = f"{CHANNELS} channels at 51.2 kHz, {DURATION:g} s paced, of one core:"
    return [
        Figure(f"{what} reading", read * 100, "%", "limit", 40.0),
        Figure(f"{what} reading and recording", recorded * 100, "%", "limit", 40.0),
    ]


def _overhead(daq: Daq) -> Figure:
    """Enter and leave an acquisition of the two channels of a press.

    The peer asks grpc whether the channel is ready: closing it then waits for a polling thread.
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

    took, peer = median_time(enter_and_leave) * 1e3, median_time(ask_and_close) * 1e3
    what = "a press's task: connect, build, clear, close"
    return Figure(what, took, "ms", "channel_ready_future and close", peer)


def _rig(address: str) -> Rig:
    rig = load_rig()
    channels = tuple(
        rig.daq.channels[n % 2].model_copy(update={"name": f"c{n}", "terminal": f"ai{n}"})
        for n in range(CHANNELS)
    )
    values = {"address": address, "channels": channels, "block": PERIOD}
    return rig.model_copy(update={"daq": rig.daq.model_copy(update=values)})


@contextmanager
def _served() -> "Iterator[str]":
    """Serve the card from another process, so that its work is not counted."""
    with subprocess.Popen(
        [sys.executable, "-m", "benchmarks.acquisition"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.terminate()


def _serve() -> None:
    from sautereau.sim_backend.devices.daqmx.server import serve

    with serve(PacedCard()) as server:
        sys.stdout.write(f"{server.address}\n")
        sys.stdout.flush()
        sys.stdin.read()


if __name__ == "__main__":
    _serve()
