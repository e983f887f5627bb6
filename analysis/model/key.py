"""The rigid key under the finger: inverse dynamics of a press."""

import numpy as np

from analysis.model.plectrum.base import Floats
from rig.schema import GRAVITY, Rig
from trajectory.key import jack_motion, rise_slope
from trajectory.motion import Motion


def jack_load(rig: Rig, rise: Motion, string_force: Floats) -> Floats:
    """Return the force [N] of the jack's foot on the key; negative where it would lift off.

    Args:
        rig: The bench.
        rise: Of the jack [m], arrays (n,).
        string_force: N, with which the string pushes the jack down, shape (n,).
    """
    friction = rig.jack.register_friction * np.sign(rise.velocity)
    return rig.jack.mass * (rise.acceleration + GRAVITY) + string_force + friction


def finger_force(rig: Rig, angle: Motion, string_force: Floats) -> Floats:
    """Return the force [N] of the finger on the key's normal that makes a motion.

    F a_p = I a'' + friction - front heaviness + N_j d(rise)/da (paper, 2.2).

    Args:
        rig: The bench.
        angle: Of the key [rad], arrays (n,).
        string_force: N, with which the string pushes the jack down, shape (n,).
    """
    key = rig.key
    load = jack_load(rig, jack_motion(key, angle), string_force)
    friction = key.pivot_coulomb_friction * np.sign(angle.velocity)
    friction = friction + key.pivot_viscous_friction * angle.velocity
    moment = key.inertia * angle.acceleration + friction - key.front_heaviness
    return (moment + load * rise_slope(key, angle.position)) / key.press_arm
