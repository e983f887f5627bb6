"""Iterative learning control on recordings of the stand-in, and the file of a correction."""

import json
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from sautereau.analysis.loading.press import load_press
from sautereau.daq.file.reading import read_recording
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.feedforward import force_of
from sautereau.robot.experiment.learning import (
    HALVINGS,
    IterativeLearning,
    LearnedCorrection,
    read_learned,
    write_learned,
)
from sautereau.robot.experiment.session import Item, make_presses
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.learning import Correction
from sautereau.trajectory.press import plan_press
from sautereau.trajectory.timing import press_law
from tests.presses import QUICK

RIG = with_values(load_rig("paper"), QUICK)
LAW = press_law(RIG.press)


def bump(height):
    """A correction (m) that rises during the cruise and is back at 0 before the return."""
    time = np.linspace(LAW.start, LAW.return_start, 30)
    rise = height * np.sin(np.pi * (time - LAW.start) / (LAW.return_start - LAW.start)) ** 2
    rise[[0, -1]] = 0
    return Correction(time, rise)


def learn_on(scene, out, presses, seed=0, measured=None, **changes):
    """Learn on the stand-in; return the learning and the recordings."""
    learning = IterativeLearning(RIG, None, presses, measured=measured)
    scene = load_scene(scene).model_copy(update={"step": 5e-4} | changes)
    with StandIn(RIG, scene, seed) as stand_in:
        items = learning.presses_on(stand_in.rig)
        paths = make_presses(GalilController(stand_in.rig), out, items, on_press=learning.update)
    return learning, paths


@pytest.mark.slow
def test_feed_forward_leaves_little_to_learn(tmp_path):
    alone, (path,) = learn_on("paper", tmp_path / "alone", 1)
    pushed, paths = learn_on("paper", tmp_path / "pushed", 2, seed=1, measured=force_of(path))
    assert pushed.errors[0] < 0.5 * alone.errors[0]
    assert pushed.errors[-1] < 0.01
    (event,) = (e for e in read_recording(paths[0]).events if e.kind == "feed-forward")
    assert "N m at joint 1" in event.text


@pytest.mark.slow
@pytest.mark.parametrize(("counts", "reached"), [(20_000, 0.03), (200_000, 0.006)])
def test_an_ordinary_encoder_is_learned_to_its_floor(tmp_path, counts, reached):
    """The loops read whole counts, which a fine encoder would not show: that is the scatter."""
    rig = with_values(
        load_rig("paper"),
        {
            "controller.timeout": "20 s",
            "controller.position_error_limit": 1000,
            "arm.counts_per_revolution": counts,
        },
    )
    learning = IterativeLearning(rig, None, 5)
    with StandIn(rig, load_scene("paper"), 1) as stand_in:
        items = learning.presses_on(stand_in.rig)
        make_presses(GalilController(stand_in.rig), tmp_path, items, on_press=learning.update)
    assert learning.errors[0] > 0.07
    assert min(learning.errors) < min(reached, 2 * learning.floor)
    assert learning.rounding < learning.floor


def test_a_correction_below_its_own_rounding_ends_learning():
    rig = with_values(RIG, {"arm.counts_per_revolution": 4000, "press.speed_tolerance": 0.05})
    learning = IterativeLearning(rig, None, 5)
    learning.errors.append(0.001)
    learning.plan(bump(0.2e-3))
    assert "rounding to encoder counts" in learning.stopped
    assert list(learning.presses_on(rig)) == []


@pytest.mark.slow
def test_an_ideal_finger_has_nothing_to_learn(tmp_path):
    learning, paths = learn_on("ideal", tmp_path, 6, step=1e-3)
    assert len(paths) < 6
    assert learning.stopped
    assert max(learning.errors) < 0.005


