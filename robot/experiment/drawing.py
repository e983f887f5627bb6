"""Arm, key and jack as lines in space, for a viewer."""

import math

import numpy as np

from sautereau.daq.file.recorded import Joints
from sautereau.rig.schema import Rig
from sautereau.trajectory.arm import base, fingertip_place, link_vectors
from sautereau.trajectory.key import contact_angle, rise_of_angle, surface_axes
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.urdf import JACK

RATE = 200.0  # Hz, largest rate of the drawings


def draw(rig: Rig, joints: Joints) -> tuple[Floats, dict[str, Floats], dict[str, Floats]]:
    """Return drawings of the rig while its joints moved.

    The key is in contact with the fingertip, or at rest below it.

    Returns:
        Times, s after the trigger, shape (n,); points of each line by name, m, shape
        (n, n_points, 3), in the frame of the key's geometry, whose plane is y = 0; and x and z, m,
        and angle, rad, of each link of the rig's URDF in this frame, shape (n, 3).
    """
    spacing = np.diff(joints.t).mean() if len(joints.t) > 1 else math.inf
    step = max(1, math.ceil(1 / (RATE * spacing)))
    q = np.stack([joints.q1, joints.q2], -1)[::step]
    upper, _ = link_vectors(rig.arm.upper_length, q[:, 0])
    shoulder = np.broadcast_to(base(rig.arm), upper.shape)
    tip = fingertip_place(rig.arm, q)
    key = rig.key
    angle = np.maximum(0.0, contact_angle(key.surface_height + rig.arm.fingertip_radius, tip))
    tangent, normal = surface_axes(angle)
    front = key.surface_height * normal - key.front_arm * tangent
    back = key.jack_surface_height * normal + key.jack_arm * tangent
    foot = key.jack_surface_height + rise_of_angle(key, angle)
    ends = [np.stack([np.full_like(foot, key.jack_arm), foot + up], -1) for up in (0.0, JACK)]
    lines = {
        "arm": [shoulder, shoulder + upper, tip],
        "key": [front, key.surface_height * normal, back],
        "jack": ends,
    }
    still = np.zeros_like(angle)
    frames = {
        "arm_1": (shoulder, q[:, 0]),
        "arm_2": (shoulder + upper, q.sum(1)),
        "key": (np.zeros_like(upper), angle),
        "jack": (ends[0], still),
    }
    return (
        joints.t[::step],
        {name: _in_space(points) for name, points in lines.items()},
        {name: np.column_stack([place, turned]) for name, (place, turned) in frames.items()},
    )


def _in_space(points: list[Floats]) -> Floats:
    """Return points of shape (n, n_points, 3) from those in the plane, each of shape (n, 2)."""
    flat = np.stack(points, 1)
    return np.stack([flat[..., 0], np.zeros(flat.shape[:2]), flat[..., 1]], -1)
