"""One press on the stand-in, from the start of the command line to the comparison."""

import statistics
import subprocess
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

from benchmarks.figures import Figure, check, median_time
from sautereau.rig.load import load_rig

PRESSES = 10
STARTS = 9
LIMIT = ("limit", 1.5)  # s, for a press after start-up


def run() -> list[Figure]:
    """Return the times of `--help` and of a press, and the errors of contact and release."""
    return [_help(), *_presses("ideal"), *_presses("paper")]


def _help() -> Figure:
    def show() -> None:
        command = [sys.executable, "-m", "sautereau", "--help"]
        shown = subprocess.run(command, capture_output=True, check=True).stdout
        check(b"stand-in" in shown, "--help does not list the commands")

    return Figure("sautereau --help", median_time(show, STARTS), "s", "limit", 0.3)


def _presses(scene: str) -> list[Figure]:
    from sautereau.analysis.session.analysed import analyse_file
    from sautereau.analysis.session.conditions import analyse
    from sautereau.robot.drivers.galil.driver import GalilController
    from sautereau.robot.experiment.session import Item, make_presses
    from sautereau.sim_backend.bench import StandIn
    from sautereau.sim_backend.scene import load_scene
    from sautereau.trajectory.press import plan_press

    marks, found = [], []

    def done(item: Item, path: Path) -> None:
        found.append(analyse_file(path))
        plan_press(stand_in.rig)
        analyse(found[-1:])
        marks.append(time.perf_counter())

    with tempfile.TemporaryDirectory() as out, StandIn(load_rig(), load_scene(scene)) as stand_in:
        rig = stand_in.rig
        presses = [Item(rig, plan_press(rig))] * PRESSES
        make_presses(GalilController(rig), Path(out), presses, on_press=done)
        truth = stand_in.truth()
    times = [after - before for before, after in pairwise(marks)]
    held = [one.phases.plucks[0] for one in found]
    contact = max(abs(h.contact - t.contacts[0]) for h, t in zip(held, truth, strict=True))
    release = max(abs(h.release - t.releases[0]) for h, t in zip(held, truth, strict=True))
    limit = 0.1e-3 if scene == "ideal" else 0.3e-3
    worst = f"found, largest error of {PRESSES} presses"
    return [
        Figure(f"{scene}: a press, from plan to comparison", statistics.median(times), "s", *LIMIT),
        Figure(f"{scene}: contact {worst}", contact * 1e3, "ms", "limit", limit * 1e3),
        Figure(f"{scene}: release {worst}", release * 1e3, "ms", "limit", limit * 1e3),
    ]
