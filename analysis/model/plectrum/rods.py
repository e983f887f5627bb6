"""Rigid rods joined by torsion springs: the discrete chain of the paper's reference [4].

The part of the plectrum between clamp and string is divided into N equal rods of length
l = s / N. A joint stands for the bending of half a rod on either side of it, so its spring
has the stiffness EI / l, and 2 EI / l at the clamp, where there is one side only: x, z and
theta then converge to the elastica as 1 / N^2, and theta as 1 / N^4 without friction, because
with psi'' = cos psi the errors of the interior and of both ends cancel. The rods are laid out
separately for every s; with joints fixed in the material the slopes by s would jump whenever
the string passes one. At the tip, where the string is released, both chains are the same.

Seen from the loaded rod the load is known, so the chain is computed from there to the clamp,
joint by joint, without iteration: the moment of the load is the sum of its levers so far.
For small loads theta is that of the beam, and z that of the beam times 1 + 1 / (2 N^2).
"""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Bend, Floats
from sautereau.analysis.model.plectrum.cantilever import Cantilever, similar
from sautereau.rig.instrument import Plectrum

RODS_MAX = 10_000  # The computing time is proportional to the number of rods


class Rods(Cantilever):
    """The plectrum as a chain of rigid rods."""

    def __init__(self, plectrum: Plectrum, count: int = 20):
        """Read and check the plectrum's parameters.

        Args:
            count: Rods between clamp and string; by default 20, with which
                deflections under small loads are 0.125 % too large.

        Raises:
            ModelError: Friction, stiffness or count are out of range.
        """
        super().__init__(plectrum)
        if not 1 <= count <= RODS_MAX or count != int(count):
            raise ModelError(f"rods: {count} is not a whole number of 1 to {RODS_MAX}; change it")
        self.count = int(count)
        self._q_max = q_max(self.friction, self.count)

    def _bend(self, s: Floats, force: Floats, drag: Floats) -> Bend:
        q = force * s**2 / self.bending_stiffness
        return similar(s, force, self.bending_stiffness, march(q, drag, self.count))

    def _force_limit(self, s: Floats) -> Floats:
        return self._q_max * self.bending_stiffness / s**2


def march(q: ArrayLike, drag: ArrayLike, count: int) -> tuple[Floats, ...]:
    """Return x/s, z/s and theta of the loaded point, then their derivatives by q.

    Args:
        q: 1, loads F s^2 / EI, any shape.
        drag: 1, force along the loaded rod over the one across it; any shape that fits.
        count: N, rods.
    """
    q, drag = np.asarray(q, float), np.asarray(drag, float)
    rod = 1 / count
    # psi: angle of the rod against the loaded one; along, across: components along and across the
    # loaded rod of the way from the loaded point to this rod's inner end; derivatives by q.
    psi = psi_q = turn = turn_q = np.zeros_like(q)
    along = along_q = across = across_q = np.zeros_like(q)
    for _ in range(count):
        psi, psi_q = psi + turn, psi_q + turn_q
        x, z = rod * np.cos(psi), rod * np.sin(psi)
        along, along_q = along + x, along_q - psi_q * z
        across, across_q = across + z, across_q + psi_q * x
        lever, lever_q = along + drag * across, along_q + drag * across_q
        turn, turn_q = rod * q * lever, rod * (lever + q * lever_q)
    # The joint at the clamp is twice as stiff.
    psi, psi_q = psi + turn / 2, psi_q + turn_q / 2
    cos, sin = np.cos(psi), np.sin(psi)
    x, z = cos * along + sin * across, cos * across - sin * along
    x_q = cos * along_q + sin * across_q + psi_q * z
    z_q = cos * across_q - sin * along_q - psi_q * x
    return x, z, -psi, x_q, z_q, -psi_q


@lru_cache(maxsize=128)
def q_max(friction: float, count: int) -> float:
    """Return the load q that turns the tangent by just under 90 degrees."""
    from scipy.optimize import root_scalar

    def short_of(q: float) -> float:
        return float(march(q, friction, count)[2]) + np.pi / 2

    return 0.998 * root_scalar(short_of, bracket=(1.0, 5.0), xtol=1e-12).root
