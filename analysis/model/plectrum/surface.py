"""The string on the plectrum's surface: the map of its centre instead of the mid-line's.

The wire lies on the upper surface. Its centre is off the mid-line by half the thickness along the
section, as turned by the load, and by its radius along the normal of the surface: two directions
where the unloaded top slopes. As the plectrum bends by the angle a, an offset d moves the centre
outwards by d sin a and down by d (1 - cos a). The normal force acts through the mid-line
nevertheless; the moment of the friction about it, T F times half the thickness, is neglected: 1 %
of that at the clamp at mu = 0.2.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Bend, Floats, PlectrumMap
from sautereau.analysis.model.plectrum.levels import plectrum_map

if TYPE_CHECKING:
    from sautereau.rig.instrument import Plectrum, String


class StringCentre:
    """The map of the centre of a string on a plectrum; its z is counted from first contact.

    Args:
        overlap: m, from the string's centre at rest to the tip, along the undeformed mid-line.
        half: m, from the mid-line to the surface, along the section.
        radius: m, of the wire, along the normal of the surface.

    Raises:
        ModelError: No position on the unloaded plectrum is below the string.
    """

    def __init__(self, plectrum: PlectrumMap, overlap: float, half: float, radius: float):
        self.mid_line, self.half, self.radius = plectrum, half, radius
        self.length, self.friction = plectrum.length, plectrum.friction
        self.represents = plectrum.represents
        self._z = 0.0
        rest = plectrum.length - overlap
        self.first = self._first(rest)
        """m, position of the string on the plectrum at first contact."""
        self._z = float(self.bend(self.first, 0.0).z)

    def _first(self, rest: float) -> float:
        """Return the position at which a string at x = rest touches the unloaded plectrum."""
        from scipy.optimize import root_scalar

        def beyond(s: float) -> float:
            return float(self.bend(s, 0.0).x) - rest

        # A steep surface moves the centre by no more; the last part is for rounding.
        reach = self.half + self.radius + 1e-9 * self.length
        low, high = max(rest - reach, getattr(self.mid_line, "nearest", 0.0)), self.length
        if not beyond(low) <= 0 <= beyond(high):
            raise ModelError(
                f"plectrum.outline: no position on the plectrum lies below a string"
                f" {(self.length - rest) * 1e3:.4g} mm from its tip; change overlap or outline"
            )
        return float(root_scalar(beyond, bracket=(low, high), xtol=1e-15, rtol=1e-14).root)

    def bend(self, s: ArrayLike, force: ArrayLike, drag: ArrayLike | None = None) -> Bend:
        """Return the string's centre for positions s [m] and forces F [N]; see `PlectrumMap`.

        Raises:
            ModelError: A position is not on the plectrum, or a force not within 0 and its limit.
        """
        at, (slope, slope_s) = self.mid_line.bend(s, force, drag), self.slope(s)
        section, half, radius = at.theta - slope, self.half, self.radius
        out, up = -half * np.sin(section), half * np.cos(section)
        beyond, above = -radius * np.sin(at.theta), radius * np.cos(at.theta)
        section_s = at.theta_s - slope_s
        return Bend(
            at.x + out + beyond, at.z + up + above - self._z, at.theta,
            at.x_s - up * section_s - above * at.theta_s,
            at.z_s + out * section_s + beyond * at.theta_s, at.theta_s,
            at.x_f - (up + above) * at.theta_f, at.z_f + (out + beyond) * at.theta_f, at.theta_f,
        )  # fmt: skip

    def slope(self, s: ArrayLike) -> tuple[Floats, Floats]:
        """Return the slope [rad] of the unloaded surface at positions s [m], and d(slope)/ds."""
        return self.mid_line.slope(s)

    def force_limit(self, s: ArrayLike) -> Floats:
        """Return the largest force [N] at positions s [m] within the level's range."""
        return self.mid_line.force_limit(s)


def string_map(plectrum: "Plectrum", string: "String", level: str) -> StringCentre:
    """Return the map of a string's centre on a plectrum at a level.

    Args:
        plectrum: The rig's plectrum; `plectrum.contact` gives the place of the string.

    Raises:
        ModelError: There is no such level, or the plectrum is out of its range.
    """
    return string_centre(plectrum_map(plectrum, level), plectrum, string)


def string_centre(mid_line: PlectrumMap, plectrum: "Plectrum", string: "String") -> StringCentre:
    """Return the map of a string's centre on a plectrum whose mid-line has a map."""
    if plectrum.contact == "mid-line":
        return StringCentre(mid_line, plectrum.overlap, 0.0, 0.0)
    thickness = getattr(mid_line, "clamp_thickness", plectrum.thickness)
    return StringCentre(mid_line, plectrum.overlap, thickness / 2, string.diameter / 2)
