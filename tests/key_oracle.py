"""The equation of motion of the key with one jack, as docs/stand-in.md writes it.

An oracle for engines and models: it takes numbers from a rig, and imports none of the code that it
judges. With the key's angle a and the jack's rise r(a) = b tan a + hb (1 / cos a - 1), and without
a fingertip,

    (I + m r'^2) a'' = M - r' (m (g + r'' a'^2) + S + f) - c a' - tau - a_p felt,

for a rising key; the jack's terms vanish once it has left the key.
"""

import numpy as np

GRAVITY = 9.80665
"""m/s^2."""


def rise(key, angle):
    """Return the rise of a jack on the key [m]."""
    return key.jack_arm * np.tan(angle) + key.jack_surface_height * (1 / np.cos(angle) - 1)


def slope(key, angle):
    """Return dr/da [m/rad]."""
    return (key.jack_arm + key.jack_surface_height * np.sin(angle)) / np.cos(angle) ** 2


def energy(rig, angle, omega, height=None, speed=None):
    """Return the energy [J] of key and jack; of a jack off the key by its height and speed."""
    key, mass = rig.key, rig.jack.mass
    height = rise(key, angle) if height is None else height
    speed = slope(key, angle) * omega if speed is None else speed
    kinetic = key.inertia * omega**2 / 2 + mass * speed**2 / 2
    return kinetic + mass * GRAVITY * height - key.gravity_moment * angle


def dissipated_power(rig, angle, omega):
    """Return the power of all friction [W] for a jack on the key."""
    key = rig.key
    dry = key.pivot_coulomb_friction + rig.jack.register_friction * slope(key, angle)
    return key.pivot_viscous_friction * omega**2 + dry * np.abs(omega)


def static_moment(rig, angle=0.0, string=0.0, friction=0.0):
    """Return the moment [N m] that balances the key at rest.

    Args:
        rig: The bench.
        angle: rad.
        string: N, on the jack, downwards.
        friction: Dimensionless, fraction of the dry friction to overcome; -1 for a fall.
    """
    key, jack = rig.key, rig.jack
    load = jack.mass * GRAVITY + string + friction * jack.register_friction
    own = friction * key.pivot_coulomb_friction - key.gravity_moment
    return load * slope(key, angle) + own


def arm_energy(arm, joints):
    """Return kinetic and potential energy [J] of two slender rods and their rotors, shape (n,)."""
    first, total = joints.position[..., 0], joints.position.sum(-1)
    speed, turning = joints.velocity[..., 0], joints.velocity.sum(-1)
    upper, lower = arm.upper_length, arm.lower_length
    x = -upper * speed * np.sin(first) - lower / 2 * turning * np.sin(total)
    z = upper * speed * np.cos(first) + lower / 2 * turning * np.cos(total)
    rotors = np.array(arm.rotor_inertias) * np.array(arm.gear_ratios) ** 2
    kinetic = arm.upper_mass * (upper * speed) ** 2 / 6 + joints.velocity**2 @ rotors / 2
    kinetic += arm.lower_mass * ((x**2 + z**2) / 2 + (lower * turning) ** 2 / 24)
    height = arm.upper_mass * upper / 2 * np.sin(first)
    height += arm.lower_mass * (upper * np.sin(first) + lower / 2 * np.sin(total))
    return kinetic + GRAVITY * height
