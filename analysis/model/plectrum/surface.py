"""The string on the plectrum's surface: the map of its centre instead of the mid-line's.

The wire lies on the upper surface, so that its centre is off the mid-line by half the thickness
plus half its diameter, along the surface's normal. As the plectrum bends by the angle a, this
offset d moves the centre outwards by d sin a and down by d (1 - cos a). The normal force acts
through the mid-line nevertheless; the moment of the friction about it, mu F times half the
thickness, is neglected: 1 % of that at the clamp at mu = 0.2.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Bend, Floats, PlectrumMap
from sautereau.analysis.model.plectrum.levels import plectrum_map

if TYPE_CHECKING:
    from sautereau.rig.instrument import Plectrum, String

STEPS = 20
"""Largest number of Newton steps to the position at first contact; an unloaded top is nearly
straight, and 3 are usual."""


class StringCentre:
    """The map of the centre of a string on a plectrum; its z is counted from first contact.

    Args:
        overlap: m, from the string's centre at rest to the tip, along the undeformed mid-line.
        offset: m, of the string's centre from the mid-line.

    Raises:
        ModelError: No position on the unloaded plectrum is below the string.
    """

    def __init__(self, plectrum: PlectrumMap, overlap: float, offset: float):
        self.mid_line, self.offset = plectrum, offset
        self.length, self.friction = plectrum.length, plectrum.friction
        self._z = 0.0
        rest = plectrum.length - overlap
        self.first = rest
        """m, position of the string on the plectrum at first contact."""
        for _ in range(STEPS):
            at = self.bend(self.first, 0.0)
            step = float((at.x - rest) / at.x_s)
            self.first = float(np.clip(self.first - step, 0.0, plectrum.length))
            if abs(step) <= 1e-14 * plectrum.length:
                break
        else:
            raise ModelError(
                f"plectrum.outline: no position on the plectrum lies below a string"
                f" {overlap * 1e3:.4g} mm from its tip; change overlap or outline"
            )
        self._z = float(self.bend(self.first, 0.0).z)

    def bend(self, s: ArrayLike, force: ArrayLike) -> Bend:
        """Return the string's centre for positions s [m] and forces F [N].

        Raises:
            ModelError: A position is not on the plectrum, or a force not within 0 and its limit.
        """
        at, d = self.mid_line.bend(s, force), self.offset
        out, up = -d * np.sin(at.theta), d * np.cos(at.theta)
        return Bend(
            at.x + out, at.z + up - self._z, at.theta,
            at.x_s - up * at.theta_s, at.z_s + out * at.theta_s, at.theta_s,
            at.x_f - up * at.theta_f, at.z_f + out * at.theta_f, at.theta_f,
        )  # fmt: skip

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
    mid_line, offset = plectrum_map(plectrum, level), 0.0
    if plectrum.contact == "surface":
        thickness = getattr(mid_line, "clamp_thickness", plectrum.thickness)
        offset = (thickness + string.diameter) / 2
    return StringCentre(mid_line, plectrum.overlap, offset)
