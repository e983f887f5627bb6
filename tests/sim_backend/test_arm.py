"""The servo's arm on the key: compliance under the string, holding by motors and brakes."""

import math

import numpy as np
import pytest

from sautereau.analysis.model.key import finger_force
from sautereau.analysis.model.predict import rig_pluck
from sautereau.sim_backend.physics.drive import PressDrive
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.physics.world import new_world
from sautereau.trajectory.dynamics import gravity_torque
from sautereau.trajectory.motion import Motion
from sautereau.trajectory.press import plan_press
from tests.sim_backend.scenes import MUTE, RIG, at_rest, press_solved, scene_of

RADIANS = 2 * math.pi / RIG.arm.counts_per_revolution
PLAN = plan_press(RIG)
DRIVE = PressDrive(RIG, PLAN.segments)
HOVER = tuple((PLAN.hover * RADIANS).tolist())


@pytest.fixture(scope="module")
def seen():
    return observe(RIG, scene_of("paper"), DRIVE)


def test_the_press_agrees_with_the_reference_to_a_count(seen):
    """Encoders in integer counts: one count of difference moves the finger by 0.6 um."""
    true, _ = press_solved("paper")
    for name in ("contacts", "releases", "returns"):
        (found,), (exact,) = getattr(seen.events, name), getattr(true.events, name)
        assert found.time == pytest.approx(exact.time, abs=5e-6)
    moved = seen.motions
    angle = np.interp(moved.time, true.motions.time, true.motions.angle)
    count = RADIANS * RIG.arm.upper_length / RIG.key.press_arm
    np.testing.assert_allclose(moved.angle, angle, rtol=0, atol=3 * count)


def test_the_servos_finger_force_is_the_models(seen):
    """Inverse dynamics of the simulated motion, smoothed over a millisecond."""
    moved, events = seen.motions, seen.events
    time, once = np.unique(moved.time, return_index=True)
    acceleration = np.interp(moved.time, time, np.gradient(moved.angular_velocity[once], time))
    angle = Motion(moved.angle, moved.angular_velocity, acceleration)
    string = rig_pluck(RIG).force_on_jack(moved.rise - RIG.jack.string_clearance)
    release = events.releases[0].time
    expected = finger_force(RIG, angle, string * (moved.time < release))
    error = np.convolve(moved.finger_force - expected, np.full(10, 0.1), "same")
    held = (moved.time > events.contacts[0].time) & (moved.time < release - 2e-3)
    assert np.sqrt(np.mean(error[held] ** 2)) < 0.02 * expected[held].max()


@pytest.mark.parametrize("powered", [True, False])
def test_a_standing_arm_is_held(powered):
    world = new_world(RIG, scene_of("paper"), HOVER)
    before = world.finger.joints()
    for _ in range(500):
        moved = world.advance(at_rest, powered)
    np.testing.assert_allclose(world.finger.joints(), before, atol=1e-9)
    np.testing.assert_allclose(moved.angle, 0, atol=1e-9)
    np.testing.assert_array_equal(moved.finger_force, 0)
    assert world.finger.settled
    expected = gravity_torque(RIG.arm, np.array(before)) if powered else (0.0, 0.0)
    np.testing.assert_allclose(world.finger.torques(), expected, atol=1e-6)


def test_power_that_goes_off_and_on_again_leaves_the_arm_where_it_is():
    world = new_world(RIG, scene_of("paper"), HOVER)
    for powered in (True, False, True, False, True):
        for _ in range(40):
            world.advance(at_rest, powered)
    np.testing.assert_allclose(world.finger.joints(), HOVER, atol=1e-9)
    assert world.worst_gap < 1e-9


def stepped(counts):
    world = new_world(RIG, scene_of("paper"), HOVER)
    for _ in range(20):
        world.advance(at_rest, True)
    jump = np.array([counts, -counts], float)

    def reference_of(fractions):
        return np.tile(jump, (len(fractions), 1)), np.zeros((len(fractions), 2))

    joints, torques = [], []
    for _ in range(1500):
        world.advance(reference_of, True)
        joints.append(world.finger.joints())
        torques.append(world.finger.torques())
    return (np.array(joints) - HOVER) / RADIANS / jump, np.array(torques), world


def test_a_step_settles():
    """1 mrad: bounded overshoot, settled within 1.5 s."""
    response, torques, world = stepped(318)
    assert np.abs(torques).max() < RIG.arm.torque_limit
    assert response.min() > -0.5
    assert response.max() < 2
    late = response[1000:]
    np.testing.assert_allclose(late, 1, atol=0.05)
    assert np.ptp(late[:250], axis=0).max() >= np.ptp(late[250:], axis=0).max()
    assert world.finger.settled


def test_a_large_step_is_limited_in_torque():
    """0.1 rad requires more than the torque limit."""
    response, torques, world = stepped(31_831)
    assert np.abs(torques).max() == pytest.approx(RIG.arm.torque_limit, rel=1e-12)
    np.testing.assert_allclose(response[1200:], 1, atol=0.05)
    assert world.worst_gap < 1e-6


def test_a_finger_that_falls_on_the_key_lands_on_it():
    """From 15 mm above, at about 0.3 m/s: no penetration and no rebound."""
    world = new_world(RIG, scene_of("paper", **MUTE), HOVER)
    jump = (PLAN.segments.start - PLAN.hover).astype(float)

    def down(fractions):
        return np.tile(jump, (len(fractions), 1)), np.zeros((len(fractions), 2))

    world.advance(at_rest, True)
    moved = [world.advance(down, True) for _ in range(200)]
    force = np.concatenate([m.finger_force + m.blow for m in moved])
    assert force.max() > 1
    assert world.worst_gap < 1e-6
