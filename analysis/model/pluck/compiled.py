"""One step of the pluck compiled: from a height of the jack to the contact, in under 1 us.

For engines that step the jack in time. Needs numba, the extra `fast`: it is the one compiler
that takes this arithmetic as Python. `solve_pluck` is the tested reference.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.pluck.table import CELLS, ORDER, Table

SOLVED, LOST = 0, 1
"""What a compiled solve says of itself: found, or no equilibrium near where it began."""
NEWTON_STEPS = 30
TOLERANCE = 1e-13


class Contact(NamedTuple):
    """Where the string is on the plectrum, and with which force."""

    s: float
    """m, from the clamp."""
    force: float
    """N, normal to the plectrum's surface."""
    status: int
    """`SOLVED` or `LOST`."""


def contact_solver(table: Table, length: float, bending_stiffness: float, overlap: float):
    """Return the compiled ``solve(height, s, force, stiffness) -> (s, force, status)``.

    It takes the jack's height above first contact [m], the contact at the previous height and
    the string's stiffness [N/m], and finds the sliding contact by Newton's method on both
    equations of equilibrium at once. Past the tip s is more than the length: released. At a
    fold there is no contact nearby: `LOST`.

    Args:
        table: Of the elastica, for the friction.
        length: m, of the plectrum.
        bending_stiffness: N m^2.
        overlap: m.

    Raises:
        ModelError: numba is not installed.
    """
    step = compiled_solve()
    coefficients = cell_major(table)
    q_max, rest = table.q_max, length - overlap

    def solve(height: float, s: float, force: float, stiffness: float) -> Contact:
        return Contact(
            *step(height, s, force, coefficients, q_max, bending_stiffness, rest, stiffness)
        )

    return solve


def cell_major(table: Table) -> Floats:
    """Return a table's coefficients with all of a cell beside each other, (CELLS, ORDER, 4)."""
    return np.ascontiguousarray(np.moveaxis(table.coefficients, 2, 0))


@cache
def compiled_solve():
    """Return `solve_contact` compiled, for callers that are compiled themselves.

    Raises:
        ModelError: numba is not installed.
    """
    try:
        from numba import njit
    except ImportError:
        raise ModelError(
            "numba is not installed, and the compiled solve needs it;"
            " pip install 'sautereau[fast]', or use solve_pluck"
        ) from None
    return njit(cache=True, fastmath=False)(solve_contact)


def solve_contact(height, s, force, coefficients, q_max, bending_stiffness, rest, stiffness):
    """Solve X(s, F) = x0 + F along / K and Z(s, F) + h = F up / K by Newton's method.

    Plain Python for numba to compile; arguments as in `contact_solver`.
    """
    per_q = CELLS / q_max
    for _ in range(NEWTON_STEPS):
        q = force * s * s / bending_stiffness
        place = q * per_q
        if not (0.0 <= place <= CELLS * (1 + 1e-9) and s > 0.0):
            return s, force, LOST
        cell = min(int(place), CELLS - 1)
        t = place - cell - 0.5
        c = coefficients[cell]
        top = ORDER - 1
        x, z, along, up = c[top, 0], c[top, 1], c[top, 2], c[top, 3]
        x_q = z_q = along_q = up_q = 0.0
        for power in range(ORDER - 2, -1, -1):
            x_q, z_q = x_q * t + x, z_q * t + z
            along_q, up_q = along_q * t + along, up_q * t + up
            x, z = x * t + c[power, 0], z * t + c[power, 1]
            along, up = along * t + c[power, 2], up * t + c[power, 3]
        pull = force / stiffness
        out = s * x - rest - pull * along
        lift = height + s * z - pull * up
        # q grows by 2 q / s with s, and by q / F = s^2 / EI with F.
        q_s, q_f = 2.0 * q / s * per_q, s * s / bending_stiffness * per_q
        out_s = x + (s * x_q - pull * along_q) * q_s
        out_f = (s * x_q - pull * along_q) * q_f - along / stiffness
        lift_s = z + (s * z_q - pull * up_q) * q_s
        lift_f = (s * z_q - pull * up_q) * q_f - up / stiffness
        scale = TOLERANCE * (rest + pull + abs(height))
        if abs(out) <= scale and abs(lift) <= scale:
            return s, force, SOLVED
        size = out_s * lift_f - out_f * lift_s
        if size == 0.0:
            return s, force, LOST
        s -= (out * lift_f - lift * out_f) / size
        force -= (out_s * lift - lift_s * out) / size
    return s, force, LOST
