"""Report of a session of 20 presses: time and size of the page."""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.figures import Figure, check, median_time
from sautereau.rig.load import load_rig
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.experiment.session import Item, make_presses
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.press import plan_press

PRESSES = 20
RUNS = 5


def run() -> list[Figure]:
    """Return the time of the complete command `sautereau report`, and the size of its page."""

    def report() -> bytes:
        command = [sys.executable, "-m", "sautereau", "report", folder, "--force", "--json"]
        return subprocess.run(command, capture_output=True, check=True).stdout

    with tempfile.TemporaryDirectory() as folder:
        with StandIn(load_rig(), load_scene("paper")) as stand_in:
            rig = stand_in.rig
            presses = [Item(rig, plan_press(rig))] * PRESSES
            make_presses(GalilController(rig), Path(folder), presses)
        spent = median_time(report, RUNS)
        result = json.loads(report())
        check(result["presses"] == PRESSES, f"the report shows {result['presses']} presses")
        size = Path(result["path"]).stat().st_size
    return [
        Figure("sautereau report", spent, "s", "limit", 3.0),
        Figure("its page", size / 1e6, "MB", "limit", 6.0),
    ]
