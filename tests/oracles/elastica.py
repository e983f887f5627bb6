"""Plectrum under a load at one position: the elastica of `docs/model.md`, for the independent
solution of the pluck. Symbols as in `pluck.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import atan, cos, hypot, inf, sin

import numpy as np
from scipy.integrate import solve_ivp

from tests.oracles.outline import Outline


@dataclass(frozen=True)
class State:
    """Plectrum under one load. Lengths in m, angles in rad, energy in J."""

    x: float
    z: float
    """Centre of the string in the clamp's frame."""
    angle: float
    """By which the surface under the string points down, from the horizontal."""
    rotation: float
    """Of the section under the string."""
    energy: float
    """Of bending."""
    mid_x: float
    mid_z: float
    """Mid-line under the string."""


class Bar:
    """A plectrum under a load at one position, by numerical integration of the elastica."""

    def __init__(
        self,
        outline: Outline,
        *,
        modulus: float,
        width: float,
        radius: float,
        contact: str,
        tolerance: float = 1e-12,
        surface_moment: bool = False,
    ) -> None:
        """Take modulus in Pa, width and radius (of the wire) in m.

        Args:
            contact: `surface` or `mid-line`.
            tolerance: relative, of the integration.
            surface_moment: whether the load acts at the surface, not at the mid-line. The
                document neglects the moment between the two.
        """
        self.outline = outline
        self.rigidity = modulus * width / 12
        self.radius = radius if contact == "surface" else 0.0
        thickness_at_clamp = outline.top(0.0) - outline.bottom(0.0)
        self.depth = 0.0 if contact == "surface" else thickness_at_clamp / 2
        self.tolerance = tolerance
        self.surface_moment = surface_moment
        self.clamp_z = (outline.top(0.0) + outline.bottom(0.0)) / 2
        self.state = lru_cache(maxsize=None)(self._state)

    def offset(self, s: float) -> float:
        """Return the distance in m along the section at s (m) of the string's point over the
        mid-line, without the wire's radius.
        """
        return self.outline.under_string(s)[0] - self._mid(s) - self.depth

    def _mid(self, s: float) -> float:
        s -= 1e-12 * self.outline.length
        return (self.outline.top(s) + self.outline.bottom(s)) / 2

    def _state(self, s: float, force: float, friction: float) -> State:
        """Return the state for a position in m, a normal force in N and T."""
        outline = self.outline
        slope = atan(outline.under_string(s)[1])
        lever = outline.under_string(s)[0] - self._mid(s)
        # theta: rotation of the section at s minus that at x; moment over F L; the mid-line's
        # coordinates along and across the surface at s, over L; energy over F L
        y = np.zeros(5)
        if self.surface_moment:
            y[1] = lever / outline.length * (sin(slope) + friction * cos(slope))
        edges = [0.0, *(b for b in outline.breaks if b < s * (1 - 1e-11)), s]
        for lo, hi in zip(edges[-2::-1], edges[:0:-1], strict=True):
            y = self._integrate(y, lo, hi, force, friction, slope)
        rotation, _, along, across, energy = y
        angle = rotation - slope
        length = outline.length
        mid_x = length * (along * cos(angle) + across * sin(angle))
        mid_z = length * (across * cos(angle) - along * sin(angle))
        offset, radius = self.offset(s), self.radius
        return State(
            mid_x + offset * sin(rotation) + radius * sin(angle),
            mid_z + offset * cos(rotation) + radius * cos(angle),
            angle,
            rotation,
            float(energy) * force * length,
            mid_x,
            mid_z,
        )

    def _integrate(
        self, y: np.ndarray, lo: float, hi: float, force: float, friction: float, slope: float
    ) -> np.ndarray:
        """Integrate over sections from hi towards the clamp to lo, both in m."""
        outline, length, guard = self.outline, self.outline.length, 1e-12 * self.outline.length
        stiffness = self.rigidity / (force * length**2) if force else inf

        def right(distance: float, y: np.ndarray) -> list[float]:
            x = min(max(hi - distance * length, lo + guard), hi - guard)
            t = outline.top(x) - outline.bottom(x)
            mid_slope = (outline.top_slope(x) + outline.bottom_slope(x)) / 2
            stretch = hypot(1.0, mid_slope)  # arc length of the mid-line over dx
            psi = y[0] + atan(mid_slope) - slope
            curvature = y[1] / (stiffness * t**3)
            c, s = cos(psi) * stretch, sin(psi) * stretch
            return [curvature * stretch, c + friction * s, c, s, y[1] * curvature * stretch / 2]

        span = (0.0, (hi - lo) / length)
        solution = solve_ivp(
            right,
            span,
            y,
            "DOP853",
            rtol=self.tolerance,
            atol=self.tolerance / 100,
            first_step=span[1] / 4,
        )
        return solution.y[:, -1]
