"""Dynamics of the arm: energy, virtual work, rods made of points, and another library."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.rig.load import load_rig
from sautereau.rig.units import GRAVITY
from sautereau.trajectory.arm import fingertip_motion
from sautereau.trajectory.dynamics import (
    armature,
    gravity_torque,
    joint_torques,
    mass_matrix,
)
from sautereau.trajectory.motion import Motion, dot
from tests.key_oracle import arm_energy
from tests.trajectory.brute_force import close, derivatives

PAPER = load_rig().arm
ROD = (0.5 - np.sqrt(1 / 12), 0.5 + np.sqrt(1 / 12))
"""Gauss's points of a rod: half its mass at each has the inertia and weight of the rod."""


@st.composite
def arms(draw, rotors=True):
    def pair(low, high):
        return draw(st.floats(low, high)), draw(st.floats(low, high))

    lengths, masses = pair(0.06, 0.25), pair(0.03, 0.5)
    return PAPER.model_copy(
        update={
            "upper_length": lengths[0],
            "lower_length": lengths[1],
            "upper_mass": masses[0],
            "lower_mass": masses[1],
            "rotor_inertias": pair(0, 1e-5) if rotors else (0.0, 0.0),
            "gear_ratios": pair(0.1, 100),
        }
    )


def seeds():
    return st.integers(0, 2**32 - 1)


def states(seed, n=20):
    """Random joint angles, speeds and accelerations, each (n, 2)."""
    rng = np.random.default_rng(seed)
    return Motion(*(rng.uniform(-b, b, (n, 2)) for b in (np.pi, 6.0, 200.0)))


def swing(seed, time):
    """A random smooth motion over a second, arrays (n, 2)."""
    rng = np.random.default_rng(seed)
    level, size, phase = rng.uniform(-np.pi, np.pi, (3, 2, 3))
    omega = rng.uniform(1, 12, (2, 3))
    turn = omega * time[:, None, None] + phase
    return Motion(
        (level + size * np.sin(turn)).sum(-1) / 3,
        (size * omega * np.cos(turn)).sum(-1) / 3,
        (-size * omega**2 * np.sin(turn)).sum(-1) / 3,
    )


def at_rest(joints):
    return Motion(joints, np.zeros_like(joints), np.zeros_like(joints))


@given(arms(), seeds())
def test_the_mass_matrix_is_symmetric_and_positive(arm, seed):
    matrix = mass_matrix(arm, states(seed).position)
    np.testing.assert_array_equal(matrix, matrix.swapaxes(-1, -2))
    assert np.linalg.eigvalsh(matrix).min() > 0


@given(arms(), seeds())
def test_a_tip_force_by_virtual_work(arm, seed):
    """Its joint torques are its work along each joint."""
    joints = states(seed)
    force = np.random.default_rng(seed).uniform(-5, 5, (20, 2))
    spared = joint_torques(arm, joints) - joint_torques(arm, joints, force)
    still = at_rest(joints.position)
    for j, axis in enumerate(np.eye(2)):
        moved = fingertip_motion(arm, still._replace(velocity=np.tile(axis, (20, 1))))
        close(spared[:, j], dot(force, moved.velocity), 1e-11)


def points(arm):
    """Masses [kg] that a rod can be made of, and arms whose fingertips they are."""
    for share in ROD:
        yield arm.upper_mass / 2, {"upper_length": share * arm.upper_length, "lower_length": 0.0}
        yield arm.lower_mass / 2, {"lower_length": share * arm.lower_length}


@given(arms(rotors=False), seeds())
def test_the_rods_are_points_by_dalembert(arm, seed):
    """The torque on each joint is the inertia and weight of four points along their paths."""
    joints = states(seed)
    up = np.array([0.0, GRAVITY])
    torque = np.zeros((20, 2))
    for mass, lengths in points(arm):
        point = arm.model_copy(update=lengths)
        force = mass * (fingertip_motion(point, joints).acceleration + up)
        for j, axis in enumerate(np.eye(2)):
            turned = at_rest(joints.position)._replace(velocity=np.tile(axis, (20, 1)))
            torque[:, j] += dot(force, fingertip_motion(point, turned).velocity)
    close(joint_torques(arm, joints), torque, 1e-12)


def test_a_rotor_counts_with_its_gear_ratio_squared():
    arm = PAPER.model_copy(update={"rotor_inertias": (2e-6, 1e-6), "gear_ratios": (10.0, 30.0)})
    assert armature(arm) == pytest.approx((2e-4, 9e-4), rel=1e-15)
    joints = states(1)
    added = joint_torques(arm, joints) - joint_torques(PAPER, joints)
    close(added, joints.acceleration * [2e-4, 9e-4], 1e-12)


