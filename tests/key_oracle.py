"""The equation of motion of the key with one jack, as docs/stand-in.md writes it.

An oracle for engines and models: it takes numbers from a rig, and imports none of the code that it
judges. With the key's angle a and the jack's rise r(a) = b tan a + hb (1 / cos a - 1), and without
a fingertip,

    (I + m r'^2) a'' = M - r' (m (g + r'' a'^2) + S + f) - c a' - tau - a_p felt,

for a rising key; the jack's terms vanish once it has left the key.
"""

import numpy as np
from scipy.integrate import solve_ivp

GRAVITY = 9.80665  # m/s^2


def rise(key, angle):
    """Return the rise of a jack on the key [m]."""
    return key.jack_arm * np.tan(angle) + key.jack_surface_height * (1 / np.cos(angle) - 1)


def slope(key, angle):
    """Return dr/da [m/rad]."""
    return (key.jack_arm + key.jack_surface_height * np.sin(angle)) / np.cos(angle) ** 2


def curvature(key, angle):
    """Return d2r/da2 [m/rad^2]."""
    sine = np.sin(angle)
    twist = 2 * key.jack_arm * sine + key.jack_surface_height * (1 + sine**2)
    return twist / np.cos(angle) ** 3


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


def acceleration(rig, angle, omega, moment, string=0.0, *, friction=False, felt=False, jack=True):
    """Return a'' [rad/s^2] of a rising key under a moment [N m]; `jack` is whether it stands."""
    key, inertia = rig.key, rig.key.inertia
    moment = moment + key.gravity_moment
    if friction:
        moment -= key.pivot_coulomb_friction + key.pivot_viscous_friction * omega
    if felt:
        depth = key.press_arm * angle - key.dip
        law = key.felt_stiffness * depth + key.felt_damping * key.press_arm * omega
        moment -= key.press_arm * max(0.0, law)
    if jack:
        by_angle, mass = slope(key, angle), rig.jack.mass
        load = mass * (GRAVITY + curvature(key, angle) * omega**2) + string
        moment -= by_angle * (load + friction * rig.jack.register_friction)
        inertia += mass * by_angle**2
    return moment / inertia


def solved(rig, force, start, until, *, pluck=None, stop=None, **parts):
    """Integrate the key's equation from a time and state; return the time and state at the end.

    Args:
        rig: The bench.
        force: N, at the pressing point.
        start: s, and angle and angular velocity there.
        until: s, end at the latest.
        pluck: With `force_on_jack`, of a held string; None for no string.
        stop: Function of time and state at whose root the integration ends.
        parts: As in `acceleration`.
    """

    def rates(_, state):
        angle, omega = state
        string = 0.0
        if pluck is not None:
            height = rise(rig.key, angle) - rig.jack.string_clearance
            string = float(pluck.force_on_jack(max(height, 0.0)))
        moment = rig.key.press_arm * force
        return [omega, acceleration(rig, angle, omega, moment, string, **parts)]

    if stop is not None:
        stop.terminal = True
    time, state = start
    events = [] if stop is None else [stop]
    done = solve_ivp(
        rates, (time, until), state, "DOP853", events=events, rtol=1e-11, atol=1e-15, max_step=2e-4
    )
    return done.t[-1], done.y[:, -1]


def at_rise(key, goal):
    """Return a stop of `solved` where the jack on the key has a rise [m]."""
    return lambda _, state: rise(key, state[0]) - goal


def plucked(rig, force, pluck, until=1.0, **parts):
    """Return (time, state) of a pushed key at contact and at release."""
    clearance = rig.jack.string_clearance
    contact = solved(
        rig, force, (0.0, [0.0, 0.0]), until, stop=at_rise(rig.key, clearance), **parts
    )
    top = at_rise(rig.key, clearance + pluck.release_height)
    return contact, solved(rig, force, contact, until, pluck=pluck, stop=top, **parts)


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
