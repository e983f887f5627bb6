"""The plectrum's bend at one position and force in plain floats, for thousands of calls.

A numpy call costs as much as some hundred multiplications, and a bend takes fewer.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

from sautereau.analysis.model.plectrum.base import PlectrumMap
from sautereau.analysis.model.plectrum.elastica import Elastica
from sautereau.analysis.model.plectrum.surface import StringCentre
from sautereau.analysis.model.plectrum.table import laws_under

Bent = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float
]  # fmt: skip
"""x [m], z [m], and the force on the string along x and along z over F, friction included;
then the derivatives of these four by s, and by F."""


class PointBend(NamedTuple):
    """A plectrum's map for one point per call."""

    at: Callable[[float, float], Bent]
    """Bend for a position s [m] and a force F [N]."""
    limit: Callable[[float], float]
    """Largest force [N] at a position s [m]."""


def point_bend(plectrum: PlectrumMap) -> PointBend:
    """Return a plectrum's map for single points; that of a uniform elastica from its table."""
    centre = plectrum if isinstance(plectrum, StringCentre) else None
    uniform = centre.mid_line if centre else plectrum
    if isinstance(uniform, Elastica) and uniform.table.uniform:
        return _of_elastica(uniform, centre.half + centre.radius if centre else 0.0)
    return _of_map(plectrum)


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


def _of_elastica(plectrum: Elastica, offset: float) -> PointBend:
    table, _ = laws_under(plectrum.table, plectrum.friction)
    # The polynomials of each cell, one tuple of coefficients for each of x, z / q, theta / q.
    cells = table.c[..., 0, 0, :].transpose(1, 2, 0).tolist()
    width, largest = float(table.x[1]), plectrum.table.limit(plectrum.friction)
    last = len(cells) - 1
    stiffness, length, friction = plectrum.bending_stiffness, plectrum.length, plectrum.friction

    def at(s: float, force: float) -> Bent:
        q_f = s * s / stiffness
        q = force * q_f
        cell = min(int(q / width), last)
        t = q - cell * width
        (a5, a4, a3, a2, a1, a0), (b5, b4, b3, b2, b1, b0), (c5, c4, c3, c2, c1, c0) = cells[cell]
        x = ((((a5 * t + a4) * t + a3) * t + a2) * t + a1) * t + a0
        x_q = (((5 * a5 * t + 4 * a4) * t + 3 * a3) * t + 2 * a2) * t + a1
        z = ((((b5 * t + b4) * t + b3) * t + b2) * t + b1) * t + b0
        z_q = z + q * ((((5 * b5 * t + 4 * b4) * t + 3 * b3) * t + 2 * b2) * t + b1)
        theta = ((((c5 * t + c4) * t + c3) * t + c2) * t + c1) * t + c0
        theta_q = theta + q * ((((5 * c5 * t + 4 * c4) * t + 3 * c3) * t + 2 * c2) * t + c1)
        z *= q
        sine, cosine = math.sin(q * theta), math.cos(q * theta)
        out, up = -sine - friction * cosine, cosine - friction * sine
        q_s = 2 * force * s / stiffness
        out_q, up_q = -up * theta_q, out * theta_q
        # Of the string's centre, at the offset from the mid-line.
        x_q, z_q = s * x_q - offset * cosine * theta_q, s * z_q - offset * sine * theta_q
        return (
            s * x - offset * sine, s * z + offset * (cosine - 1), out, up,
            x + x_q * q_s, z + z_q * q_s, out_q * q_s, up_q * q_s,
            x_q * q_f, z_q * q_f, out_q * q_f, up_q * q_f,
        )  # fmt: skip

    def limit(s: float) -> float:
        return largest * stiffness / min(s, length) ** 2

    return PointBend(at, limit)