def test_a_level_arm_by_hand():
    """Two aligned horizontal rods of 0.15 and 0.10 kg about joint 1."""
    still = at_rest(np.zeros((1, 2)))
    assert gravity_torque(PAPER, still.position)[0] == pytest.approx(
        [GRAVITY * (0.15 * 0.06 + 0.10 * 0.17), GRAVITY * 0.10 * 0.05], rel=1e-14
    )
    inertia = 0.15 * 0.12**2 / 3 + 0.10 * (0.1**2 / 12 + 0.17**2)
    assert mass_matrix(PAPER, still.position)[0, 0, 0] == pytest.approx(inertia, rel=1e-14)
    assert joint_torques(PAPER, still, np.array([[0.0, 1.0]]))[0] == pytest.approx(
        gravity_torque(PAPER, still.position)[0] - [0.22, 0.10], rel=1e-14
    )


def peer_model(pin, arm):
    """The same arm in pinocchio; joints turn from x to z, which is about -y."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    joint, place = 0, pin.SE3.Identity()
    rods = ((arm.upper_mass, arm.upper_length), (arm.lower_mass, arm.lower_length))
    for number, (mass, length) in enumerate(rods, 1):
        axis = pin.JointModelRevoluteUnaligned(np.array([0.0, -1.0, 0.0]))
        joint = model.addJoint(joint, axis, place, f"joint {number}")
        moment = np.diag([0.0, 1.0, 1.0]) * mass * length**2 / 12
        rod = pin.Inertia(mass, np.array([length / 2, 0.0, 0.0]), moment)
        model.appendBodyToJoint(joint, rod, pin.SE3.Identity())
        place = pin.SE3(np.eye(3), np.array([length, 0.0, 0.0]))
    model.armature = np.array(armature(arm))
    return model


def peer_torques(pin, arm, model, joints, forces):
    data, found = model.createData(), []
    for position, velocity, acceleration, force in zip(*joints, forces, strict=True):
        pin.forwardKinematics(model, data, position)
        tip = data.oMi[2].act(np.array([arm.lower_length, 0.0, 0.0]))
        push = np.array([force[0], 0.0, force[1]])
        world = pin.Force(push, np.cross(tip, push))
        external = [pin.Force.Zero(), pin.Force.Zero(), data.oMi[2].actInv(world)]
        found.append(pin.rnea(model, data, position, velocity, acceleration, external).copy())
    return np.array(found)


@given(arms(), seeds())
def test_pinocchio_finds_the_same(arm, seed):
    pin = pytest.importorskip("pinocchio", reason="a peer; install it with --group peers")
    joints, model = states(seed), peer_model(pin, arm)
    forces = np.random.default_rng(seed).uniform(-5, 5, (20, 2))
    close(joint_torques(arm, joints, forces), peer_torques(pin, arm, model, joints, forces), 1e-9)
    data = model.createData()
    matrices, energies = [], []
    for position, velocity in zip(joints.position, joints.velocity, strict=True):
        matrices.append(pin.crba(model, data, position).copy())
        energies.append(pin.computeMechanicalEnergy(model, data, position, velocity))
    close(mass_matrix(arm, joints.position), np.array(matrices), 1e-9)
    rotors = joints.velocity**2 @ armature(arm) / 2  # not included in its energy
    close(arm_energy(arm, joints) - rotors, np.array(energies), 1e-9)


@given(arms(), seeds())
def test_gravity_torque_is_the_slope_of_the_energy(arm, seed):
    joints = states(seed).position
    for j, axis in enumerate(np.eye(2)):

        def potential(turn, axis=axis):
            return arm_energy(arm, at_rest(joints + turn * axis))

        slope, _ = derivatives(potential, 0.0, 0.05)
        close(gravity_torque(arm, joints)[:, j], slope, 1e-10)


@given(arms(), seeds())
def test_the_motors_work_is_the_energy_gained(arm, seed):
    """With an external force on the fingertip, whose work is subtracted."""
    nodes, weights = np.polynomial.legendre.leggauss(80)
    time = (nodes + 1) / 2
    joints = swing(seed, time)
    force = np.random.default_rng(seed).uniform(-2, 2, 2) * np.cos(9 * time)[:, None]
    torque = joint_torques(arm, joints, force)
    power = dot(torque, joints.velocity) + dot(force, fingertip_motion(arm, joints).velocity)
    before, after = arm_energy(arm, swing(seed, np.array([0.0, 1.0])))
    scale = weights @ np.abs(power) / 2 + abs(before) + abs(after)
    assert abs(weights @ power / 2 - (after - before)) <= 1e-9 * scale
