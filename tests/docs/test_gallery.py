"""Every example of the gallery runs, draws its picture, and reproduces its number."""

import math
import re
from pathlib import Path

import pytest

from examples import (
    bench,
    clamping,
    fast_keys,
    gallery,
    learning,
    levels,
    plectra,
    pluck,
    session,
    string_waves,
)
from sautereau.analysis.model.predict import predict
from sautereau.rig.load import load_rig, with_values

ROOT = Path(__file__).parents[2]
LARGEST = 200e3  # Largest size of a picture in the repository, in bytes
RIG = load_rig()


def drawn(path: Path) -> bool:
    return path.read_bytes().startswith(b"\x89PNG") and path.stat().st_size < LARGEST


@pytest.mark.slow
def test_a_session_agrees_with_the_model(tmp_path):
    studied = session.study(n=2, picture=tmp_path / "a.png")
    assert abs(studied.compare().document["duration_error"]["value"]) < 5e-3
    assert drawn(tmp_path / "a.png")


@pytest.mark.slow
def test_beams_predict_a_longer_pluck(tmp_path):
    held = levels.study(RIG)
    assert held["elastica"] == pytest.approx(20e-3, rel=1e-3)
    assert held["beam"] / held["elastica"] == pytest.approx(1.222, abs=1e-3)
    levels.plot(tmp_path / "a.png", RIG)
    assert drawn(tmp_path / "a.png")


def test_a_slow_string_is_a_spring(tmp_path):
    studied = fast_keys.study(RIG, (0.03, 0.072, 1.0))
    assert abs(studied[0.03]) < 1e-3
    assert studied[0.072] == pytest.approx(-0.0025, abs=5e-4)
    assert studied[1.0] == pytest.approx(-0.077, abs=2e-3)
    fast_keys.plot(tmp_path / "a.png", studied)
    assert drawn(tmp_path / "a.png")


def test_the_string_comes_back_after_a_period(tmp_path):
    waves = string_waves.study(RIG)
    assert waves.period == pytest.approx(1 / RIG.string.frequency, rel=5e-3)
    half = len(waves.time) // 4
    # After half a period the triangle is inverted and mirrored between nut and bridge.
    mirrored = -waves.lift[::-1, half]
    assert abs(mirrored - waves.lift[:, 0]).max() < 0.03 * waves.lift[:, 0].max()
    string_waves.plot(tmp_path / "a.png", waves)
    assert drawn(tmp_path / "a.png")


@pytest.mark.slow
def test_the_best_place_hardly_tilts_the_finger(tmp_path):
    mount = clamping.study(RIG)
    assert math.degrees(mount.tilt_max) == pytest.approx(0.0518, abs=1e-3)
    clamping.plot(tmp_path / "a.png", RIG, mount)
    assert drawn(tmp_path / "a.png")


@pytest.mark.slow
def test_the_force_of_three_plectra_at_two_speeds(tmp_path):
    """The model has the same difference of forces; both are counted from other rests."""
    found = plectra.study(plectra.SPEEDS[::3], 2)
    thin, _, thick = (m.value for m in found.fitted["release_force"].factors[0].means)
    model = [predict(with_values(RIG, own)).release_force for own in plectra.PLECTRA.values()]
    assert thick - thin == pytest.approx(model[2] - model[0], rel=0.02)
    found.plot().savefig(tmp_path / "a.png")
    assert drawn(tmp_path / "a.png")


@pytest.mark.slow
def test_three_presses_teach_the_speed(tmp_path):
    studied = learning.study(n=3)
    assert 0.05 < studied.errors[0] < 0.1
    assert min(studied.errors) < 0.005
    learning.plot(tmp_path / "a.png", studied)
    assert drawn(tmp_path / "a.png")


@pytest.mark.slow
def test_a_pluck_is_shown_from_contact_to_the_free_string(tmp_path):
    studied = pluck.study()
    (choir,) = studied.choirs
    assert choir.plucks
    held = studied.phases.plucks[0]
    assert studied.time[0] < held.release < studied.time[-1]
    assert studied.time[-1] - studied.time[0] == pytest.approx(pluck.BEFORE + pluck.AFTER, rel=0.1)
    pluck.plot(tmp_path / "a.gif", studied)
    assert (tmp_path / "a.gif").read_bytes().startswith(b"GIF8")


def test_the_bench_is_drawn(tmp_path):
    bench.plot(tmp_path / "a.png", RIG)
    assert drawn(tmp_path / "a.png")


def test_the_page_shows_every_picture():
    shown = re.findall(r"\]\(gallery/([^)]+)\)", (ROOT / "docs" / "gallery.md").read_text())
    assert sorted(shown) == sorted(gallery.pictures())


def test_the_readmes_picture_is_in_the_repository():
    assert drawn(ROOT / "docs" / "gallery" / "session.png")
