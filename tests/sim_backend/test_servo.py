"""The position loops against closed forms; the servo's free arm against its equations of motion."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sautereau.rig.load import with_values
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.parts import Servo
from sautereau.sim_backend.physics.finger import LoopedFinger
from sautereau.sim_backend.physics.laws import close_loop
from sautereau.sim_backend.physics.parameters import finger_of
from sautereau.sim_backend.physics.structures import as_objects
from sautereau.sim_backend.physics.world import new_world
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.dynamics import gravity_torque, joint_torques, mass_matrix
from sautereau.trajectory.motion import Motion
from tests.sim_backend.scenes import RIG, scene_of

PERIOD = RIG.controller.sample_period

START = (0.3, -1.6)
SAMPLES = 60
LIMP = Servo.model_validate(
    {
        "stiffness": ["0 N m/rad"] * 2,
        "damping": ["0 N m s/rad"] * 2,
        "integral_time": "1 s",
        "feedforward": ["1 kg m^2"] * 2,
    }
)
"""Servo without feedback: torque from the feedforward, and the weight at power-on."""


@pytest.fixture
def servo():
    return load_scene("paper").servo


class Loops(LoopedFinger):
    """The position loops of an arm that a test holds, where its encoders are 0."""

    def __init__(self, servo):
        scene = load_scene("paper").model_copy(update={"servo": servo})
        (record,) = as_objects(finger_of(RIG, scene, (0.0, 0.0)))
        super().__init__(record, RIG.arm, scene.gravity)
        self.place = 0.3, -1.2
        self.switch(True)

    def joints(self):
        return self.place

    def torque(self, counts, accelerations):
        """Return the torques by a reference so many counts from the arm, with accelerations."""
        for j in range(2):
            lag = counts[j] * RIG.arm.radians_per_count
            close_loop(self._loops, j, lag, accelerations[j], PERIOD)
        return self.torques()


@pytest.fixture
def loops(servo):
    return Loops(servo)


def weight_torque(joints):
    return tuple(gravity_torque(RIG.arm, np.array(joints)).tolist())


def test_each_term_of_the_pid(loops, servo):
    """P on the error, D on its change, feedforward on acceleration; then the integral."""
    weight = weight_torque((0.3, -1.2))
    lag = 100 * 2 * math.pi / RIG.arm.counts_per_revolution
    first = loops.torque((100, 0), (0, 5.0))
    expected = servo.stiffness[0] * lag + servo.damping[0] * lag / PERIOD + weight[0]
    assert first[0] == pytest.approx(expected, rel=1e-12)
    assert first[1] == pytest.approx(servo.feedforward[1] * 5.0 + weight[1], rel=1e-12)
    second = loops.torque((100, 0), (0, 0))
    integral = servo.stiffness[0] * lag * PERIOD / servo.integral_time
    assert second[0] == pytest.approx(servo.stiffness[0] * lag + integral + weight[0], rel=1e-12)
    assert second[1] == pytest.approx(weight[1], rel=1e-12)


@pytest.mark.parametrize("counts", [1e5, -1e5, 1e12])
def test_the_torque_limit_is_respected(loops, counts):
    for _ in range(20):
        torque = loops.torque((counts, -counts), (0, 0))
        assert np.abs(torque).max() <= RIG.arm.torque_limit
    assert torque == (math.copysign(2.0, counts), -math.copysign(2.0, counts))


def test_saturation_does_not_wind_the_integral_up(loops):
    for _ in range(1000):
        loops.torque((1e6, 1e6), (0, 0))
    loops.torque((0, 0), (0, 0))
    assert loops.torque((0, 0), (0, 0)) == pytest.approx(weight_torque((0.3, -1.2)), rel=1e-12)


def geared(first, second):
    inertias = [f"{first} kg m^2", f"{second} kg m^2"]
    return with_values(RIG, {"arm.rotor_inertias": inertias, "arm.gear_ratios": [30.0, 30.0]})


def swung(rig, steps):
    """Return joints [rad] and torques [N m] of the stand-in's arm under constant torques."""
    period = rig.controller.sample_period
    scene = load_scene("paper").model_copy(
        update={"engine": "rigid", "servo": LIMP, "step": period / steps}
    )
    world = new_world(rig, scene, START)
    speeds = np.array([[0.0, 0.0], [0.08, -0.01]]) * period**2 / world.radians_per_count
    for _ in range(SAMPLES):
        world.advance(lambda fractions: (np.zeros((len(fractions), 2)), speeds), True)
    return np.array(world.finger.joints()), np.array(world.finger.torques())


def solved(arm, torque, duration):
    def rate(_, state):
        joints, speed = np.split(state, 2)
        rest = joint_torques(arm, Motion(joints, speed, np.zeros(2)))
        return np.concatenate([speed, np.linalg.solve(mass_matrix(arm, joints), torque - rest)])

    state = np.concatenate([START, np.zeros(2)])
    return solve_ivp(rate, (0, duration), state, rtol=1e-10, atol=1e-12).y[:2, -1]


@pytest.mark.parametrize("rotor", [0, 2e-6])
def test_the_free_arm_follows_its_equations(rotor):
    """Second order: half the step gives a quarter of the error."""
    rig = geared(rotor, 0)
    coarse, torque = swung(rig, 5)
    fine, _ = swung(rig, 10)
    exact = solved(rig.arm, torque, SAMPLES * rig.controller.sample_period)
    assert np.abs(exact - START).min() > 0.03
    np.testing.assert_allclose(fine, exact, rtol=0, atol=1e-7)
    np.testing.assert_allclose((coarse - exact) / (fine - exact), 4, rtol=0.05)


def test_joint_2s_rotor_is_refused():
    with pytest.raises(SceneError, match=r"rotor_inertias: joint 2's .* 0\.0009 kg m\^2 .*truth"):
        new_world(geared(0, 1e-6), scene_of("paper"))


def test_engaging_again_resets_the_integral(loops):
    for _ in range(10):
        loops.torque((50, -50), (0, 0))
    loops.switch(False)
    loops.place = (0.1, -1.0)
    loops.switch(True)
    assert loops.torque((0, 0), (0, 0)) == weight_torque((0.1, -1.0))
