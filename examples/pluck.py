"""A pluck, a hundred times slower, as `animate` shows a recording.

python -m examples.pluck picture.gif
"""

import sys
import tempfile
from pathlib import Path

from sautereau.analysis.figures.movie import animate, frame_times
from sautereau.analysis.loading.press import press_of
from sautereau.analysis.phases import find_phases
from sautereau.analysis.press.replay import Replay, replay
from sautereau.daq.file.reading import read_recording
from sautereau.rig.load import load_rig
from sautereau.robot.drivers.registry import motion_controller
from sautereau.robot.experiment.session import run_session
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.press import plan_press

SLOWER = 100.0
"""Times slower than it was."""
BEFORE, AFTER = 12e-3, 6e-3
"""s, shown before and after the release."""


def study(scene: str = "return", seed: int = 1) -> Replay:
    """Press once on the stand-in, and put the pluck together at the frames' instants."""
    rig = load_rig()
    with tempfile.TemporaryDirectory() as out, StandIn(rig, load_scene(scene), seed) as served:
        bench = served.rig
        (path,) = run_session(bench, plan_press(bench), motion_controller(bench), Path(out), 1)
        recorded = read_recording(path)
    press = press_of(recorded)
    phases = find_phases(press)
    release = phases.plucks[0].release
    times = frame_times(release - BEFORE, release + AFTER, SLOWER)
    return replay(press, phases, times, recorded.joints)


def plot(path: str | Path, studied: Replay) -> None:
    """Draw the pluck into a GIF or MP4 file."""
    animate(path, studied)


if __name__ == "__main__":
    plot(sys.argv[1], study())
