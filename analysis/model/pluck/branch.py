"""The equations of plectrum and spring string, and the curves on which they hold.

The plectrum pushes the string with F along its surface's normal and T F along its tangent
towards the clamp. In the clamp's frame, with a = -theta the angle by which the plectrum is
bent down, the string goes out by F (sin a - T cos a) / K and up by F (cos a + T sin a) / K.
The wire that has turned by phi about the tip's edge has its centre r (sin(a + phi) - sin a)
further out and r (cos a - cos(a + phi)) lower, with T = tan(atan mu - phi).
"""

import math
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Bend, Floats, PlectrumMap

ROUNDING = 1e-15
"""1, of the lengths that a residual is the difference of: one that is no more than rounding."""
FORCES = np.concatenate([[0.0], np.geomspace(1e-14, 1.0, 97)])
"""1, of the largest force: where equilibrium at a place is looked for."""
NEWTON_STEPS = 60


@dataclass(frozen=True)
class Curve:
    """A stretch of the pluck's equilibria; arrays of shape (n,), from contact on."""

    height: Floats
    """m, of the jack above first contact."""
    force: Floats
    """N, normal to the plectrum's surface."""
    position: Floats
    """m, of the string along the plectrum, from the clamp."""
    angle: Floats
    """rad, by which the plectrum is bent down under the string."""
    lift: Floats
    """m, of the string, upwards."""
    shift: Floats
    """m, of the string, outwards along the plectrum."""
    drag: Floats
    """1, force along the surface towards the clamp, over the one normal to it."""


@dataclass(frozen=True)
class Equations:
    """Plectrum and spring string."""

    plectrum: PlectrumMap
    stiffness: float
    """N/m, of the string, K of the paper's equation 2."""
    rest: float
    """m, of the string at rest from the clamp."""
    radius: float = 0.0
    """m, of a wire that rolls over the tip's edge; 0 for one that does not."""

    def sliding_force(self, s: float) -> float | None:
        """Return the force [N] with which a string that slides is at s [m], or None.

        The residual X - rest - shift as a function of F rises at first, by friction, and then
        falls, so its last change of sign is the one.
        """
        limit = float(self.plectrum.force_limit(s))
        force = FORCES * limit
        residual = self._along(np.full_like(force, s), force)[0]
        positive = np.flatnonzero(residual > self._rounding(force))
        if len(positive) == 0:
            return 0.0
        last = positive[-1]
        if last == len(force) - 1:
            return None
        low, high = force[last], force[last + 1]
        here = high
        for _ in range(NEWTON_STEPS):
            value, _, slope = self._along(np.array([s]), np.array([here]))
            low, high = (here, high) if value[0] > 0 else (low, here)
            step = value[0] / slope[0] if slope[0] else np.inf
            there = here - step
            if not low <= there <= high:
                there = (low + high) / 2
            if abs(there - here) <= 4e-16 * here:
                break
            here = there
        return float(here)

    def stick(self, force: Floats) -> Curve:
        """Return the equilibria of a string that friction holds where it was met."""
        position = np.full_like(force, self.rest)
        bend = self.plectrum.bend(position, force)
        angle = -bend.theta
        # From K (X - rest) = F (sin a - T cos a).
        pulled = self.stiffness * (self.rest - bend.x)
        drag = np.divide(pulled, force, out=np.zeros_like(force), where=force > 0)
        # Within what friction can do but for rounding.
        drag = np.clip((np.sin(angle) + drag) / np.cos(angle), 0, self.plectrum.friction)
        return self._curve(bend, force, position, drag)

    def slide(self, load: Floats, start: Floats) -> Curve:
        """Return the equilibria of a sliding string at loads F s^2 [N m^2], shape (n,).

        Of the elastica each load belongs to one place and each place to one load, so none
        but the branch from first contact is met, whatever folds it has over height or force.

        Args:
            load: N m^2.
            start: m, places from which Newton's method begins.
        """
        length = self.plectrum.length
        s, residual = start.copy(), np.full_like(load, np.inf)
        for _ in range(NEWTON_STEPS):
            force = self._force(load, s)
            residual, by_s, by_force = self._along(s, force)
            slope = by_s - 2 * force / s * by_force
            step = residual / slope
            small = np.abs(step) <= 10 * ROUNDING * length
            if np.all(small | (np.abs(residual) <= self._rounding(force))):
                break
            s = np.clip(s - step, (s + self.rest) / 2 * (1 - 1e-12), length)
        else:
            raise ModelError(
                "the string's position on the plectrum was not found (residual"
                f" {np.abs(residual).max():.3g} m at a string of {self.stiffness:.4g} N/m);"
                " string.tension or plectrum.overlap are out of the model's range"
            )
        force = self._force(load, s)
        drag = np.full_like(force, self.plectrum.friction)
        return self._curve(self.plectrum.bend(s, force), force, s, drag)

    def roll(self, turn: Floats, force: float) -> Curve:
        """Return the equilibria of a wire at the edge that has turned by angles from 0 [rad].

        Args:
            turn: rad, shape (n,).
            force: N, normal to the plectrum, as the wire came to the edge.
        """
        position = np.full_like(turn, self.plectrum.length)
        limit = float(self.plectrum.force_limit(self.plectrum.length))
        drag = np.tan(math.atan(self.plectrum.friction) - turn)
        found = np.full_like(turn, force)
        for _ in range(NEWTON_STEPS):
            bend = self.plectrum.bend(position, found)
            a = -bend.theta
            value = bend.x - self.rest + self.radius * (np.sin(a + turn) - np.sin(a))
            value -= found * (np.sin(a) - drag * np.cos(a)) / self.stiffness
            a_f = -bend.theta_f
            slope = bend.x_f + self.radius * (np.cos(a + turn) - np.cos(a)) * a_f
            slope -= (np.sin(a) - drag * np.cos(a)) / self.stiffness
            slope -= found * (np.cos(a) + drag * np.sin(a)) * a_f / self.stiffness
            step = value / slope
            found = np.clip(found - step, 0, limit)
            if np.all(np.abs(step) <= 1e-14 * force):
                break
        bend = self.plectrum.bend(position, found)
        curve = self._curve(bend, found, position, drag)
        sunk = self.radius * (np.cos(curve.angle) - np.cos(curve.angle + turn))
        return Curve(curve.height + sunk, *list(vars(curve).values())[1:])

    def _rounding(self, force: Floats) -> Floats:
        return ROUNDING * (self.plectrum.length + force / self.stiffness)

    def _force(self, load: Floats, s: Floats) -> Floats:
        return np.minimum(load / s**2, self.plectrum.force_limit(s))

    def _along(self, s: Floats, force: Floats) -> tuple[Floats, Floats, Floats]:
        """Return X - rest - shift [m] of a string that slides, and its slopes by s and F."""
        bend = self.plectrum.bend(s, force)
        sine, cosine, mu = np.sin(bend.theta), np.cos(bend.theta), self.plectrum.friction
        along = (sine + mu * cosine) / self.stiffness
        turn = force * (cosine - mu * sine) / self.stiffness
        return (
            bend.x - self.rest + force * along,
            bend.x_s + turn * bend.theta_s,
            bend.x_f + along + turn * bend.theta_f,
        )

    def _curve(self, bend: Bend, force: Floats, position: Floats, drag: Floats) -> Curve:
        sine, cosine = np.sin(bend.theta), np.cos(bend.theta)
        lift = force * (cosine - drag * sine) / self.stiffness
        shift = -force * (sine + drag * cosine) / self.stiffness
        return Curve(lift - bend.z, force, position, -bend.theta, lift, shift, drag)
