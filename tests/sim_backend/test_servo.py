"""The position loops alone, against closed forms."""

import math

import numpy as np
import pytest

from sautereau.rig.load import load_rig
from sautereau.rig.section import GRAVITY
from sautereau.sim_backend.physics.servo import PositionLoops, weight_torque
from sautereau.sim_backend.scene import load_scene

PERIOD = 976.5625e-6


@pytest.fixture
def arm():
    return load_rig("paper").arm


@pytest.fixture
def servo():
    return load_scene("paper").servo


@pytest.fixture
def loops(servo, arm):
    return PositionLoops(servo, arm, PERIOD)


def potential(arm, joints):
    """Return the potential energy [J] of the links' weight."""
    elbow = arm.upper_length * math.sin(joints[0])
    return GRAVITY * (
        arm.upper_mass * elbow / 2
        + arm.lower_mass * (elbow + arm.lower_length / 2 * math.sin(joints[0] + joints[1]))
    )


@pytest.mark.parametrize("joints", [(0.0, -1.5), (0.4, -0.9), (-1.2, -2.0)])
def test_weight_torque_is_the_gradient_of_the_potential(arm, joints):
    step = 1e-5
    for j in (0, 1):
        up, down = list(joints), list(joints)
        up[j] += step
        down[j] -= step
        slope = (potential(arm, up) - potential(arm, down)) / (2 * step)
        assert weight_torque(arm, joints)[j] == pytest.approx(slope, rel=1e-8)


def test_a_stretched_arm_by_hand(arm):
    """0.15 kg at 60 mm and 0.10 kg at 170 mm."""
    first, second = weight_torque(arm, (0.0, 0.0))
    assert first == pytest.approx((0.15 * 0.06 + 0.10 * 0.17) * GRAVITY, rel=1e-12)
    assert second == pytest.approx(0.10 * 0.05 * GRAVITY, rel=1e-12)


def test_at_rest_the_torque_balances_the_weight(loops, arm):
    loops.engage((0.3, -1.2))
    for _ in range(50):
        assert loops.torque((0, 0), (0, 0)) == weight_torque(arm, (0.3, -1.2))


def test_each_term_of_the_pid(loops, servo, arm):
    """P on the error, D on its change, feedforward on acceleration; then the integral."""
    loops.engage((0.3, -1.2))
    weight = weight_torque(arm, (0.3, -1.2))
    lag = 100 * 2 * math.pi / arm.counts_per_revolution
    first = loops.torque((100, 0), (0, 5.0))
    expected = servo.stiffness[0] * lag + servo.damping[0] * lag / PERIOD + weight[0]
    assert first[0] == pytest.approx(expected, rel=1e-12)
    assert first[1] == pytest.approx(servo.feedforward[1] * 5.0 + weight[1], rel=1e-12)
    second = loops.torque((100, 0), (0, 0))
    integral = servo.stiffness[0] * lag * PERIOD / servo.integral_time
    assert second[0] == pytest.approx(servo.stiffness[0] * lag + integral + weight[0], rel=1e-12)
    assert second[1] == pytest.approx(weight[1], rel=1e-12)


@pytest.mark.parametrize("counts", [1e5, -1e5, 1e12])
def test_the_torque_limit_is_respected(loops, arm, counts):
    loops.engage((0.3, -1.2))
    for _ in range(20):
        torque = loops.torque((counts, -counts), (0, 0))
        assert np.abs(torque).max() <= arm.torque_limit
    assert torque == (math.copysign(2.0, counts), -math.copysign(2.0, counts))


def test_saturation_does_not_wind_the_integral_up(loops, arm):
    loops.engage((0.3, -1.2))
    for _ in range(1000):
        loops.torque((1e6, 1e6), (0, 0))
    loops.torque((0, 0), (0, 0))
    assert loops.torque((0, 0), (0, 0)) == pytest.approx(weight_torque(arm, (0.3, -1.2)), rel=1e-12)


def test_engaging_again_resets_the_integral(loops, arm):
    loops.engage((0.3, -1.2))
    for _ in range(10):
        loops.torque((50, -50), (0, 0))
    loops.engage((0.1, -1.0))
    assert loops.torque((0, 0), (0, 0)) == weight_torque(arm, (0.1, -1.0))
