"""Rigid-body dynamics of the two-link finger: slender rods, and rotors behind gears.

M(q) q'' + c(q, q') + g(q) = torque + J^T tip_force, for joint 2 measured from link 1.
A rotor adds its inertia times the squared gear ratio to its own joint (the armature).
The rotation of the second rotor with link 1 is neglected: its effect is smaller than the armature
by the gear ratio, and equal to it without a gear.
"""

import numpy as np

from sautereau.rig.schema import Arm
from sautereau.rig.units import GRAVITY
from sautereau.trajectory.arm import link_vectors
from sautereau.trajectory.motion import Floats, Motion, dot


def armature(arm: Arm) -> tuple[float, float]:
    """Return the inertia [kg m^2] that each rotor has at its joint."""
    (rotor1, rotor2), (gear1, gear2) = arm.rotor_inertias, arm.gear_ratios
    return rotor1 * gear1**2, rotor2 * gear2**2


def mass_matrix(arm: Arm, joints: Floats) -> Floats:
    """Return M [kg m^2], shape (n, 2, 2), at joint angles [rad] of shape (n, 2)."""
    upper = (arm.upper_mass / 3 + arm.lower_mass) * arm.upper_length**2
    lower = arm.lower_mass * arm.lower_length**2 / 3
    coupling = _coupling(arm) * np.cos(joints[..., 1])
    armature1, armature2 = armature(arm)
    matrix = np.empty((*joints.shape, 2))
    matrix[..., 0, 0] = upper + lower + 2 * coupling + armature1
    matrix[..., 0, 1] = matrix[..., 1, 0] = lower + coupling
    matrix[..., 1, 1] = lower + armature2
    return matrix


def gravity_torque(arm: Arm, joints: Floats) -> Floats:
    """Return the torques [N m] that balance the links' weight; shape (n, 2)."""
    upper = GRAVITY * (arm.upper_mass / 2 + arm.lower_mass) * arm.upper_length
    lower = GRAVITY * arm.lower_mass * arm.lower_length / 2
    first, total = joints[..., 0], joints.sum(-1)
    torque2 = lower * np.cos(total)
    return np.stack([upper * np.cos(first) + torque2, torque2], -1)


def joint_torques(arm: Arm, joints: Motion, tip_force: Floats | None = None) -> Floats:
    """Return the torques [N m] of a motion by inverse dynamics; shape (n, 2).

    Args:
        joints: rad, arrays of shape (n, 2).
        tip_force: N, external force on the fingertip's centre, shape (n, 2); None for none.
    """
    inertial = np.einsum("...ij,...j", mass_matrix(arm, joints.position), joints.acceleration)
    torque = inertial + _centrifugal(arm, joints) + gravity_torque(arm, joints.position)
    if tip_force is not None:
        torque = torque - tip_torque(arm, joints.position, tip_force)
    return torque


def _coupling(arm: Arm) -> float:
    """Return the coupling inertia [kg m^2] of the links, to multiply by cos of joint 2."""
    return arm.lower_mass * arm.upper_length * arm.lower_length / 2


def _centrifugal(arm: Arm, joints: Motion) -> Floats:
    """Return c [N m], centrifugal and Coriolis torques; shape (n, 2)."""
    speed1, speed2 = joints.velocity[..., 0], joints.velocity[..., 1]
    twist = _coupling(arm) * np.sin(joints.position[..., 1])
    return np.stack([-twist * (2 * speed1 + speed2) * speed2, twist * speed1**2], -1)


def tip_torque(arm: Arm, joints: Floats, force: Floats) -> Floats:
    """Return J^T force [N m], with J the Jacobian of the fingertip's centre; shape (n, 2)."""
    _, upper = link_vectors(arm.upper_length, joints[..., 0])
    _, lower = link_vectors(arm.lower_length, joints.sum(-1))
    return np.stack([dot(upper + lower, force), dot(lower, force)], -1)
