"""A pluck, a hundred times slower, as `animate` shows a recording.

python -m examples.pluck picture.gif
"""

import sys
import tempfile
from pathlib import Path

import sautereau as st
from sautereau.analysis.figures.movie import animate, frame_times
from sautereau.analysis.press.replay import Replay, replay
from sautereau.daq.file.reading import read_recording

SLOWER = 100.0
"""Times slower than it was."""
BEFORE, AFTER = 12e-3, 6e-3
"""s, shown before and after the release."""


def study(scene: str = "return", seed: int = 1) -> Replay:
    """Press once on the stand-in, and put the pluck together at the frames' instants."""
    with tempfile.TemporaryDirectory() as out, st.stand_in("paper", scene, seed) as bench:
        (pressed,) = bench.press(out=out)
        press, phases, joints = pressed.press, pressed.phases, read_recording(pressed.path).joints
    release = phases.plucks[0].release
    times = frame_times(release - BEFORE, release + AFTER, SLOWER)
    return replay(press, phases, times, joints)


def plot(path: str | Path, studied: Replay) -> None:
    """Draw the pluck into a GIF or MP4 file."""
    animate(path, studied)


if __name__ == "__main__":
    plot(sys.argv[1], study())
