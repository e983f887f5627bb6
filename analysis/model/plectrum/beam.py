"""Euler-Bernoulli cantilevers of one or two uniform sections under small rotation.

With u the part of the loaded length s that lies in the tip's section,
theta = -F ((s^2 - u^2) / 2EI + u^2 / 2EI_tip) and z = -F ((s^3 - u^3) / 3EI + u^3 / 3EI_tip),
the integrals of the bending moment F (s - x) over either section; x = s: the plectrum does not
shorten. The string is released because the tip retracts, so these levels release late, although
their force at a given position is accurate. Friction pulls along the plectrum and has no lever
while the rotation is small: it does not bend it at first order, and mu changes nothing here.
"""

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Bend, Floats
from sautereau.analysis.model.plectrum.cantilever import Cantilever
from sautereau.rig.instrument import Plectrum


class Beam(Cantilever):
    """A plectrum of uniform section, linear in the force."""

    tip_length = 0.0
    """m, of the tip's section."""
    _added = 0.0
    """1/(N m^2), additional compliance of the tip's section."""

    def _bend(self, s: Floats, force: Floats, drag: Floats) -> Bend:
        ei, added, u = self.bending_stiffness, self._added, self._in_tip(s)
        theta_f = -(s**2 / (2 * ei) + u**2 / 2 * added)
        z_f = -(s**3 / (3 * ei) + u**3 / 3 * added)
        return Bend(
            x=s.copy(),
            z=force * z_f,
            theta=force * theta_f,
            x_s=np.ones_like(s),
            z_s=-force * (s**2 / ei + u**2 * added),
            theta_s=-force * (s / ei + u * added),
            x_f=np.zeros_like(s),
            z_f=z_f,
            theta_f=theta_f,
        )

    def _force_limit(self, s: Floats) -> Floats:
        return np.pi / (s**2 / self.bending_stiffness + self._in_tip(s) ** 2 * self._added)

    def _in_tip(self, s: Floats) -> Floats:
        """Return the part [m] of s that lies in the tip's section."""
        return np.maximum(s - (self.length - self.tip_length), 0.0)


class TwoBeam(Beam):
    """A plectrum thinned towards its tip, of two rigidly joined sections."""

    represents = ("tip_thickness",)

    def __init__(self, plectrum: Plectrum):
        """Read and check the plectrum's parameters.

        Raises:
            ModelError: Friction, stiffness or the tip's section are out of range.
        """
        super().__init__(plectrum)
        length, thickness = plectrum.tip_length, plectrum.tip_thickness
        self.tip_length = plectrum.length / 2 if length is None else length
        self.tip_thickness = plectrum.thickness if thickness is None else thickness
        if not 0 < self.tip_length <= self.length:
            raise ModelError(
                f"plectrum.tip_length: {self.tip_length * 1e3:.6g} mm is not within 0 to"
                f" {self.length * 1e3:.6g} mm, the plectrum's length; change it"
            )
        tip = self.bending_stiffness * (self.tip_thickness / plectrum.thickness) ** 3
        if not 0 < tip < np.inf:
            raise ModelError(
                f"plectrum.tip_thickness: at {self.tip_thickness * 1e3:.6g} mm the tip's bending"
                f" stiffness of {tip:.6g} N m^2 is not finite and above 0; change it"
            )
        self._added = 1 / tip - 1 / self.bending_stiffness
