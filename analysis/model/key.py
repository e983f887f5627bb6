"""The rigid key under the finger: inverse dynamics of a press."""

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


def felt_force(
    travel: Floats,
    speed: Floats,
    dip: float | Floats,
    stiffness: float | Floats,
    damping: float | Floats,
) -> Floats:
    """Return the force [N] of the front felt on the key, referred to the pressing point.

    A spring and a damper that cannot pull; all arguments broadcast together.

    Args:
        travel: m, of the pressing point from rest.
        speed: m/s, of the pressing point.
        dip: m, travel at which the key reaches the felt.
        stiffness: N/m.
        damping: N s/m.
    """
    pressed = travel - dip
    return np.where(pressed > 0, np.maximum(stiffness * pressed + damping * speed, 0.0), 0.0)


def finger_force(rig: Rig, angle: Motion, string_force: Floats) -> Floats:
    """Return the finger force [N] normal to the key that a motion requires.

    F (a_p + mu h_f) = I a'' + friction - M_g + sum of N_j d(rise)/da over the jacks + a_p felt
    (paper, 2.2) with the static gravity moment M_g of the key (`key.gravity_moment`), the friction
    mu of the fingertip at the height h_f above the pin, which reverses with the key, and the force
    of the front felt once the key has reached it.

    Args:
        angle: Motion of the key [rad], arrays (n,).
        string_force: N, with which the strings push the jacks down, shape (choirs, n); or
            that of the first string alone, shape (n,).
    """
    key = rig.key
    friction = key.pivot_coulomb_friction * np.sign(angle.velocity)
    friction = friction + key.pivot_viscous_friction * angle.velocity
    moment = key.inertia * angle.acceleration + friction - key.gravity_moment
    forces = np.atleast_2d(string_force)
    for number, choir in enumerate(choirs(rig)):
        lever = key_of(rig, choir)
        force = forces[number] if number < len(forces) else np.zeros_like(angle.position)
        slope = rise_slope(lever, angle.position)
        bend = rise_curvature(lever, angle.position) * angle.velocity**2
        acceleration = slope * angle.acceleration + bend
        moment = moment + slope * jack_load(choir.jack, slope * angle.velocity, acceleration, force)
    travel, speed = key.press_arm * angle.position, key.press_arm * angle.velocity
    felt = felt_force(travel, speed, key.dip, key.felt_stiffness, key.felt_damping)
    rubbing = rig.arm.fingertip_friction * key.surface_height * np.sign(angle.velocity)
    return (moment + key.press_arm * felt) / (key.press_arm + rubbing)