def test_a_correction_too_large_is_halved_until_it_can_be_pressed():
    learning = IterativeLearning(RIG, None, 5)
    largest = bump(8e-3)  # beyond the dip, 1 mm is not
    with pytest.raises(TrajectoryError, match="depth of the key"):
        plan_press(RIG, None, largest)
    learning.plan(largest)
    items = learning.presses_on(RIG)
    rise = next(items).trajectory.law.law.states[:, 0].max()
    assert RIG.press.jack_rise < rise < RIG.press.jack_rise + 0.6e-3
    assert not learning.stopped


def test_a_correction_that_cannot_be_pressed_after_halving_ends_learning():
    learning = IterativeLearning(RIG, None, 5)
    learning.plan(bump(0.2))
    assert f"not even halved {HALVINGS} times" in learning.stopped
    assert "press cannot be made" in learning.stopped
    assert list(learning.presses_on(RIG)) == []


def test_no_presses_are_refused():
    with pytest.raises(RobotError, match="0 presses"):
        IterativeLearning(RIG, None, 0)


def test_what_was_learned_is_written_and_read_back(tmp_path):
    path = tmp_path / "learned.json"
    learned = LearnedCorrection(bump(1e-4), 0.003, 0.7)
    before = datetime.now(UTC).replace(microsecond=0)
    write_learned(path, RIG, learned, [0.07, 0.01])
    found = read_learned(path, with_values(RIG, {"controller.port": "/dev/other"}))
    np.testing.assert_array_equal(found.correction.time, learned.correction.time)
    np.testing.assert_array_equal(found.correction.rise, learned.correction.rise)
    assert (found.held_speed_error, found.peak_force) == (0.003, 0.7)
    assert found.doubts == ()
    written = json.loads(path.read_text())
    assert written["rms_speed_error"] == [0.07, 0.01]
    learned_on = datetime.fromisoformat(written["learned_on"])
    assert before <= learned_on <= datetime.now(UTC)
    assert found.learned_on == learned_on.date().isoformat()
    with pytest.raises(RobotError, match=r"learned_for|feed_forward"):
        read_learned(path, RIG, "sha of a recording")
    with pytest.raises(RobotError, match="File exists"):
        write_learned(path, RIG, learned, [])


def test_a_load_that_has_changed_since_is_listed(tmp_path):
    path = tmp_path / "learned.json"
    write_learned(path, RIG, LearnedCorrection(bump(1e-4)), [0.07])
    changes = {"jack.mass": "7 g", "plectrum.overlap": "0.3 mm", "daq.tail": "0.5 s"}
    (doubt,) = read_learned(path, with_values(RIG, changes)).doubts
    assert 'jack.mass: "0.006 kg" then, "0.007 kg" now' in doubt
    assert "plectrum.overlap" in doubt
    assert "daq" not in doubt  # it does not load the finger
    written = json.loads(path.read_text())
    assert f"learned on {written['learned_on'][:10]}" in doubt
    old = {key: written[key] for key in ("time", "rise", "learned_for")}  # as version 0.1 wrote it
    path.write_text(json.dumps(old))
    assert "date and load are not known" in read_learned(path, RIG).doubts[0]


def test_a_correction_is_stale_where_most_presses_miss_what_it_reached():
    """A correction that never reached the tolerance is not stale, nor is one outlier a proof."""
    learned = LearnedCorrection(bump(1e-4), 0.003, 0.7, "2026-01-02")
    said = learned.stale([0.045, 0.004, 0.03], [0.9, 1.0, 1.1], 0.005)
    assert "it is stale: on 2026-01-02 " in said
    assert "0.3 % at a peak force of 0.7 N, and is up to 4.5 % at 1 N now" in said
    assert "in 2 of 3 presses; learn again" in said
    assert not learned.stale([0.045, 0.004], [0.9, 1.0], 0.005)
    assert not learned.stale([], [], 0.005)
    assert not replace(learned, held_speed_error=0.02).stale([0.045], [0.9], 0.005)
    assert not replace(learned, held_speed_error=None).stale([0.045], [0.9], 0.005)


