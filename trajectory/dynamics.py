"""Rigid-body dynamics of the two-link finger: slender rods, rotors behind gears.

M(q) q'' + c(q, q') + g(q) = torque + J^T(tip force), for joint 2 measured from link 1.
A rotor adds its inertia times the squared gear ratio to its own joint (the armature); what
it would add to the other joint is smaller by the gear ratio, and left out.
"""

import numpy as np

from rig.schema import GRAVITY, Arm
from trajectory.arm import link_vectors
from trajectory.motion import Floats, Motion, dot


def mass_matrix(arm: Arm, joints: Floats) -> Floats:
    """Return M [kg m^2] at joint angles [rad] of shape (n, 2); shape (n, 2, 2)."""
    coupling = arm.lower_mass * arm.upper_length * arm.lower_length / 2 * np.cos(joints[..., 1])
    lower = arm.lower_mass * arm.lower_length**2 / 3
    upper = arm.upper_mass * arm.upper_length**2 / 3 + arm.lower_mass * arm.upper_length**2
    first, second = armature(arm)
    matrix = np.empty((*joints.shape[:-1], 2, 2))
    matrix[..., 0, 0] = upper + lower + 2 * coupling + first
    matrix[..., 0, 1] = matrix[..., 1, 0] = lower + coupling
    matrix[..., 1, 1] = lower + second
    return matrix


def armature(arm: Arm) -> tuple[float, float]:
    """Return the inertia [kg m^2] that each rotor has at its joint."""
    first, second = (
        inertia * ratio**2
        for inertia, ratio in zip(arm.rotor_inertias, arm.gear_ratios, strict=True)
    )
    return first, second


def gravity_torque(arm: Arm, joints: Floats) -> Floats:
    """Return the torques [N m] that carry the links' weight; shape (n, 2)."""
    first, total = joints[..., 0], joints.sum(-1)
    second = arm.lower_mass * GRAVITY * arm.lower_length / 2 * np.cos(total)
    carried = (arm.upper_mass / 2 + arm.lower_mass) * GRAVITY * arm.upper_length * np.cos(first)
    return np.stack([carried + second, second], -1)


def joint_torques(arm: Arm, joints: Motion, tip_force: Floats | None = None) -> Floats:
    """Return the torques [N m] that make a motion; shape (n, 2).

    Args:
        arm: The arm.
        joints: rad, arrays of shape (n, 2).
        tip_force: N, of the world on the fingertip's centre, shape (n, 2); None for none.
    """
    speed = joints.velocity
    twist = arm.lower_mass * arm.upper_length * arm.lower_length / 2
    twist = -twist * np.sin(joints.position[..., 1])
    centrifugal = np.stack(
        [twist * (2 * speed[..., 0] + speed[..., 1]) * speed[..., 1], -twist * speed[..., 0] ** 2],
        -1,
    )
    inertial = np.einsum("...ij,...j", mass_matrix(arm, joints.position), joints.acceleration)
    torque = inertial + centrifugal + gravity_torque(arm, joints.position)
    if tip_force is not None:
        torque = torque - _tip_torque(arm, joints.position, tip_force)
    return torque


def energy(arm: Arm, joints: Motion) -> Floats:
    """Return kinetic and potential energy [J] together, shape (n,)."""
    first, total = joints.position[..., 0], joints.position.sum(-1)
    matrix = mass_matrix(arm, joints.position)
    kinetic = np.einsum("...i,...ij,...j", joints.velocity, matrix, joints.velocity) / 2
    height = (arm.upper_mass / 2 + arm.lower_mass) * arm.upper_length * np.sin(first)
    height = height + arm.lower_mass * arm.lower_length / 2 * np.sin(total)
    return kinetic + GRAVITY * height


def _tip_torque(arm: Arm, joints: Floats, force: Floats) -> Floats:
    """Return J^T force [N m], with J the fingertip's Jacobian; shape (n, 2)."""
    _, upper = link_vectors(arm.upper_length, joints[..., 0])
    _, lower = link_vectors(arm.lower_length, joints.sum(-1))
    return np.stack([dot(upper + lower, force), dot(lower, force)], -1)
