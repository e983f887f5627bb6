"""An ideal finger in the rigid-body engine, against planner and model."""

import numpy as np
import pytest
from scipy.optimize import brentq

from sautereau.analysis.model.key import finger_force
from sautereau.analysis.model.predict import rig_pluck
from sautereau.rig.load import with_values
from sautereau.sim_backend.physics.drive import LEAD, PressDrive
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.physics.world import new_world
from sautereau.trajectory.arm import fingertip_motion, joints_holding_point
from sautereau.trajectory.key import key_under_fingertip, rise_of_angle
from sautereau.trajectory.motion import Motion
from sautereau.trajectory.press import plan_press
from tests.budget import slow
from tests.key_oracle import static_moment
from tests.sim_backend.scenes import MUTE, RIG, at_rest, run, scene_of

KEY, JACK = RIG.key, RIG.jack
PERIOD = RIG.controller.sample_period
PLAN = plan_press(RIG)
DRIVE = PressDrive(RIG, PLAN.segments)
START = LEAD * PERIOD + PLAN.law.start  # s, start of the fingertip's motion
SMOOTH = {
    "key.pivot_coulomb_friction": "0 N m",
    "key.pivot_viscous_friction": "0 N m s/rad",
    "jack.register_friction": "0 N",
}


def ideal(**changes):
    return scene_of("ideal", **changes)


def planned(time):
    """Return the key's motion [rad] prescribed by the fingertip's path."""
    centre = fingertip_motion(RIG.arm, DRIVE.joints(np.asarray(time)))
    return key_under_fingertip(KEY, RIG.arm.fingertip_radius, centre)


def reaches(rise):
    """Return the time at which the planned jack reaches a rise [m]."""

    def short(time):
        return float(rise_of_angle(KEY, planned(np.array([time])).position)[0]) - rise

    return brentq(short, START + 1e-3, LEAD * PERIOD + PLAN.law.bottom, xtol=1e-13)


def in_cruise(time):
    return (time > START + 0.0125) & (time < START + 0.114)


@pytest.fixture(scope="module")
def seen():
    return observe(RIG, ideal(), DRIVE)


def test_the_key_follows_the_fingertip(seen):
    moved = seen.motions
    plan = planned(moved.time)
    held = moved.finger_force > 0
    assert held[(moved.time > START + 1e-3) & (moved.time < LEAD * PERIOD + PLAN.law.bottom)].all()
    least = np.maximum(plan.position, 0)
    np.testing.assert_allclose(moved.angle[held], least[held], rtol=0, atol=1e-9)
    cruise = in_cruise(moved.time)
    np.testing.assert_allclose(
        moved.angular_velocity[cruise], plan.velocity[cruise], rtol=0, atol=5e-6
    )


@pytest.mark.parametrize("step", [slow(20e-6), 1e-4, 1e-3])
def test_contact_and_release_are_the_models(step):
    events = observe(RIG, ideal(step=step), DRIVE).events
    clearance, height = JACK.string_clearance, rig_pluck(RIG).release_height
    assert [e.time for e in events.contacts] == [pytest.approx(reaches(clearance), abs=1e-8)]
    assert [e.time for e in events.releases] == [
        pytest.approx(reaches(clearance + height), abs=1e-8)
    ]
    assert [e.time for e in events.returns] == [pytest.approx(0.4455, abs=1e-3)]
    assert events.releases[0].force == pytest.approx(rig_pluck(RIG).vertical_force[-1])


def modelled_force(moved, events, rig=RIG):
    string = rig_pluck(rig).force_on_jack(moved.rise - rig.jack.string_clearance)
    released = events.releases[0].time if events.releases else 0.0
    return finger_force(rig, planned(moved.time), string * (moved.time < released))


@pytest.mark.parametrize("friction", [True, False])
def test_finger_force_is_the_models(friction):
    seen = observe(RIG, ideal(friction=friction), DRIVE)
    moved = seen.motions
    expected = modelled_force(moved, seen.events, RIG if friction else with_values(RIG, SMOOTH))
    cruise = in_cruise(moved.time) & (np.abs(moved.time - seen.events.releases[0].time) > 1e-4)
    error = (moved.finger_force - expected)[cruise]
    assert np.sqrt(np.mean(error**2)) < 1e-4 * expected[cruise].max()
    np.testing.assert_allclose(moved.finger_force[cruise], expected[cruise], rtol=5e-3)


