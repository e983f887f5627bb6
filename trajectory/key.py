"""The key's geometry in closed form: jack, lever and the surface under the finger.

The plane is x (balance pin towards jack) and z (up), the origin is the pin, and the
angle a turns the key's surface tangent to (cos a, sin a) and its normal to (-sin a, cos a).
"""

import numpy as np
from numpy.typing import ArrayLike

from sautereau.rig.instrument import Key
from sautereau.rig.schema import Rig
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.motion import Floats, Motion, dot


def moving_inertia(rig: Rig) -> float:
    """Return the moment of inertia [kg m^2] of the key and all its jacks about the pin."""
    own = rig.key.inertia + rig.jack.mass * rig.key.jack_arm**2
    return own + sum(c.jack.mass * c.jack_arm**2 for c in rig.more_choirs)


def carried_force(rig: Rig, angle: Motion, against: ArrayLike = 0.0) -> Floats:
    """Return the force [N] of the finger on the key's normal that moves key and jacks as planned.

    A finger cannot pull: it is 0 where they decelerate by themselves.

    Args:
        angle: rad, of the key; arrays of any shape.
        against: N, of the finger in a slow press, by which string and weight resist.
    """
    inertial = moving_inertia(rig) / rig.key.press_arm * angle.acceleration
    return np.maximum(np.asarray(against) + inertial, 0.0)


def jack_law(key: Key, angle: ArrayLike) -> tuple[Floats, Floats]:
    """Return the jack's rise [m] and d(rise)/da [m/rad] at a key angle [rad].

    The rise is b tan a + hb (1/cos a - 1); its derivative is b + (hb + rise) tan a.
    """
    half = np.tan(0.5 * np.asarray(angle, dtype=float))
    tangent = 2 * half / (1 - half * half)
    rise = tangent * (key.jack_arm + key.jack_surface_height * half)
    return rise, key.jack_arm + (key.jack_surface_height + rise) * tangent


def rise_of_angle(key: Key, angle: ArrayLike) -> Floats:
    """Return the jack's rise [m] at a key angle [rad]."""
    return jack_law(key, angle)[0]


def rise_slope(key: Key, angle: ArrayLike) -> Floats:
    """Return d(rise)/da [m/rad] at a key angle [rad]."""
    return jack_law(key, angle)[1]


def angle_of_rise(key: Key, rise: ArrayLike) -> Floats:
    """Return the key angle [rad] at a rise of the jack [m], the inverse of `rise_of_angle`.

    With c = hb + rise the law is c cos a - b sin a = hb; its root is computed in half-angle form,
    which is accurate for small rises.
    """
    rise = np.asarray(rise, dtype=float)
    b, hb = key.jack_arm, key.jack_surface_height
    root = np.sqrt(b**2 + rise * (2 * hb + rise))
    return 2 * np.arctan(rise / (b + root))


def rise_curvature(key: Key, angle: ArrayLike) -> Floats:
    """Return d2(rise)/da2 [m/rad^2] at a key angle [rad]."""
    angle = np.asarray(angle, dtype=float)
    b, hb = key.jack_arm, key.jack_surface_height
    sine = np.sin(angle)
    return (2 * b * sine + hb * (1 + sine**2)) / np.cos(angle) ** 3


def key_motion(key: Key, rise: Motion) -> Motion:
    """Return the key's angle [rad] and its derivatives from the jack's rise [m]."""
    angle = angle_of_rise(key, rise.position)
    slope = rise_slope(key, angle)
    velocity = rise.velocity / slope
    acceleration = (rise.acceleration - rise_curvature(key, angle) * velocity**2) / slope
    return Motion(angle, velocity, acceleration)


def jack_motion(key: Key, angle: Motion) -> Motion:
    """Return the jack's rise [m] and its derivatives from the key's angle [rad]."""
    rise, slope = jack_law(key, angle.position)
    bend = rise_curvature(key, angle.position) * angle.velocity**2
    return Motion(rise, slope * angle.velocity, slope * angle.acceleration + bend)


def surface_axes(angle: ArrayLike) -> tuple[Floats, Floats]:
    """Return the unit tangent and normal of the key's surface, each of shape (n, 2)."""
    angle = np.asarray(angle, dtype=float)
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack([cosine, sine], -1), np.stack([-sine, cosine], -1)


def point_on_key(angle: Motion, along: float, above: float) -> Motion:
    """Return the motion [m] of a point fixed to the key, each array of shape (n, 2).

    Args:
        angle: Key's angle [rad].
        along: m, from the pin along the surface's tangent.
        above: m, from the pin along the surface's normal.
    """
    tangent, normal = surface_axes(angle.position)
    radius = along * tangent + above * normal
    turned = along * normal - above * tangent
    omega, alpha = angle.velocity[..., None], angle.acceleration[..., None]
    return Motion(radius, omega * turned, alpha * turned - omega**2 * radius)


def contact_angle(height: float, centre: Floats) -> Floats:
    """Return the angle [rad] of a key whose surface is at a normal distance from a point.

    Args:
        height: m, of the point along the key's normal from the pin.
        centre: m, the point, in front of the pin; shape (..., 2). Within `height` of the pin,
            where no angle has that distance, the result is that of the least distance.
    """
    x, z = centre[..., 0], centre[..., 1]
    along = np.sqrt(np.maximum(x**2 + z**2 - height**2, 0.0))
    return np.arctan2(-x, z) - np.arctan2(along, height)


def key_under_fingertip(key: Key, radius: float, centre: Motion) -> Motion:
    """Return the motion [rad] of a key in contact with a spherical fingertip.

    The centre C of the sphere stays at the height H = surface + radius over the key:
    C . n(a) = H, for a fingertip in front of the pin.

    Args:
        radius: m, of the fingertip.
        centre: m, of the sphere, arrays of shape (n, 2).

    Raises:
        TrajectoryError: The centre is within H of the pin, where no angle gives a contact.
    """
    height = key.surface_height + radius
    if dot(centre.position, centre.position).min() <= height**2:
        raise TrajectoryError(
            f"contact: the fingertip comes within {height * 1e3:.4g} mm of the balance pin,"
            " where no angle gives a contact; move the arm's base or raise key.press_arm"
        )
    angle = contact_angle(height, centre.position)
    tangent, normal = surface_axes(angle)
    reach = dot(centre.position, tangent)
    velocity = dot(centre.velocity, normal) / reach
    acceleration = (
        dot(centre.acceleration, normal)
        - 2 * velocity * dot(centre.velocity, tangent)
        - velocity**2 * height
    ) / reach
    return Motion(angle, velocity, acceleration)
