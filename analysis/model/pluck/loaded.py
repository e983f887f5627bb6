"""Plectra under given loads, with a leading axis of cases: what the solver asks of a level.

The load is F s^2, for the force F normal to the plectrum at the position s of the string. Of
a uniform section each load belongs to one position, so that the load leads from first contact to
release past any fold over height or force.
"""

from collections.abc import Callable
from typing import NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.model.plectrum.base import Floats, PlectrumMap
from sautereau.analysis.model.plectrum.elastica import (
    Elastica,
    elastica_tables,
    q_max,
    sticking_table,
)
from sautereau.analysis.model.plectrum.surface import StringCentre

Rows = NDArray[np.intp]


class Loaded(NamedTuple):
    """The string on loaded plectra; all fields broadcast to (cases, points)."""

    x: Floats
    """m, of the string's centre, from the clamp along the undeformed mid-line."""
    z: Floats
    """m, of the string's centre, upwards from first contact."""
    angle: Floats
    """rad, by which the plectrum is bent down."""
    sine: Floats
    """Sine of the angle."""
    cosine: Floats
    """Cosine of the angle."""
    x_s: Floats
    """dx/ds at the same load, dimensionless."""
    z_s: Floats
    """dz/ds at the same load, dimensionless."""
    angle_s: Floats | float
    """rad/m, d(angle)/ds at the same load."""


class Stuck(NamedTuple):
    """The first fields of `Loaded`, without its derivatives."""

    x: Floats
    z: Floats
    angle: Floats
    sine: Floats
    cosine: Floats


