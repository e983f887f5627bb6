"""The steps of the set-up, on the stand-in: what they find, and how they refuse."""

import math
import os

import numpy as np
import pytest

from sautereau.rig.load import load_rig, with_values
from sautereau.robot.errors import MotionFault, RobotError
from sautereau.robot.experiment.setup.contact import Creep, find_contact, locate_by_touch
from sautereau.robot.experiment.setup.step import Declined
from sautereau.robot.experiment.setup.steps import (
    STEPS,
    check_encoders,
    find_port,
    identify,
    make_steps,
    play_in_air,
    raised,
)
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.arm import fingertip_place
from tests.presses import QUICK, mute_scene

SHORT = Creep(above=0.1e-3, below=0.6e-3)


class Person:
    """An operator who agrees or not, and measures given values."""

    def __init__(self, agrees=True, measures=None):
        self.agrees, self.measures = agrees, measures
        self.asked = []

    def confirm(self, question):
        self.asked.append(question)
        return self.agrees

    def act(self, instruction):
        self.asked.append(instruction)
        return False

    def number(self, question, unit, expected):
        self.asked.append(question)
        return None if self.measures is None else self.measures(expected)


@pytest.fixture(scope="module")
def stand_in():
    """A stand-in whose key is 0.3 mm lower than in the rig, relative to the base."""
    rig = with_values(load_rig(), QUICK)
    truth = {"arm.base_z": f"{rig.arm.base_z + 0.3e-3!r} m"}
    with StandIn(rig, mute_scene(truth=truth)) as served:
        yield served


@pytest.fixture
def rig(stand_in):
    yield stand_in.rig
    assert stand_in.bench.firmware.motors_on == (False, False)
    assert not stand_in.bench.firmware.in_motion


@pytest.mark.parametrize("name", [name for name in STEPS if name not in ("port", "controller")])
def test_nothing_moves_before_the_operator_has_agreed(stand_in, rig, name):
    before = stand_in.bench.plant.encoder_counts()
    person = Person(agrees=False)
    with pytest.raises(Declined, match=f"setup {name}: not agreed to"):
        STEPS[name](rig, person)
    assert len(person.asked) == 1
    assert "free?" in person.asked[0] or "at hand?" in person.asked[0]
    assert stand_in.bench.plant.encoder_counts() == before


def test_an_unknown_step_names_the_known_ones(rig):
    with pytest.raises(RobotError, match="no step 'hom'; the steps are port, controller, verify"):
        list(make_steps(rig, Person(), "hom"))


# The port.


def test_the_port_of_the_rig_is_looked_at_first_and_unasked(rig):
    person = Person(agrees=False)
    found = find_port(rig, person, ["/dev/null"])
    assert not person.asked
    assert found.values == {}
    assert "DMC4020" in found.lines[0]


def test_another_port_is_found(rig):
    wrong = with_values(rig, {"controller.port": "/dev/ttyNONE", "controller.baud_rate": 9600})
    person = Person()
    found = find_port(wrong, person, [rig.controller.port])
    assert found.values == {"controller.port": rig.controller.port}
    assert rig.controller.port in person.asked[0]


def test_the_answer_of_every_port_is_reported(rig):
    master, slave = os.openpty()
    wrong = with_values(rig, {"controller.port": "/dev/ttyNONE", "controller.timeout": "10 ms"})
    try:
        with pytest.raises(RobotError) as caught:
            find_port(wrong, Person(), [os.ttyname(slave)])
    finally:
        os.close(master)
        os.close(slave)
    assert "/dev/ttyNONE (controller.port) does not exist" in str(caught.value)
    assert "did not answer" in str(caught.value)


def test_the_controller_is_identified_and_nothing_moves(stand_in, rig):
    before = stand_in.bench.firmware.samples
    found = identify(rig, Person(agrees=False))
    assert "DMC4020" in found.lines[0]
    assert "SIMULATED" in found.lines[0]
    assert stand_in.bench.firmware.samples == before


# The joints.


def test_joints_with_correct_encoders(rig):
    found = check_encoders(rig, Person(measures=lambda expected: expected * 1.02))
    assert found.values == {}
    assert found.figures["joint_1_scale"] == pytest.approx(1.02)
    assert not found.warnings


def test_an_encoder_of_half_the_counts_is_seen(rig):
    found = check_encoders(rig, Person(measures=lambda expected: expected * 2))
    assert found.values == {"arm.counts_per_revolution": 1_000_000}


