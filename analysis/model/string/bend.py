"""The plectrum's bend at one place and force in plain floats, for who asks thousands of times.

numpy's price for a call is that of some hundred multiplications, and a bend takes fewer.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

from sautereau.analysis.model.plectrum.base import PlectrumMap
from sautereau.analysis.model.plectrum.elastica import Elastica
from sautereau.analysis.model.pluck.compiled import cell_major
from sautereau.analysis.model.pluck.table import CELLS, table

Bent = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float
]  # fmt: skip
"""x [m], z [m], and the force on the string along x and along z over F [1], friction included;
then the same four by s, and by F."""


class PointBend(NamedTuple):
    """A plectrum asked at one point at a time."""

    at: Callable[[float, float], Bent]
    """Bend for a position s [m] and a force F [N]."""
    limit: Callable[[float], float]
    """Largest force [N] at a position s [m]."""


def point_bend(plectrum: PlectrumMap) -> PointBend:
    """Return a plectrum's map for single points; the elastica's from its table."""
    return _of_elastica(plectrum) if isinstance(plectrum, Elastica) else _of_map(plectrum)


def _of_map(plectrum: PlectrumMap) -> PointBend:
    friction = plectrum.friction

    def at(s: float, force: float) -> Bent:
        x, z, theta, x_s, z_s, theta_s, x_f, z_f, theta_f = map(float, plectrum.bend(s, force))
        sine, cosine = math.sin(theta), math.cos(theta)
        out, up = -sine - friction * cosine, cosine - friction * sine
        return (
            x, z, out, up,
            x_s, z_s, -up * theta_s, out * theta_s,
            x_f, z_f, -up * theta_f, out * theta_f,
        )  # fmt: skip

    return PointBend(at, lambda s: float(plectrum.force_limit(s)))


def _of_elastica(plectrum: Elastica) -> PointBend:
    law = table(plectrum.friction)
    # One tuple of powers for each of the four fields of a cell.
    cells = [tuple(zip(*cell, strict=True)) for cell in cell_major(law).tolist()]
    stiffness, length, q_max = plectrum.bending_stiffness, plectrum.length, law.q_max
    per_q = CELLS / q_max

    def at(s: float, force: float) -> Bent:
        q_f = s * s / stiffness
        place = force * q_f * per_q
        cell = min(int(place), CELLS - 1)
        t = place - cell - 0.5
        fields = []
        for c0, c1, c2, c3, c4, c5 in cells[cell]:
            fields.append(((((c5 * t + c4) * t + c3) * t + c2) * t + c1) * t + c0)
            fields.append((((5 * c5 * t + 4 * c4) * t + 3 * c3) * t + 2 * c2) * t + c1)
        x, x_q, z, z_q, out, out_q, up, up_q = fields
        by_s, by_f = 2 * force * s / stiffness * per_q, q_f * per_q
        return (
            s * x, s * z, out, up,
            x + s * x_q * by_s, z + s * z_q * by_s, out_q * by_s, up_q * by_s,
            s * x_q * by_f, s * z_q * by_f, out_q * by_f, up_q * by_f,
        )  # fmt: skip

    def limit(s: float) -> float:
        return q_max * stiffness / min(s, length) ** 2

    return PointBend(at, limit)
