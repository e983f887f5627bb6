"""`animate`, `listen` and `plan --bench` as scripts call them."""

import json

import pytest
from cyclopts import CycloptsError
from PIL import Image
from scipy.io import wavfile

from sautereau.commands.app import app

STRETCH = ("--since", "60 ms", "--until", "80 ms")


def call(*words: object) -> object:
    """Run a command in this process."""
    return app([str(word) for word in words], print_error=False, exit_on_error=False)


@pytest.mark.slow
def test_a_recording_is_animated(sautereau, ideal, tmp_path):
    words = ("--slow", "10", *STRETCH, "--json")
    done = sautereau("animate", ideal[0][0], "--out", "pluck.gif", *words)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["simulated"] is True
    assert (result["frames"], result["plucks"], result["arm"]) == (6, 1, True)
    assert result["start"] == pytest.approx(0.06)
    with Image.open(tmp_path / "pluck.gif") as film:
        assert film.n_frames == 6


@pytest.mark.slow
def test_the_lines_say_simulated(ideal, tmp_path, capsys):
    path = tmp_path / "pluck.gif"
    assert call("animate", ideal[0][0], "--out", path, "--slow", "4", *STRETCH) == 0
    printed = capsys.readouterr().out
    assert printed.startswith(f"SIMULATED: {path}\n60 to 80 ms")
    assert "strings plucked: 1 of 1" in printed


@pytest.mark.parametrize(("since", "said"), [("60", "has no unit"), ("3 kg", "--since")])
def test_a_wrong_stretch_is_refused(ideal, tmp_path, since, said):
    with pytest.raises(CycloptsError, match=said):
        call("animate", ideal[0][0], "--out", tmp_path / "pluck.gif", "--since", since)
    assert not list(tmp_path.iterdir())


def test_a_press_is_heard(sautereau, tmp_path):
    done = sautereau("listen", "--out", "pluck.wav", "--duration", "300 ms", "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["sample_rate"] == 48_000
    assert result["duration"] == pytest.approx(0.3)
    assert 0.1 < result["full_scale"] < 1.0
    rate, samples = wavfile.read(tmp_path / "pluck.wav")
    assert (rate, len(samples)) == (48_000, 14_400)