@pytest.mark.parametrize("depth", [-1e-6, 1e-12, 1e-6])
def test_a_finger_at_rest_on_the_key_has_a_constant_force(depth):
    """Zero just above the key, which the rail supports; below, the force of its weight."""
    arm = RIG.arm
    centre = np.array([-KEY.press_arm, KEY.surface_height + arm.fingertip_radius - depth])
    still = np.zeros((1, 2))
    joints = joints_holding_point(arm, Motion(centre[None], still, still)).position[0]
    world = new_world(RIG, ideal(friction=False), (float(joints[0]), float(joints[1])))
    resting = [world.advance(at_rest, True) for _ in range(50)]
    force = np.concatenate([m.finger_force for m in resting])
    carried = static_moment(RIG) / KEY.press_arm
    assert np.ptp(force) < 1e-9
    if depth == -1e-6:
        assert force[0] == 0
    elif depth == 1e-6:
        assert force[0] == pytest.approx(carried, rel=1e-4)


def test_the_felt_stops_the_finger_at_the_bottom():
    """A dip of 7 mm in the true bench only: the felt's spring acts through the press arm."""
    truth = {"key.dip": "7 mm"}
    bottom = LEAD * PERIOD + (PLAN.law.bottom + PLAN.law.return_start) / 2
    forces = []
    for felt in (True, False):
        moved = observe(RIG, ideal(friction=False, felt=felt, truth=truth, **MUTE), DRIVE).motions
        i = np.searchsorted(moved.time, bottom)
        forces.append(moved.finger_force[i])
    depth = moved.angle[i] - 7e-3 / KEY.press_arm
    still = Motion(*(np.array([v]) for v in (moved.angle[i], 0.0, 0.0)))
    bare = RIG.model_copy(update={"key": KEY.model_copy(update={"dip": 1.0})})
    weight = finger_force(bare, still, np.zeros(1))[0]
    assert forces[1] == pytest.approx(weight, rel=1e-5)
    assert forces[0] == pytest.approx(weight + KEY.felt_stiffness * KEY.press_arm * depth, rel=1e-5)


def test_a_second_press_plucks_again():
    world = new_world(RIG, ideal(), DRIVE.start)
    for _ in range(2):
        for i in range(DRIVE.samples):
            world.advance(DRIVE.reference(i), True)
    apart = DRIVE.samples * PERIOD
    for kind in (world.events.contacts, world.events.releases, world.events.returns):
        assert len(kind) == 2
        assert kind[1].time - kind[0].time == pytest.approx(apart, abs=1e-8)


def test_truth_changes_the_bench_and_not_the_plan():
    """A clearance of 2.5 mm in the true bench only."""
    events = observe(RIG, ideal(truth={"jack.string_clearance": "2.5 mm"}), DRIVE).events
    assert events.contacts[0].time == pytest.approx(reaches(2.5e-3), abs=1e-8)


def test_events_just_before_the_end_of_a_controller_sample_are_like_others():
    """The key meets the string at 72 mm/s, so that both events move with the clearance, in steps
    of 133 us; the key's speed while the string is held is that of the arm. Three contacts and
    releases leave less than a quarter step of their sample."""
    clearance = RIG.jack.string_clearance
    further = np.arange(0, 37, 6) * 1.6e-6
    times = []
    for more in further:
        rig = RIG.replaced({"jack.string_clearance": clearance + more})
        found = run(rig, scene_of("ideal", sensors=None))
        contact, release = found.events.contacts[0].time, found.events.releases[0].time
        times.append((contact, release))
        motion = found.motions
        held = (motion.time > contact) & (motion.time < release)
        turn = motion.angular_velocity[held]
        np.testing.assert_allclose(turn, turn.mean(), rtol=1e-3)
    expected = times[0] + further[:, None] / 0.072
    np.testing.assert_allclose(times, expected, atol=0.1e-6)
