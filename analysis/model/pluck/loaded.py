"""Plectra under given loads, with a leading axis of cases: what the solver asks of a level.

The load is F s^2, for the force F normal to the plectrum at the position s of the string. Of
a uniform section each load belongs to one position, so that the load leads from first contact to
release past any fold over height or force.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.model.plectrum.base import Floats, PlectrumMap
from sautereau.analysis.model.plectrum.elastica import Elastica
from sautereau.analysis.model.plectrum.surface import StringCentre
from sautereau.analysis.model.plectrum.table import Table, arranged, laws_under, sticking_laws

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
    uniform: bool
    """Whether nothing but the scale depends on the position s."""
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

    def load_slopes(self, s: Floats, load: Floats, drag: float) -> tuple[Floats, Floats, Floats]:
        """Return the derivatives of x [m], z [m] and angle [rad] by the load at the same s."""
        ...

    def subset(self, rows: Rows) -> Self:
        """Return some of the cases."""
        ...


class TabledPlectra:
    """Plectra of one table; `unit` is EI at the clamp, so that a load is q = F s^2 / EI."""

    def __init__(
        self,
        table: Table,
        friction: float,
        length: Floats,
        bending_stiffness: Floats,
        overlap: Floats,
        half: Floats,
        radius: Floats,
    ):
        """Take the plectra.

        Args:
            table: Of their shape.
            friction: Dimensionless, common to all.
            length: m, shape (cases,), as all that follow.
            bending_stiffness: N m^2.
            overlap: m.
            half: m, from the mid-line to the surface, along the section.
            radius: m, of the wire, along the normal of the surface.
        """
        self._table, self.friction, self.length = table, friction, length[:, None]
        self.uniform = table.uniform
        self.unit, self._overlap = bending_stiffness[:, None], overlap[:, None]
        self._half, self._radius = half[:, None], radius[:, None]
        self._offset = self._half + self._radius
        self._limit = np.full((1, 1), table.limit(friction))
        self._first = self.length - self._overlap
        if not table.flat:
            # The string at x = rest lies where s + r (sine of the surface's fall) = rest.
            rest = self._first
            for _ in range(6):  # Newton's steps; 3 are usual
                (_, tilt), (_, tilt_s) = table.contact_line(self._first / self.length)
                beyond = self._first - self._radius * np.sin(tilt) - rest
                slope = 1 - self._radius * np.cos(tilt) * tilt_s / self.length
                self._first = self._first - beyond / slope
        outside = self._first < table.nearest * self.length
        self._first = np.where(outside | (self._first > self.length), np.nan, self._first)
        self._lowest = 0.0  # at first contact z is 0
        self._lowest = self._placed(np.zeros((3, 1, 1)), self._first, np.zeros((1, 1)))[1]

    def first(self, rest: Floats) -> Floats:
        """Return the position [m] of the string at first contact; NaN where it is on none."""
        return self._first

    def load_limit(self, s: Floats) -> Floats:
        """Return the q that turns the tangent by nearly 90 degrees, shape (1, 1)."""
        return self._limit

    def under(self, load: Floats, drag: float) -> Callable[[Floats], Loaded]:
        """Return the plectra under loads q as a function of the position s [m]."""
        laws = arranged(laws_under(self._table, drag)[0](load))
        if not self._table.uniform:
            laws = np.ascontiguousarray(laws)  # read in every step of a search
            return lambda s: self._loaded(laws, s, load)
        x, z, theta = laws[0, 0]
        x, z, angle = x.copy(), load * z, -load * theta
        sine, cosine = np.sin(angle), np.cos(angle)
        out, down = self._offset * sine, self._offset * (1 - cosine)
        return lambda s: Loaded(s * x + out, s * z - down, angle, sine, cosine, x, z, 0.0)

    def stuck(self, load: Floats, s: Floats) -> Callable[[Floats], Stuck]:
        """Return the plectra under loads q at positions s [m] as a function of the drag."""
        laws = sticking_laws(self._table, self.friction)(load)
        last = laws.ndim - 4
        laws = laws.transpose(last + 1, last + 2, last, last + 3, *range(last))
        powers = np.ascontiguousarray(self._table.at(laws, self._place(s)))

        def at(drag: Floats) -> Stuck:
            share = drag / self.friction
            found = np.array(np.broadcast_to(powers[-1], (3, *share.shape)))
            for power in powers[-2::-1]:
                found *= share
                found += power
            return Stuck(*self._placed(found, s, load)[:5])

        return at

    def load_slopes(self, s: Floats, load: Floats, drag: float) -> tuple[Floats, Floats, Floats]:
        """Return the derivatives of x [m], z [m] and angle [rad] by q at the same s [m]."""
        place = self._place(s)
        (_, z, theta), (x_q, z_q, theta_q) = (
            self._table.at(arranged(laws(load)), place) for laws in laws_under(self._table, drag)
        )
        section, angle_q = -load * theta, -theta - load * theta_q
        if self._table.flat:
            out, down = self._offset * np.cos(section), self._offset * np.sin(section)
        else:
            half, radius = self._half, self._radius
            angle = section - self._table.contact_line(place)[0][1]
            out = half * np.cos(section) + radius * np.cos(angle)
            down = half * np.sin(section) + radius * np.sin(angle)
        return s * x_q + out * angle_q, s * (z + load * z_q) - down * angle_q, angle_q

    def subset(self, rows: Rows) -> "TabledPlectra":
        """Return some of the cases."""
        columns = self.length, self.unit, self._overlap, self._half, self._radius
        return TabledPlectra(self._table, self.friction, *(c[rows, 0] for c in columns))

    def _place(self, s: Floats) -> Floats:
        """Return s/L, at least the smallest of the table: Newton's steps may be beyond it."""
        return np.maximum(s / self.length, self._table.nearest)

    def _placed(self, laws: Floats, s: Floats, load: Floats) -> tuple[Floats, ...]:
        """Return x [m], z [m], angle, its sine and cosine, and sine and cosine of the section's.

        Args:
            laws: Shape (3, cases, points), as s and load.
        """
        x, z, theta = laws
        section = -load * theta
        sine, cosine = np.sin(section), np.cos(section)
        x, z = s * x, s * load * z - self._lowest
        if self._table.flat:
            x, z = x + self._offset * sine, z + self._offset * cosine
            return x, z, section, sine, cosine, sine, cosine
        height, tilt = self._table.contact_line(self._place(s))[0]
        x, z = x + self._half * sine, z + self._half * cosine + height * self.length
        angle = section - tilt
        across, along = np.sin(angle), np.cos(angle)
        x, z = x + self._radius * across, z + self._radius * along
        return x, z, angle, across, along, sine, cosine

    def _loaded(self, laws: Floats, s: Floats, load: Floats) -> Loaded:
        place = self._place(s)
        found, (x_p, z_p, theta_p) = self._table.with_slopes(laws, place)
        x, z, angle, sine, cosine, along, across = self._placed(found, s, load)
        section_s = angle_s = -load * theta_p / self.length
        x_s, z_s = found[0] + place * x_p, load * (found[1] + place * z_p)
        if not self._table.flat:
            height_p, tilt_p = self._table.contact_line(place)[1]
            angle_s, z_s = section_s - tilt_p / self.length, z_s + height_p
        x_s = x_s + self._half * across * section_s + self._radius * cosine * angle_s
        z_s = z_s - self._half * along * section_s - self._radius * sine * angle_s
        return Loaded(x, z, angle, sine, cosine, x_s, z_s, angle_s)


