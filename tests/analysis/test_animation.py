"""The animation: its frames, the mark of simulated presses, and refused files."""

import shutil
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.figures.movie import (
    FRAME_RATE,
    animate,
    animation_figure,
    frame_times,
    pictures,
)
from sautereau.analysis.phases import find_phases
from sautereau.analysis.press.replay import replay
from sautereau.daq.file.recorded import Plan
from sautereau.rig.load import load_rig
from sautereau.rig.progress import progress_to
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.press import draft_press
from tests.budget import slow
from tests.plots import texts


def staged(press, time, arm=None):
    return replay(press, find_phases(press), time, arm)


@pytest.fixture(scope="module")
def scene(make_press):
    return staged(make_press(), frame_times(0.05, 0.08, 5))


@pytest.mark.parametrize(
    ("slow", "word"),
    [
        (-1.0, "must be above 0"),
        (np.nan, "must be above 0"),
        (0.1, "1 frame;"),
        (1e6, "frames; it must have 2 to 1500"),
    ],
)
def test_too_few_or_too_many_frames_are_refused(slow, word):
    with pytest.raises(AnalysisError, match=word):
        frame_times(0.05, 0.15, slow)


@pytest.mark.slow
def test_a_gif_has_all_frames_and_their_time(tmp_path, scene):
    path = tmp_path / "new" / "press.gif"
    shares = []
    with progress_to(shares.append):
        animate(path, scene)
    with Image.open(path) as film:
        assert film.n_frames == len(scene.time) == 4
        assert film.info["duration"] == 1000 / FRAME_RATE
        assert film.size == (960, 640)
        seen = []
        for frame in range(4):
            film.seek(frame)
            seen.append(np.asarray(film.convert("RGB")).astype(int))
    assert all((a != b).any() for a, b in pairwise(seen))
    assert shares == [0.25, 0.5, 0.75, 1.0]
    assert (seen[0][:5, :5] == 255).all()


@pytest.mark.slow
def test_a_frame_equals_a_complete_drawing(scene):
    """Only moving artists are drawn again; fixed parts over them change a few pixels."""
    *_, last = pictures(scene, [0, 3])
    figure, parts = animation_figure(scene, 5)
    for part in parts:
        part.show(3)
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    complete = np.asarray(canvas.buffer_rgba())[..., :3].astype(int)
    differing = (np.abs(complete - np.asarray(last).astype(int)) > 40).any(axis=-1).mean()
    assert differing < 0.01


def test_measured_presses_are_called_measured(make_press):
    scene = staged(make_press(simulated=False), frame_times(0.05, 0.08, 5))
    said = "\n".join(texts(animation_figure(scene, 5)[0]))
    assert "measured" in said
    assert "simulated" not in said.lower()


def test_simulation_model_phase_and_time_are_shown(make_press):
    scene = staged(make_press(), np.array([0.04, 0.06, 0.08]))
    figure, parts = animation_figure(scene, 5)
    said = "\n".join(texts(figure))
    assert "SIMULATED; 5 times slower; no arm was recorded" in said
    assert "plectrum and string by the model" in said
    assert "simulated" in said.split("\n")
    for frame, words in enumerate(("before contact", "string held", "string released")):
        for part in parts:
            part.show(frame)
        said = texts(figure)
        assert words in said
        assert f"{scene.time[frame] * 1e3:.1f} ms" in said


def test_a_press_without_a_pluck_says_so(make_press):
    mute = staged(make_press(slope=0), frame_times(0.05, 0.08, 5))
    assert "no pluck found" in "\n".join(texts(animation_figure(mute, 5)[0]))


@pytest.mark.slow
def test_arm_and_choirs_are_shown(make_press):
    rig = load_scene("two-choirs").true_rig(load_rig())
    press = make_press()
    press = replace(press, rig=rig)
    plan = draft_press(rig)
    arm = Plan(plan.time, *plan.joints.position.T, plan.rise.position)
    scene = staged(press, frame_times(0.05, 0.08, 5), arm)
    figure, _ = animation_figure(scene, 5)
    said = "\n".join(texts(figure))
    assert "string 1: " in said
    assert "string 2: " in said
    assert "no arm" not in said
    (picture,) = pictures(scene, [2])
    assert picture.size == (960, 640)


@pytest.mark.parametrize("name", ["press.avi", "press", "press.png"])
def test_another_kind_of_file_is_refused(tmp_path, scene, name):
    with pytest.raises(AnalysisError, match=r"is a \.gif or \.mp4"):
        animate(tmp_path / name, scene)
    assert not list(tmp_path.iterdir())


def test_without_ffmpeg_an_mp4_is_refused(tmp_path, scene, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(AnalysisError, match="apt install ffmpeg"):
        animate(tmp_path / "press.mp4", scene)


@pytest.mark.skipif(sys.platform == "win32", reason="the stand-in for ffmpeg is a script of sh")
@pytest.mark.parametrize("reads", [slow(True), False])
def test_an_ffmpeg_that_fails_is_quoted(tmp_path, scene, monkeypatch, reads):
    tool = tmp_path / "ffmpeg"
    eat = "cat > /dev/null\n" if reads else ""
    tool.write_text(f"#!/bin/sh\n{eat}echo 'Unknown encoder' >&2\nexit 1\n")
    tool.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    with pytest.raises(AnalysisError, match="ffmpeg failed: Unknown encoder"):
        animate(tmp_path / "press.mp4", scene)


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed")
def test_an_mp4_plays(tmp_path, scene):
    path: Path = tmp_path / "press.mp4"
    animate(path, scene)
    done = subprocess.run(
        ["ffmpeg", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"],
        capture_output=True,
        check=True,
    )
    assert len(done.stdout) == 4 * 960 * 640 * 3
