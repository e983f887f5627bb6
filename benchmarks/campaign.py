"""Campaigns: thousands of recordings on both cores and on a cluster, and their touch.

Presses are simulated in this process and written by the recorder; beyond `MADE` they are copies,
which take a campaign the same time.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.figures import Figure, check, timed
from benchmarks.simulated import acquired
from sautereau.analysis.campaign.run import run_campaign
from sautereau.analysis.campaign.table import read_campaign
from sautereau.analysis.campaign.touch import find_touch
from sautereau.daq.file.recorded import Block
from sautereau.daq.file.recording import Recording
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.schema import Rig
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.scene import Scene, load_scene

RECORDINGS = 5000
MADE = 250  # Number of different recordings
PLECTRA, SESSIONS = 10, 5
PROCESSES = 2
LIMIT = 60.0  # s, limit of the time for all recordings on two cores
SET_UP = 0.02  # 1, relative standard deviation of the overlap between set-ups
CUTS = (0.42e-3, 0.54e-3), (0.22e-3, 0.32e-3)  # m, ranges of the plectra's thickness and overlap


def run() -> list[Figure]:
    """Return the time of a campaign here and on a cluster, and check that the tables are equal."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "recordings"
        made = write_presses(folder, PLECTRA, SESSIONS, MADE // (PLECTRA * SESSIONS))
        copy_presses(made, RECORDINGS)
        times = {}
        with cluster(PROCESSES) as (address, _):
            for what, where in (("two cores", PROCESSES), ("a cluster of two", address)):
                out = Path(name) / f"{what}.parquet"
                times[what], _ = timed(run_campaign, folder, out, where)
        tables = [read_campaign(Path(name) / f"{what}.parquet") for what in times]
        check(tables[0].table.equals(tables[1].table), "the table of the cluster differs")
        check(
            len(tables[0].table) == RECORDINGS and not tables[0].faults,
            f"{len(tables[0].table)} of {RECORDINGS} recordings are in the table",
        )
        again, _ = timed(run_campaign, folder, tables[0].path, PROCESSES)
        touch, _ = timed(find_touch, tables[0])
    figures = [
        Figure(f"{RECORDINGS} recordings, {what}", seconds, "s", "limit", LIMIT)
        for what, seconds in times.items()
    ]
    reading = times["two cores"]
    return [
        *figures,
        Figure("the same, once read", again, "s", "reading them", reading),
        Figure("touch of these presses", touch, "s", "reading them", reading),
    ]


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
    from distributed import LocalCluster

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