def test_it_is_refused_for_another_press_arm_or_controller(tmp_path):
    path = tmp_path / "learned.json"
    write_learned(path, RIG, LearnedCorrection(bump(1e-4)), [0.07])
    differ = {
        "press.jack_speed": "0.1 m/s",
        "arm.lower_mass": "0.2 kg",
        "controller.sample_period": "1 ms",
    }
    with pytest.raises(RobotError) as caught:
        read_learned(path, with_values(RIG, differ | INDEPENDENT))
    for key in (*differ, "learn again"):
        assert key in str(caught.value)
    for key in INDEPENDENT:
        assert key not in str(caught.value)


INDEPENDENT = {
    "press.speed_tolerance": 0.01,
    "press.hover": "24 mm",
    "arm.servo_stiffness": ["20 N m/rad", "8 N m/rad"],
    "arm.tilt_limit": "7 deg",
    "arm.fixture_mass": "5 g",
    "arm.upper_limits": ["179 deg", "179 deg"],
    "controller.timeout": "7 s",
    "controller.position_error_limit": 777,
}
"""Values that alter neither the path of the joints nor their response to it."""


def test_it_is_used_whatever_has_changed_that_does_not_alter_the_motion(tmp_path):
    """Where values alter the plan of a press, such as the encoders, they are in the comparison."""
    path = tmp_path / "learned.json"
    write_learned(path, RIG, LearnedCorrection(bump(1e-4)), [0.07])
    other = with_values(RIG, INDEPENDENT)
    found = read_learned(path, other)
    assert found.doubts == ()
    plans = [plan_press(rig, None, found.correction) for rig in (RIG, other)]
    np.testing.assert_array_equal(plans[0].segments.steps, plans[1].segments.steps)
    np.testing.assert_array_equal(plans[0].torques, plans[1].torques)
    with pytest.raises(RobotError, match=r'arm.base_x: "[^"]*" then, "0.08 m" now'):
        read_learned(path, with_values(RIG, {"arm.base_x": "80 mm"}))
    rubbed = read_learned(path, with_values(RIG, {"arm.fingertip_friction": 0.3}))
    assert "arm.fingertip_friction" in rubbed.doubts[0]


@pytest.mark.parametrize("text", ["", "{}", '{"time": [0], "rise": ["x"], "learned_for": {}}', "7"])
def test_a_file_that_holds_no_correction_is_refused(tmp_path, text):
    path = tmp_path / "learned.json"
    path.write_text(text)
    with pytest.raises(RobotError, match="cannot be read"):
        read_learned(path, RIG)
    with pytest.raises(RobotError, match="cannot be read"):
        read_learned(tmp_path / "none.json", RIG)


def test_a_start_that_is_not_known_well_enough_is_not_learned_from(tmp_path, monkeypatch):
    _, (path,) = learn_on("ideal", tmp_path, 1, step=1e-3)
    press = load_press(path)
    assert press.motion.std == RIG.controller.trigger_delay_std
    vague = replace(press, motion=replace(press.motion, std=1e-3))
    for found, said in (
        (vague, r"known to \+-1 ms only"),
        (replace(press, motion=None), "unknown"),
    ):
        monkeypatch.setattr("sautereau.robot.experiment.learning.load_press", lambda _, p=found: p)
        learning = IterativeLearning(RIG, None, 1)
        with pytest.raises(RobotError, match=said):
            learning.update(Item(RIG, plan_press(RIG)), path)


def test_the_last_correction_stays_where_a_larger_one_cannot_be_pressed():
    learning = IterativeLearning(RIG, None, 5)
    learning.plan(bump(0.4e-3))
    learning.plan(bump(8e-3))
    rise = next(learning.presses_on(RIG)).trajectory.law.law.states[:, 0].max()
    assert rise > plan_press(RIG, None, bump(0.4e-3)).law.law.states[:, 0].max()
