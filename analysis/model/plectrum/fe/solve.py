"""Newton's method for one loaded plectrum, continued from load to load."""

from collections.abc import Sequence

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.fe.body import Body
from sautereau.analysis.model.plectrum.fe.load import Patch

ITERATIONS = 12
"""Maximum per load step."""
RESIDUAL = 1e-10
"""Dimensionless tolerance on the residual relative to the load, apart from rounding."""
HALVINGS = 8
"""Maximum per load step."""
_REMEMBERED = 4


def solve_loads(body: Body, patch: Patch, forces: Sequence[float] | Floats) -> list[Floats]:
    """Return the displacements, each of shape (size,), under forces in increasing order.

    Every step starts from the extrapolation of the steps before it; a step that does not
    converge is halved.

    Args:
        body: The meshed plectrum.
        patch: Where the load is.
        forces: Normal forces, in E W L.

    Raises:
        ModelError: A step does not converge after all halvings.
    """
    path = [(0.0, np.zeros(body.size))]
    found = []
    for target in forces:
        target = float(target)
        halvings = 0
        while path[-1][0] != target:
            step = (target - path[-1][0]) / 2**halvings
            force = target if halvings == 0 else path[-1][0] + step
            u = newton(body, patch, force, _extrapolated(path, force))
            if u is not None:
                path = [*path[-_REMEMBERED:], (force, u)]
                halvings = max(0, halvings - 1)
            elif halvings < HALVINGS:
                halvings += 1
            else:
                raise ModelError(
                    f"plectrum: its finite elements find no equilibrium past a load of"
                    f" {path[-1][0]:.4g} E W L, on the way to {target:.4g}; lower the"
                    " force, or correct plectrum.outline where it is thin"
                )
        found.append(path[-1][1])
    return found


def newton(body: Body, patch: Patch, force: float, u: Floats) -> Floats | None:
    """Return the displacements at a force, starting from u; None if Newton's method fails."""
    for guess, residual, tolerance in iterates(body, patch, force, u):
        if residual <= tolerance:
            return guess
        if not residual < 1e6 * force + 1:
            return None
    return None


def iterates(body: Body, patch: Patch, force: float, u: Floats):
    """Yield displacements, largest residual and its tolerance, starting with u."""
    from scipy.linalg import LinAlgError, solve_banded

    free, width = slice(body.clamped, None), body.band
    for _ in range(ITERATIONS):
        internal, band = body.linearised(u)
        load = force * patch.unit_load(u)
        residual = (load - internal)[free]
        rounding = 8 * np.finfo(float).eps * np.abs(u).max() * np.abs(band[width]).max()
        yield u, np.abs(residual).max(), RESIDUAL * np.abs(load).max() + rounding
        g, p = (part[free] for part in patch.turning(u))
        if not np.all(np.isfinite(band)):
            return
        try:
            step, turn = solve_banded(
                (width, width), band[:, free], np.column_stack([residual, g]), check_finite=False
            ).T
        except LinAlgError:
            return
        # Sherman-Morrison: the load follows the surface, which adds F g p^T to the tangent.
        step = step + turn * (force * (p @ step) / (1 - force * (p @ turn)))
        u = u.copy()
        u[free] += step


def rate(body: Body, patch: Patch, force: float, u: Floats) -> Floats:
    """Return du/dF, shape (size,), at an equilibrium."""
    from scipy.linalg import solve_banded

    free, width = slice(body.clamped, None), body.band
    _, band = body.linearised(u)
    g, p = (part[free] for part in patch.turning(u))
    right = np.column_stack([patch.unit_load(u)[free], g])
    straight, turn = solve_banded((width, width), band[:, free], right).T
    out = np.zeros(body.size)
    out[free] = straight + turn * (force * (p @ straight) / (1 - force * (p @ turn)))
    return out


def _extrapolated(path: list[tuple[float, Floats]], force: float) -> Floats:
    """Return the extrapolation of the steps so far to a force, by Lagrange's polynomial."""
    known = np.array([step[0] for step in path])
    guess = np.zeros_like(path[0][1])
    for i, (place, u) in enumerate(path):
        others = np.delete(known, i)
        guess += u * np.prod((force - others) / (place - others))
    return guess
