"""Campaigns: thousands of recordings on both cores and on a cluster, and their touch.

Presses are simulated in this process and written by the recorder; beyond `MADE` they are copies,
which take a campaign the same time. Three files of the folder are bad. A cluster loses a worker
half-way, and another one has a worker of another version.

`python -m benchmarks.campaign 3000 100` measures as many recordings, 100 of them different.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from distributed import Client, LocalCluster

from benchmarks.figures import Figure, check, table, timed
from benchmarks.simulated import acquired
from sautereau.analysis.campaign.run import run_campaign
from sautereau.analysis.campaign.table import read_campaign
from sautereau.analysis.campaign.touch import find_touch
from sautereau.analysis.errors import AnalysisError
from sautereau.daq.file.recorded import Block
from sautereau.daq.file.recording import Recording
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.progress import progress_to
from sautereau.rig.schema import Rig
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.scene import Scene, load_scene

RECORDINGS = 5000
MADE = 250  # Number of different recordings
FEW = 300  # Recordings, of which one takes as long as one of all
SAME = 1.15  # Limit: processor time of a recording of all, as a multiple of that of `FEW`
LOST = "a cluster of two that loses a worker"
PLECTRA, SESSIONS = 10, 5
PROCESSES = 2
LIMIT = 60.0  # s, limit of the time for all recordings on two cores
SET_UP = 0.02  # 1, relative standard deviation of the overlap between set-ups
CUTS = (0.42e-3, 0.54e-3), (0.22e-3, 0.32e-3)  # m, ranges of the plectra's thickness and overlap


OTHER = """
from sautereau.analysis.campaign import workers
workers.computed_by = lambda: "0.1 (code 123), numpy 1"
"""
"""Preloaded by a worker, it makes its version another one."""


def run(recordings: int = RECORDINGS, made: int = MADE) -> list[Figure]:
    """Return times of a campaign here and on clusters, and check that the tables are equal."""
    with tempfile.TemporaryDirectory() as name:
        place, folder = Path(name), Path(name) / "recordings"
        paths = write_presses(folder, PLECTRA, SESSIONS, made // (PLECTRA * SESSIONS))
        copy_presses(paths, recordings)
        bad = spoil(folder, paths[0])
        times = {}
        times["two cores"], _ = timed(run_campaign, folder, place / "two cores.parquet", PROCESSES)
        here = read_campaign(place / "two cores.parquet")
        faulty = [fault.source.path for fault in here.faults]
        check(
            len(here.table) == recordings and faulty == bad,
            f"{len(here.table)} of {recordings} recordings are in the table, and of {bad} {faulty}",
        )
        for what, killed in ("a cluster of two", False), (LOST, True):
            with cluster(PROCESSES) as (address, workers), progress_to(killing(workers[:killed])):
                out = place / f"{what}.parquet"
                times[what], _ = timed(run_campaign, folder, out, address)
            there = read_campaign(out)
            check(there.table.equals(here.table), f"the table of {what} differs")
            check(there.faults == here.faults, f"{what} has other faults: {there.faults}")
        check_mixed(folder, place)
        costs = [cost(folder, place, most) for most in (8, FEW, recordings)]  # 8 to import all
        again, _ = timed(run_campaign, folder, here.path, PROCESSES)
        touch, _ = timed(find_touch, here)
    reading, (_, few, many) = times["two cores"], costs
    figures = [
        Figure(f"{recordings} recordings, {what}", seconds, "s", "limit", LIMIT)
        for what, seconds in times.items()
        if what != LOST
    ]
    return [
        *figures,
        Figure(f"{recordings} recordings, {LOST}", times[LOST], "s", "two cores", reading),
        Figure("the same, once read", again, "s", "reading them", reading),
        Figure("touch of these presses", touch, "s", "reading them", reading),
        Figure("processor time of a recording", 1e3 * many, "ms", "limit", 1e3 * few * SAME),
    ]


def spoil(folder: Path, path: Path) -> list[str]:
    """Add three files that are no good recordings; return their names."""
    whole = path.read_bytes()
    changed = bytearray(whole)
    changed[len(whole) // 2] ^= 0xFF
    bad = {"changed.mcap": bytes(changed), "empty.mcap": b"", "foreign.mcap": b"t,v\n0,1\n" * 99}
    for name, content in bad.items():
        (folder / name).write_bytes(content)
    return sorted(bad)


def killing(processes: list[subprocess.Popen[bytes]]) -> Callable[[float], None]:
    """Return what kills these processes when half of the work is done."""

    def watch(fraction: float) -> None:
        for process in processes:
            if fraction >= 0.5 and process.poll() is None:
                process.kill()

    return watch


def check_mixed(folder: Path, place: Path) -> None:
    """Check that a cluster with a worker of another version is refused, and writes no table."""
    (place / "other.py").write_text(OTHER)
    out = place / "mixed.parquet"
    with cluster(PROCESSES, "--preload", str(place / "other.py")) as (address, _):
        with Client(address, set_as_default=False) as client:
            client.wait_for_workers(PROCESSES, timeout=600)
        try:
            run_campaign(folder, out, address)
            said = "nothing"
        except AnalysisError as error:
            said = str(error)
    check("0.1 (code 123)" in said and not out.exists(), f"a mixed cluster: {said}")


def cost(folder: Path, place: Path, most: int) -> float:
    """Return the processor time per recording of a campaign of some of them, in one process, s."""
    some = place / f"{most}"
    for path in sorted(folder.rglob("press-*.mcap"))[:most]:
        linked = some / path.relative_to(folder)
        linked.parent.mkdir(parents=True, exist_ok=True)
        linked.hardlink_to(path)
    start = time.process_time()
    run_campaign(some, some / "table.parquet")
    return (time.process_time() - start) / most


def write_presses(folder: Path, plectra: int, sessions: int, presses: int) -> list[Path]:
    """Simulate and record presses of different plectra, with a new set-up in each session.

    Args:
        folder: Gets one subfolder per session.
        plectra: Number of plectra, which differ in thickness and overlap.
        sessions: Number of sessions of each plectrum.
        presses: Number of presses of each session.
    """
    random = np.random.default_rng(0)
    scene = load_scene("ideal").model_copy(update={"sensors": load_scene("paper").sensors})
    paths = []
    for plectrum in range(plectra):
        thickness, overlap = (random.uniform(*ends) for ends in CUTS)
        cut = {"plectrum.thickness": f"{thickness} m", "plectrum.overlap": f"{overlap} m"}
        rig = with_values(load_rig(), cut)
        for session in range(sessions):
            truth = {"plectrum.overlap": f"{overlap * (1 + random.normal(0, SET_UP))} m"}
            place = folder / f"plectrum-{plectrum + 1:02}-session-{session + 1}"
            place.mkdir(parents=True)
            set_up = scene.model_copy(update={"truth": truth})
            paths += write_session(place, rig, set_up, presses, int(random.integers(2**31)))
    return paths


def write_session(folder: Path, rig: Rig, scene: Scene, presses: int, seed: int) -> Iterator[Path]:
    """Record presses of one set-up, which differ by their noise; yield their paths."""
    seen = observe(rig, scene)
    for press in range(1, presses + 1):
        recorded, _ = acquired(rig, scene, seen, seed + press)
        path = folder / f"press-{press:04}.mcap"
        info = replace(
            recorded.session,
            press=press,
            started=f"2026-01-01T00:{press % 60:02}:00Z",
            session=folder.name,
        )
        with Recording(path, recorded.rig, session=info) as recording:
            recording.write_block(Block(0, np.stack(list(recorded.volts.values()))))
        yield path


def copy_presses(paths: list[Path], total: int) -> None:
    """Copy recordings into their folders until there are `total` of them."""
    for number in range(len(paths), total):
        path = paths[number % len(paths)]
        shutil.copy(path, path.with_name(f"{path.stem}-{number // len(paths)}.mcap"))


@contextmanager
def cluster(workers: int, *options: str) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Yield the address of a Dask scheduler on this machine, and the processes of its workers.

    Args:
        options: Further ones of the last worker.
    """
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])}
    with LocalCluster(n_workers=0, processes=True, dashboard_address=":0") as served:
        address = served.scheduler_address
        words = [sys.executable, "-m", "dask", "worker", address]
        words += ["--nthreads", "1", "--no-nanny", "--no-dashboard"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment}
        commands = [words] * (workers - 1) + [[*words, *options]] * (workers > 0)
        processes = [subprocess.Popen(command, **quiet) for command in commands]
        try:
            yield address, processes
        finally:
            for process in processes:
                process.terminate()
                process.wait()


if __name__ == "__main__":
    print(table("Campaigns", run(*map(int, sys.argv[1:]))))
