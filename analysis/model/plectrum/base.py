"""The interface of every level of the plectrum."""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


class Bend(NamedTuple):
    """Contact point of a loaded plectrum in the clamp's frame, with derivatives.

    x runs from the clamp along the undeformed mid-line, z upwards; under a string's load
    z and theta are negative. All fields have the shape of s and F broadcast together.
    """

    x: Floats
    """m."""
    z: Floats
    """m."""
    theta: Floats
    """rad, of the tangent."""
    x_s: Floats
    """dx/ds, dimensionless."""
    z_s: Floats
    """dz/ds, dimensionless."""
    theta_s: Floats
    """dtheta/ds, rad/m."""
    x_f: Floats
    """dx/dF, m/N."""
    z_f: Floats
    """dz/dF, m/N."""
    theta_f: Floats
    """dtheta/dF, rad/N."""


class PlectrumMap(Protocol):
    """A cantilever loaded at material position s by a string.

    The load is the force F normal to the deformed surface and, along its tangent towards
    the tip, the drag times F.
    """

    represents: tuple[str, ...]
    """Fields of `Plectrum.described` that are represented; others are reported as ignored."""
    length: float
    """m, from clamp to tip."""
    friction: float
    """Coulomb coefficient between plectrum and string, dimensionless, 0 to 0.5."""

    def bend(self, s: ArrayLike, force: ArrayLike, drag: ArrayLike | None = None) -> Bend:
        """Return the contact point for positions s [m] and forces F [N].

        Args:
            drag: Dimensionless, the string's force along the surface over F, positive towards the
                tip; None for a string that slides to the tip: the friction.

        Raises:
            ModelError: A position is not on the plectrum, or a force not within 0 and its limit.
        """
        ...

    def slope(self, s: ArrayLike) -> tuple[Floats, Floats]:
        """Return the slope [rad] of the unloaded surface at positions s [m], and d(slope)/ds.

        theta less this slope is the rotation of the section.
        """
        ...

    def force_limit(self, s: ArrayLike) -> Floats:
        """Return the largest force [N] at positions s [m] within the level's range."""
        ...
