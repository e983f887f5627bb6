"""The verdict on the jack's speed, of a spinet of two strings on a soft arm."""

import json
from pathlib import Path

import numpy as np
import pytest

import sautereau as st
from sautereau.rig.edit import edited_text
from sautereau.rig.load import load_rig
from sautereau.robot.experiment.learning import LearnedCorrection, write_learned
from sautereau.trajectory.learning import Correction
from sautereau.trajectory.timing import press_law
from tests.presses import QUICK

SPINET = Path(__file__).parents[1] / "data" / "spinet.toml"


@pytest.fixture
def spinet(tmp_path):
    """The spinet's rig file with the values `QUICK`."""
    path = tmp_path / "spinet.toml"
    path.write_text(edited_text(SPINET.read_text(encoding="utf-8"), "spinet", tmp_path, QUICK))
    return path


@pytest.mark.slow
def test_a_session_that_does_not_keep_its_speed_says_so(sautereau, spinet, servo, tmp_path):
    """The jack loses a third of its speed, where the rounded plan has an error of 0.027 %."""
    words = ("press", spinet, "--scene", servo, "--seed", 1, "--warm-up", 0, "--out", "out")
    result = json.loads(sautereau(*words, "--json").stdout)
    (press,) = result["presses"]
    speed = press["held_speed"]
    assert speed["min"] < 0.015 < speed["mean"] < 0.025 < 0.04 < speed["max"]
    assert 0.3 < speed["rms_error"] < 0.4
    assert (speed["tolerance"], speed["reached"]) == (0.005, False)
    assert result["held_speed"]["rms_error"] == speed["rms_error"]
    (warning,) = (w for w in result["conditions"][0]["warnings"] if "jack speed" in w)
    assert "press.speed_tolerance 0.5 %: not reached in 1 of 1 presses; learn" in warning

    session = st.open(tmp_path / "out")
    row = session.features.iloc[0]
    assert row["held_speed_error"] == speed["rms_error"]
    assert session.features.attrs["units"]["held_speed_min"] == "m/s"
    page = Path(session.report().path).read_text(encoding="utf-8")
    assert "press.speed_tolerance 0.5 %: not reached in 1 of 1 presses" in page
    assert f"{100 * speed['rms_error']:.2f}" in page


def test_a_correction_that_has_gone_stale_says_so(sautereau, rig_file, servo, tmp_path):
    """It corrects nothing, but is said to have reached the tolerance under another load."""
    law = press_law(load_rig(rig_file()).press)
    nothing = Correction(np.linspace(law.start, law.return_start, 5), np.zeros(5))
    path = tmp_path / "learned.json"
    before = load_rig(rig_file(overlap='"0.2 mm"'))
    write_learned(path, before, LearnedCorrection(nothing, 0.003, 0.5), [0.07, 0.003])
    words = ("press", rig_file(), "--scene", servo, "--seed", 1, "--warm-up", 0, "--out", "out")
    words += ("--learned", path)
    result = json.loads(sautereau(*words, "--json").stdout)
    load, stale = (w for w in result["warnings"] if "learned correction" in w)
    assert 'another load (plectrum.overlap: "0.0002 m" then, "0.000263 m" now); learn' in load
    assert "stale" in stale
    (press,) = result["presses"]
    error, peak = 100 * press["held_speed"]["rms_error"], press["forces"]["peak"]
    assert f"0.3 % at a peak force of 0.5 N, and is up to {error:.3g} % at {peak:.3g} N" in stale
    assert "in 1 of 1 presses; learn again" in stale
    planned = sautereau("plan", rig_file(), "--learned", path, "--json")
    assert load in json.loads(planned.stdout)["warnings"]
    done = sautereau(*words)
    assert "another load" in " ".join(done.stderr.split())  # before the arm moves
    assert "learned.json: it is stale" in " ".join(done.stdout.split())
    session = st.stand_in(rig_file(), servo, 1).press(out=tmp_path / "out", warm_up=0, learned=path)
    assert session.warnings == tuple(result["warnings"])


@pytest.mark.slow
def test_learning_that_does_not_reach_the_speed_fails(sautereau, spinet, servo):
    words = ("learn", spinet, "--scene", servo, "--seed", 1, "-n", 2)
    done = sautereau(*words, "--out", "one")
    assert done.returncode == 1
    message = " ".join(done.stderr.split())
    assert "learning: not reached: RMS speed error" in message
    assert "after 2 presses, press.speed_tolerance 0.5 %; floor " in message
    assert "; request more presses with -n" in message
    assert "learned.json" in done.stdout
    done = sautereau(*words, "--out", "two", "--json")
    result = json.loads(done.stdout)
    assert (done.returncode, result["reached"], result["tolerance"]) == (1, False, 0.005)
    assert 0.2 < result["held_speed_error"] < 0.35


@pytest.mark.slow
def test_a_slow_press_has_the_predicted_speed_error(sautereau, spinet, servo):
    """The scene's loops, where their damping does not matter."""
    edited = edited_text(
        spinet.read_text(encoding="utf-8"),
        "spinet",
        spinet.parent,
        {"arm.servo_stiffness": ["27 N m/rad", "10 N m/rad"]},
    )
    spinet.write_text(edited, encoding="utf-8")
    plan = json.loads(sautereau("plan", spinet, "--json").stdout)
    words = ("press", spinet, "--scene", servo, "--seed", 1, "--out", "out", "--json")
    measured = json.loads(sautereau(*words).stdout)["held_speed"]["rms_error"]
    assert plan["loaded_speed_error"] == pytest.approx(measured, rel=0.1)
