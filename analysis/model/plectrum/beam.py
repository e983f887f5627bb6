"""Euler-Bernoulli cantilever of uniform section under small rotation.

z = -F s^3 / 3EI and theta = -F s^2 / 2EI, with x = s: the plectrum does not shorten. The
string is released because the tip retracts, so this level releases late, although its force
at a given position is accurate. Friction pulls along the plectrum and has no lever while the
rotation is small: it does not bend it at first order, and mu changes nothing here.
"""

import numpy as np

from sautereau.analysis.model.plectrum.base import Bend, Floats
from sautereau.analysis.model.plectrum.cantilever import Cantilever


class Beam(Cantilever):
    """A plectrum of uniform section, linear in the force."""

    def _bend(self, s: Floats, force: Floats) -> Bend:
        ei = self.bending_stiffness
        return Bend(
            x=s.copy(),
            z=-force * s**3 / (3 * ei),
            theta=-force * s**2 / (2 * ei),
            x_s=np.ones_like(s),
            z_s=-force * s**2 / ei,
            theta_s=-force * s / ei,
            x_f=np.zeros_like(s),
            z_f=-(s**3) / (3 * ei),
            theta_f=-(s**2) / (2 * ei),
        )

    def _force_limit(self, s: Floats) -> Floats:
        return np.pi * self.bending_stiffness / s**2
