"""The rigid key under the finger: inverse dynamics of a press."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from sautereau.analysis.model.choirs import choirs, key_of
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.rig.instrument import Jack
from sautereau.rig.schema import Rig
from sautereau.rig.units import GRAVITY
from sautereau.trajectory.key import rise_curvature, rise_slope
from sautereau.trajectory.motion import Motion


def jack_load(jack: Jack, velocity: Floats, acceleration: Floats, string_force: Floats) -> Floats:
    """Return the force [N] of a jack on the key; negative where the jack would lift off.

    Args:
        velocity: m/s, of the jack, shape (n,).
        acceleration: m/s^2, of the jack, shape (n,).
        string_force: N, with which the string pushes the jack down, shape (n,).
    """
    friction = jack.register_friction * np.sign(velocity)
    return jack.mass * (acceleration + GRAVITY) + string_force + friction


def required_force(
    c: Mapping[str, Any], angle: Floats, omega: Floats, alpha: Floats, moment: Floats
) -> Floats:
    """Return the finger force [N] normal to the key that a motion requires.

    F (a_p + mu h_f sgn a') = I a'' + c a' + tau sgn a' - M_g + a_p felt + moment (docs/model.md).

    Args:
        c: Fields of `rig.key` and `fingertip_friction`; these and the others broadcast together.
        angle: rad, of the key.
        omega: rad/s.
        alpha: rad/s^2.
        moment: N m, of the jacks, against a rise.
    """
    side, arm = np.sign(omega), c["press_arm"]
    moment = moment + c["inertia"] * alpha - c["gravity_moment"]
    moment = moment + side * c["pivot_coulomb_friction"] + c["pivot_viscous_friction"] * omega
    pressed = arm * angle - c["dip"]
    felt = c["felt_stiffness"] * pressed + c["felt_damping"] * arm * omega
    moment = moment + arm * np.where(pressed > 0, np.maximum(felt, 0.0), 0.0)  # it cannot pull
    return moment / (arm + side * (c["fingertip_friction"] * c["surface_height"]))


def finger_force(rig: Rig, angle: Motion, string_force: Floats) -> Floats:
    """Return the finger force [N] of a motion (paper, 2.2); see `required_force`.

    Args:
        angle: Motion of the key [rad], arrays (n,).
        string_force: N, with which the strings push the jacks down, shape (choirs, n); or
            that of the first string alone, shape (n,).
    """
    moment, forces = np.zeros_like(angle.position), np.atleast_2d(string_force)
    for number, choir in enumerate(choirs(rig)):
        lever = key_of(rig, choir)
        force = forces[number] if number < len(forces) else np.zeros_like(angle.position)
        slope = rise_slope(lever, angle.position)
        bend = rise_curvature(lever, angle.position) * angle.velocity**2
        acceleration = slope * angle.acceleration + bend
        moment = moment + slope * jack_load(choir.jack, slope * angle.velocity, acceleration, force)
    c = {**vars(rig.key), "fingertip_friction": rig.arm.fingertip_friction}
    return required_force(c, *angle, moment)