@pytest.mark.parametrize(
    ("fractions", "said"),
    [((-1, 0), "joint 1 turns the wrong way; .*CE.*joint 2 has not turned"), ((1, 2), "both")],
)
def test_joints_with_wrong_encoders(rig, fractions, said):
    left = list(fractions)
    with pytest.raises(MotionFault, match=said):
        check_encoders(rig, Person(measures=lambda expected: expected * left.pop(0)))


# The key.


@pytest.mark.slow
def test_the_first_touch_is_found_within_a_step(rig):
    found = find_contact(rig, Person(), SHORT)
    assert found.figures["height"] == pytest.approx(-0.3e-3, abs=0.03e-3)
    assert 0.02 <= found.figures["force"] < 0.2
    assert found.warnings


def test_the_finger_is_not_pushed_beyond_the_limit(rig):
    creep = Creep(above=1e-3, below=1e-3, sense=0.001, limit=0.002)
    with pytest.raises(MotionFault, match=r"the limit is 0\.002 N.*\n.*motors are off"):
        find_contact(rig, Person(), creep)


@pytest.mark.slow
def test_a_key_that_is_not_there(rig):
    with pytest.raises(MotionFault, match=r"no contact down to 0\.1 mm below"):
        find_contact(rig, Person(), Creep(above=0.5e-3, below=0.1e-3))


def test_without_a_force_channel_the_motors_torques_are_used(rig):
    """An ideal finger has no motor torques, so the approach continues to its end."""
    mute = rig.replaced({"daq.channels": rig.daq.channels[:1]})
    with pytest.raises(MotionFault, match="no contact"):
        find_contact(mute, Person(), SHORT)


@pytest.mark.slow
def test_a_servo_feels_the_key_by_its_torques():
    rig = with_values(load_rig(), {"controller.timeout": "60 s"})
    with StandIn(rig, load_scene("paper")) as served:
        mute = served.rig.replaced({"daq.channels": rig.daq.channels[:1]})
        found = find_contact(mute, Person(), Creep(above=1e-3))
    assert found.figures["height"] == pytest.approx(0, abs=0.1e-3)
    assert "torques" in found.lines[0]


def test_every_fault_of_an_approach_is_listed():
    with pytest.raises(RobotError, match=r"above is .*step is .*speed is .*limit is "):
        Creep(above=0, step=-1e-3, speed=math.nan, sense=1.0, limit=0.5)


@pytest.mark.slow
def test_the_base_is_found_from_touches(rig):
    found = locate_by_touch(rig, Person(measures=lambda expected: expected + 1e-3), SHORT)
    assert found.figures["base_z"] == pytest.approx(rig.arm.base_z + 0.3e-3, abs=0.03e-3)
    assert found.figures["base_x"] == pytest.approx(rig.arm.base_x - 1e-3, abs=0.1e-3)
    assert set(found.values) == {"arm.base_x", "arm.base_z"}


# In the air.


def test_the_press_in_the_air_is_the_press_and_never_near_the_key(rig):
    trajectory, lift = raised(rig)
    assert lift > rig.press.hover
    for motion in (trajectory.approach, trajectory.segments, trajectory.retreat):
        counts = np.vstack([motion.start, motion.start + motion.steps.cumsum(axis=0)])
        place = fingertip_place(rig.arm, counts * 2 * np.pi / rig.arm.counts_per_revolution)
        gap = place[:, 1] - rig.key.surface_height - rig.arm.fingertip_radius
        assert gap.min() >= rig.press.hover - 1e-6


@pytest.mark.slow
def test_it_is_played_to_its_end(stand_in, rig):
    before = len(stand_in.bench.world.events.contacts)
    found = play_in_air(rig, Person())
    assert found.figures["force"] < 0.01
    assert found.figures["following_error"] < 1e-3
    assert len(stand_in.bench.world.events.contacts) == before


def test_something_in_the_way_is_noticed(rig):
    wrong = {"arm.base_z": f"{rig.arm.base_z + 0.02!r} m", "arm.tilt_limit": "15 deg"}
    low = with_values(rig, wrong | {"press.run_up_acceleration": "6 m/s^2"})
    with pytest.raises(MotionFault, match=r"the force reached .* in the air"):
        play_in_air(low, Person())