class Plectra(Protocol):
    """Plectra of one friction; loads are given in `unit`."""

    friction: float
    """Coulomb coefficient, dimensionless."""
    length: Floats
    """m, shape (cases, 1)."""
    unit: Floats
    """N m^2, of the loads, shape (cases, 1)."""

    def first(self, rest: Floats) -> Floats:
        """Return the position [m] on the plectrum of a string at rest at x [m], at contact."""
        ...

    def load_limit(self, s: Floats) -> Floats:
        """Return the largest load at positions s [m], shape (cases, 1) or (1, 1)."""
        ...

    def under(self, load: Floats, drag: float) -> Callable[[Floats], Loaded]:
        """Return the plectra under loads as a function of the position s [m].

        Args:
            drag: Dimensionless, the string's force along the surface towards the tip over F.
        """
        ...

    def stuck(self, load: Floats, s: Floats) -> Callable[[Floats], Stuck]:
        """Return the plectra under loads at positions s [m] as a function of the drag."""
        ...

    def load_slopes(self, s: Floats, load: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the derivatives of x [m], z [m] and angle [rad] by the load of a string that
        slides to the tip, at the same s."""
        ...

    def subset(self, rows: Rows) -> Self:
        """Return some of the cases."""
        ...


class UniformPlectra:
    """Elasticas; `unit` is the bending stiffness EI, so that a load is q = F s^2 / EI."""

    def __init__(
        self, friction: float, length: Floats, bending_stiffness: Floats, offset: Floats | float
    ):
        """Take the plectra.

        Args:
            friction: Dimensionless, common to all.
            length: m, shape (cases,).
            bending_stiffness: N m^2, shape (cases,).
            offset: m, of the string's centre from the mid-line, shape (cases,) or ().
        """
        self.friction, self.length = friction, length[:, None]
        self.unit = bending_stiffness[:, None]
        self._offset = np.broadcast_to(offset, length.shape)[:, None]
        self._table, self._slopes = elastica_tables(friction)
        self._limit = np.full((1, 1), q_max(friction))

    def first(self, rest: Floats) -> Floats:
        """Return x itself: the unloaded plectrum is straight."""
        return rest

    def load_limit(self, s: Floats) -> Floats:
        """Return the q that turns the tangent by nearly 90 degrees, shape (1, 1)."""
        return self._limit

    def under(self, load: Floats, drag: float) -> Callable[[Floats], Loaded]:
        """Return the elasticas under loads q as a function of the position s [m]."""
        x, z, theta = np.moveaxis(elastica_tables(drag)[0](load), -1, 0)
        x, z, angle = x.copy(), load * z, -load * theta
        sine, cosine = np.sin(angle), np.cos(angle)
        out, down = self._offset * sine, self._offset * (1 - cosine)
        return lambda s: Loaded(s * x + out, s * z - down, angle, sine, cosine, x, z, 0.0)

    def stuck(self, load: Floats, s: Floats) -> Callable[[Floats], Stuck]:
        """Return the elasticas under loads q at positions s [m] as a function of the drag."""
        powers = np.moveaxis(sticking_table(self.friction)(load), (-2, -1), (0, 1))

        def at(drag: Floats) -> Stuck:
            share, (x, z, theta) = drag / self.friction, powers[-1]
            for a, b, c in powers[-2::-1]:
                x, z, theta = x * share + a, z * share + b, theta * share + c
            angle = -load * theta
            sine, cosine = np.sin(angle), np.cos(angle)
            out, down = self._offset * sine, self._offset * (1 - cosine)
            return Stuck(s * x + out, s * load * z - down, angle, sine, cosine)

        return at

    def load_slopes(self, s: Floats, load: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the derivatives of x [m], z [m] and angle [rad] by q at the same s [m]."""
        _, z, theta = np.moveaxis(self._table(load), -1, 0)
        x_q, z_q, theta_q = np.moveaxis(self._slopes(load), -1, 0)
        angle, angle_q = -load * theta, -theta - load * theta_q
        out, down = self._offset * np.cos(angle), self._offset * np.sin(angle)
        return s * x_q + out * angle_q, s * (z + load * z_q) - down * angle_q, angle_q

    def subset(self, rows: Rows) -> "UniformPlectra":
        """Return some of the cases."""
        return UniformPlectra(
            self.friction, self.length[rows, 0], self.unit[rows, 0], self._offset[rows, 0]
        )


class OnePlectrum:
    """One plectrum of any level as a single case; loads in N m^2."""

    def __init__(self, plectrum: PlectrumMap):
        self._map, self.friction = plectrum, plectrum.friction
        self.length, self.unit = np.full((1, 1), plectrum.length), np.ones((1, 1))

    def first(self, rest: Floats) -> Floats:
        """Return the position [m] of the string at first contact, of which the map knows."""
        return np.full_like(rest, getattr(self._map, "first", rest))

    def load_limit(self, s: Floats) -> Floats:
        """Return the largest load [N m^2] at positions s [m]."""
        return self._map.force_limit(s) * s**2

    def under(self, load: Floats, drag: float) -> Callable[[Floats], Loaded]:
        """Return the plectrum under loads [N m^2] as a function of the position s [m]."""

        def at(s: Floats) -> Loaded:
            force = self._force(s, load)
            bend = self._map.bend(s, force, drag)
            by_force = -2 * force / s  # dF/ds at the same load
            return Loaded(
                bend.x,
                bend.z,
                -bend.theta,
                -np.sin(bend.theta),
                np.cos(bend.theta),
                bend.x_s + by_force * bend.x_f,
                bend.z_s + by_force * bend.z_f,
                -bend.theta_s - by_force * bend.theta_f,
            )

        return at

    def stuck(self, load: Floats, s: Floats) -> Callable[[Floats], Stuck]:
        """Return the plectrum under loads [N m^2] at positions s [m] as a function of the drag."""
        force = self._force(s, load)

        def at(drag: Floats) -> Stuck:
            x, z, theta, *_ = self._map.bend(s, force, drag)
            return Stuck(x, z, -theta, -np.sin(theta), np.cos(theta))

        return at

    def load_slopes(self, s: Floats, load: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the derivatives of x [m], z [m] and angle [rad] by the load at the same s."""
        bend = self._map.bend(s, self._force(s, load))
        return bend.x_f / s**2, bend.z_f / s**2, -bend.theta_f / s**2

    def subset(self, rows: Rows) -> "OnePlectrum":
        """Return the one case."""
        return self

    def _force(self, s: Floats, load: Floats) -> Floats:
        return np.minimum(load / s**2, self._map.force_limit(s))


def plectra_of(plectrum: PlectrumMap) -> Plectra:
    """Return a plectrum as a single case."""
    centre = plectrum if isinstance(plectrum, StringCentre) else None
    uniform = centre.mid_line if centre else plectrum
    if isinstance(uniform, Elastica):
        length, stiffness = np.array([uniform.length]), np.array([uniform.bending_stiffness])
        return UniformPlectra(
            uniform.friction, length, stiffness, centre.half + centre.radius if centre else 0.0
        )
    return OnePlectrum(plectrum)
