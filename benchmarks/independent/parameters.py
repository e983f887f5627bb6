"""What the compiled functions take: parameters of the bench, and the state of the strings."""

from typing import NamedTuple

import numpy as np


class Body(NamedTuple):
    """Finger and key. Finger quantities are positive downwards, those of the key upwards."""

    arm_mass: float
    fed_mass: float
    """kg, of the feed-forward of the plan's acceleration."""
    servo_every: int
    servo_gains: np.ndarray
    """Kp (N/m), Ki (N/m/s), Kd (N s/m), encoder step (m), period (s), lag of the drive (s)."""
    transducer: np.ndarray
    """Stiffness N/m, damping N s/m, mass of the tip kg."""
    pad: np.ndarray
    """Stiffness N/m^n, exponent n, damping N s/m from 0.5 N on and in proportion to the
    force below, friction, height above pin m."""
    mass: np.ndarray
    inverse_mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    rotation: int
    """Index of the rotation among the key's coordinates."""
    gravity: float
    """N m, static moment that lowers the front."""
    pivot: np.ndarray
    """Coulomb moment N m, viscous N m s/rad."""
    at_press: np.ndarray
    at_rail: np.ndarray
    at_laser: np.ndarray
    rail: np.ndarray
    """Stiffness N/m, damping N s/m."""
    felt: np.ndarray
    """Stiffness N/m, damping N s/m, dip m."""


class Choirs(NamedTuple):
    """Jacks, plectra and strings; first axis: the choir."""

    at_jack: np.ndarray
    """Displacement of the key under the jack per coordinate; shape (choirs, n)."""
    jack: np.ndarray
    """Arm m, surface height m, mass kg, foot stiffness N/m, foot damping N s/m, register
    friction N, clearance m."""
    plectrum: np.ndarray
    """EI N m^2, length m, wire's distance from the clamp at rest m, offset m, friction, innermost
    place of the tables m."""
    tables: np.ndarray
    """Polynomials of the elastica by friction and place; see `elastica.table`."""
    string: np.ndarray
    """Residual compliance m/N of the omitted modes, 1 for a quasi-static string."""
    modes: np.ndarray
    """Shape at the plectrum, inverse modal mass 1/kg; shape (choirs, modes, 2)."""
    propagators: np.ndarray
    """Of position and velocity over one step, without and with damper felt;
    shape (choirs, 2, modes, 4)."""
    static_height: np.ndarray
    """m, increasing to the release; shape (choirs, points)."""
    static_load: np.ndarray
    """N, of the quasi-static pluck at these heights."""
    damper: np.ndarray
    """Stiffness N/m, rise at which the felt leaves the string m."""
    tongue: np.ndarray
    """Force N while the tongue passes, travel m."""


class Strings(NamedTuple):
    """State of the strings and their contacts; first axis: the choir."""

    position: np.ndarray
    """m, of the modes towards the tip and upwards; shape (choirs, 2, modes)."""
    velocity: np.ndarray
    load: np.ndarray
    """N, on the string towards the tip and upwards; shape (choirs, 2)."""
    push: np.ndarray
    """N, vertical on the jack."""
    state: np.ndarray
    touched: np.ndarray
    """Whether the string has ever been touched: until then it is at rest."""
    bend: np.ndarray
    """Dimensionless load w of the elastica."""
    place: np.ndarray
    """m, arc length from the clamp to the string."""
    stuck: np.ndarray
    """m, place at which the string sticks, or to which it has slid."""
    drag: np.ndarray
    """Friction over its limit, towards the tip."""
    gap: np.ndarray
    """m, between plectrum and wire."""
    shapes: np.ndarray
    """Polynomials of the elastica at the place; shape (choirs, 3, degree + 1)."""


def strings_at_rest(c: Choirs) -> Strings:
    """Return strings that nothing has touched."""
    choirs, modes, _ = c.modes.shape
    return Strings(
        np.zeros((choirs, 2, modes)),
        np.zeros((choirs, 2, modes)),
        np.zeros((choirs, 2)),
        np.zeros(choirs),
        np.zeros(choirs, np.int64),
        np.zeros(choirs, np.bool_),
        np.zeros(choirs),
        np.zeros(choirs),
        np.zeros(choirs),
        np.zeros(choirs),
        np.ones(choirs),
        np.zeros((choirs, *c.tables.shape[3:])),
    )
