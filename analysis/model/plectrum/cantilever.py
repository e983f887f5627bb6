"""Base of the levels with one or two uniform sections: parameters, range checks, scaling."""

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Bend, Floats
from sautereau.rig.instrument import Plectrum

FRICTION_MAX = 0.5  # Dimensionless; largest coefficient of friction of any level


class Cantilever(ABC):
    """A plectrum clamped at x = 0, loaded at s by F and by the drag times F."""

    represents: tuple[str, ...] = ()
    nearest = 0.0
    """m, smallest position of the string on it."""

    def __init__(self, plectrum: Plectrum):
        """Read and check the plectrum's parameters.

        Raises:
            ModelError: Friction or bending stiffness are out of range.
        """
        self.length = plectrum.length
        self.friction = plectrum.friction
        self.bending_stiffness = plectrum.bending_stiffness
        faults = []
        if not 0 <= self.friction <= FRICTION_MAX:
            faults.append(
                f"plectrum.friction: {self.friction:.6g} is not within 0 to {FRICTION_MAX};"
                " change it"
            )
        if not (self.length > 0 and 0 < self.bending_stiffness < np.inf):
            faults.append(
                f"plectrum: a length of {self.length * 1e3:.6g} mm and a bending stiffness of"
                f" {self.bending_stiffness:.6g} N m^2 are not both finite and above 0; see"
                " plectrum.length, width, thickness and youngs_modulus"
            )
        if faults:
            raise ModelError("\n".join(faults))

    def bend(self, s: ArrayLike, force: ArrayLike, drag: ArrayLike | None = None) -> Bend:
        """Return the contact point for positions s [m] and forces F [N]; see `PlectrumMap`.

        Raises:
            ModelError: A position is not on the plectrum, or a force not within 0 and its limit.
        """
        along = self.friction if drag is None else drag
        s, force, along = np.broadcast_arrays(*(np.asarray(a, float) for a in (s, force, along)))
        self._refuse_out_of_range(s, force)
        return self._bend(s, force, along)

    def slope(self, s: ArrayLike) -> tuple[Floats, Floats]:
        """Return zeros: the unloaded surface is straight along x."""
        return np.zeros(np.shape(s)), np.zeros(np.shape(s))

    def force_limit(self, s: ArrayLike) -> Floats:
        """Return the force [N] that turns the tangent at s [m] by 90 degrees, or just less."""
        s = np.minimum(np.asarray(s, float), self.length)
        with np.errstate(divide="ignore", over="ignore"):
            return self._force_limit(s)

    @abstractmethod
    def _bend(self, s: Floats, force: Floats, drag: Floats) -> Bend:
        """Bend under loads that are in range; s, F and drag of one shape."""

    @abstractmethod
    def _force_limit(self, s: Floats) -> Floats:
        """Return the largest force [N] for positions on the plectrum, infinite at the clamp."""

    def _refuse_out_of_range(self, s: Floats, force: Floats) -> None:
        # Written so that NaN is out of range too. The search for the release may overshoot the tip
        # by 1 %: there the same equations hold, with the force limit of the tip.
        on = (s >= self.nearest) & (s <= 1.01 * self.length)
        if not on.all():
            raise ModelError(
                f"position on the plectrum: {s[~on].flat[0] * 1e3:.6g} mm from the clamp is not"
                f" within {self.nearest * 1e3:.6g} to {self.length * 1e3:.6g} mm, its length"
            )
        limit = self.force_limit(s)
        # Apart from rounding.
        held = (force >= 0) & (force <= limit * (1 + 1e-12)) & (force < np.inf)
        if not held.all():
            raise ModelError(
                f"force on the plectrum: {force[~held].flat[0]:.6g} N at"
                f" {s[~held].flat[0] * 1e3:.6g} mm from the clamp is not within 0 to"
                f" {limit[~held].flat[0]:.6g} N, the range of {type(self).__name__};"
                " change the force or raise plectrum.thickness"
            )


def similar(s: Floats, force: Floats, stiffness: float, shape: tuple[Floats, ...]) -> Bend:
    """Return the bend of a uniform section from its shape at q = F s^2 / EI.

    Args:
        s: m, positions.
        force: N.
        stiffness: N m^2, EI.
        shape: x/s, z/s and theta, then their derivatives by q.
    """
    q_s = 2 * force * s / stiffness
    q_f = s**2 / stiffness
    x, z, theta, dx, dz, dtheta = shape
    return Bend(
        s * x,
        s * z,
        theta,
        x + s * dx * q_s,
        z + s * dz * q_s,
        dtheta * q_s,
        s * dx * q_f,
        s * dz * q_f,
        dtheta * q_f,
    )
