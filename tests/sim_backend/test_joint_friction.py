"""Friction and backlash of the servo's joints, against closed forms."""

import math

import numpy as np
import pytest

from sautereau.rig.load import with_values
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.parts import Joints, Servo
from sautereau.sim_backend.physics.world import new_world
from sautereau.sim_backend.scene import load_scene, parse_scene
from sautereau.trajectory.dynamics import gravity_torque, mass_matrix
from tests.presses import MUTE_TEXT
from tests.sim_backend.scenes import RIG

PERIOD = RIG.controller.sample_period
START = (0.3, -1.6)
LIMP = Servo.model_validate(
    {
        "stiffness": ["0 N m/rad"] * 2,
        "damping": ["0 N m s/rad"] * 2,
        "integral_time": "1 s",
        "feedforward": ["1 kg m^2"] * 2,
    }
)
"""Servo without feedback: torque from the feedforward, and the weight at power-on."""
ROTORS = with_values(
    RIG, {"arm.rotor_inertias": ["1e-4 kg m^2"] * 2, "arm.gear_ratios": [1.0, 1.0]}
)


def arm_of(rig, start=START, steps=10, **joints):
    """Return the world of an arm in the air without feedback."""
    parts = {"servo": LIMP, "joints": Joints.model_validate(joints), "gravity": 0.0}
    parts |= {"engine": "rigid", "step": PERIOD / steps}
    return new_world(rig, load_scene("paper").model_copy(update=parts), start)


def driven(world, samples, torques):
    """Advance with constant torques [N m], as of a feedforward of 1 kg m^2; return the joints."""
    speeds = np.array([[0.0, 0.0], torques]) * PERIOD**2 / world.radians_per_count

    def reference(fractions):
        return np.zeros((len(fractions), 2)), speeds

    for _ in range(samples):
        world.advance(reference, True)
    return np.array(world.finger.joints())


def test_a_joint_sticks_below_its_dry_friction_and_yields_above_it():
    friction = ["50 mN m", "20 mN m"]
    world = arm_of(RIG, dry_friction=friction)
    np.testing.assert_allclose(driven(world, 50, (0.049, 0.0)), START, atol=1e-9)
    world = arm_of(RIG, dry_friction=friction)
    turned = driven(world, 50, (0.06, 0.0)) - START
    assert turned[0] > 1e-3


def test_the_sliding_joint_accelerates_by_what_exceeds_the_friction():
    """One joint, the other held by its friction: a = (torque - f) / I."""
    world = arm_of(RIG, dry_friction=["30 mN m", "1 N m"], steps=20)
    n = 40
    turned = driven(world, n, (0.08, 0.0)) - START
    inertia = mass_matrix(RIG.arm, np.array(START))[0, 0]
    assert turned[0] == pytest.approx(0.05 / inertia * (n * PERIOD) ** 2 / 2, rel=1e-3)
    assert turned[1] == pytest.approx(0, abs=1e-9)


def test_viscous_friction_limits_the_speed():
    """w = M / c (1 - exp(-c t / I))."""
    world = arm_of(
        RIG, dry_friction=["0 N m", "1 N m"], viscous_friction=["0.2 N m s/rad", "0 N m s/rad"]
    )
    n, moment, c = 60, 0.05, 0.2
    turned = driven(world, n, (moment, 0.0))[0] - START[0]
    inertia, time = mass_matrix(RIG.arm, np.array(START))[0, 0], n * PERIOD
    decay = inertia / c * (1 - math.exp(-c * time / inertia))
    assert turned == pytest.approx(moment / c * (time - decay), rel=2e-3)


@pytest.mark.parametrize("joint", [0, 1])
def test_in_the_dead_zone_the_motor_turns_alone(joint):
    """By the backlash less what it has at the start, in its middle: then the link follows."""
    loose = ["0 deg", "0 deg"]
    loose[joint] = "2 deg"
    rig = (
        ROTORS
        if joint
        else with_values(ROTORS, {"arm.rotor_inertias": ["1e-4 kg m^2", "0 kg m^2"]})
    )
    world = arm_of(rig, backlash=loose)
    torque = [0.0, 0.0]
    torque[joint] = 0.01
    n = 15
    turned = (driven(world, n, torque) - START)[joint]
    assert turned == pytest.approx(0.01 / 1e-4 * (n * PERIOD) ** 2 / 2, rel=1e-6)
    assert turned < math.radians(1)
    assert links(world) == pytest.approx(START, abs=1e-12)
    motor = driven(world, 60, torque)[joint]
    assert links(world)[joint] > START[joint] + 0.01
    assert motor - links(world)[joint] <= math.radians(1) + 0.1 / 2000


def links(world):
    upper, lower = (link.value for link in world.finger.links)
    return upper, lower - upper


def test_dry_friction_of_the_motor_holds_it_within_the_backlash():
    world = arm_of(ROTORS, backlash=["1 deg", "1 deg"], dry_friction=["20 mN m"] * 2)
    np.testing.assert_allclose(driven(world, 50, (0.019, -0.019)), START, atol=1e-12)


def test_without_play_a_stiff_transmission_is_the_rigid_drive():
    """A backlash of a nanoradian: the joints turn together by M^-1 torque."""
    world = arm_of(
        ROTORS, steps=40, backlash=["1e-9 rad", "1e-9 rad"], gear_stiffness=["2e4 N m/rad"] * 2
    )
    n, torque = 30, np.array([0.05, 0.01])
    turned = driven(world, n, torque) - START
    rate = np.linalg.solve(mass_matrix(ROTORS.arm, np.array(START)), torque)
    np.testing.assert_allclose(turned, rate * (n * PERIOD) ** 2 / 2, rtol=0.02)


def test_a_powered_arm_holds_its_weight_at_the_lower_flank():
    """Under gravity the motor carries the link at the end of its play."""
    loose = Joints.model_validate({"backlash": ["10 mrad", "10 mrad"]})
    scene = load_scene("paper").model_copy(update={"joints": loose, "engine": "rigid"})
    heavy = with_values(ROTORS, {"arm.rotor_inertias": ["1e-3 kg m^2", "3e-4 kg m^2"]})
    world = new_world(heavy, scene, START)
    still = (np.zeros((2, 2)), np.zeros((2, 2)))
    for _ in range(600):
        world.advance(lambda fractions: still, True)
    motor, link = np.array(world.finger.joints()), np.array(links(world))
    sag = gravity_torque(ROTORS.arm, link) / 2000
    np.testing.assert_allclose(motor - link - sag, [0.005, 0.005 * np.sign(sag[1])], atol=2e-6)


def test_what_the_engines_and_rigs_do_not_carry_is_refused():
    loose = Joints.model_validate({"backlash": ["1 mrad", "0 mrad"]})
    scene = load_scene("paper").model_copy(update={"joints": loose})
    assert scene.with_engine().engine == "rigid"
    assert load_scene("paper").with_engine().engine == "exact"
    with pytest.raises(SceneError, match="the motor of joint 1 moves alone in it"):
        new_world(RIG, scene, START)
    (told,) = scene.unsolved
    assert "turn with their links without friction" in told
    assert "remove the table [joints]" in told
    with pytest.raises(SceneError, match='joints: it has no effect without finger = "servo"'):
        parse_scene(f'{MUTE_TEXT}[joints]\ndry_friction = ["1 N m", "1 N m"]\n')