class OnePlectrum:
    """One plectrum of any level as a single case; loads in N m^2."""

    def __init__(self, plectrum: PlectrumMap):
        self._map, self.friction, self.uniform = plectrum, plectrum.friction, False
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

    def load_slopes(self, s: Floats, load: Floats, drag: float) -> tuple[Floats, Floats, Floats]:
        """Return the derivatives of x [m], z [m] and angle [rad] by the load at the same s."""
        bend = self._map.bend(s, self._force(s, load), drag)
        return bend.x_f / s**2, bend.z_f / s**2, -bend.theta_f / s**2

    def subset(self, rows: Rows) -> "OnePlectrum":
        """Return the one case."""
        return self

    def _force(self, s: Floats, load: Floats) -> Floats:
        return np.minimum(load / s**2, self._map.force_limit(s))


def shape_of(plectrum: PlectrumMap) -> tuple[int, float] | None:
    """Return what plectra have in common that `plectra_of` can join; None if it joins no others."""
    mid_line = _mid_line(plectrum)
    return (id(mid_line.table), mid_line.friction) if isinstance(mid_line, Elastica) else None


def plectra_of(plectra: Sequence[PlectrumMap], overlap: Floats) -> Plectra:
    """Return the maps of plectra of one `shape_of`, or of strings' centres on them, a case each.

    Args:
        overlap: m, shape (cases,).
    """
    found = [m for m in map(_mid_line, plectra) if isinstance(m, Elastica)]
    if not found:
        return OnePlectrum(plectra[0])
    length, stiffness = np.array([(m.length, m.bending_stiffness) for m in found]).T
    centres = [(getattr(p, "half", 0.0), getattr(p, "radius", 0.0)) for p in plectra]
    half, radius = np.array(centres).T
    table, friction = found[0].table, found[0].friction
    return TabledPlectra(table, friction, length, stiffness, overlap, half, radius)


def _mid_line(plectrum: PlectrumMap) -> PlectrumMap:
    return plectrum.mid_line if isinstance(plectrum, StringCentre) else plectrum
