"""The wire that rolls over the tip's edge before it is released.

The wire of radius r that has turned by phi about the tip's edge has its centre
r (sin(a + phi) - sin a) further out and r (cos a - cos(a + phi)) lower, where a is the angle
by which the plectrum is bent down; the force's part along the plectrum, over the one normal
to it, is T = tan(atan mu - phi).
"""

import math

import numpy as np

from sautereau.analysis.model.plectrum.base import Floats, PlectrumMap
from sautereau.analysis.model.pluck.equilibria import NEWTON_STEPS, Curve

POINTS = 201
"""Points of the stretch, and of the search for its end within one of its steps."""
NARROWINGS = 3
"""Times that the end is searched for, each time between two neighbours of the last."""


def roll(
    plectrum: PlectrumMap, stiffness: float, overlap: float, radius: float, force: float
) -> Curve:
    """Return the equilibria of a wire that turns about the tip's edge, until the height folds.

    Args:
        plectrum: The plectrum's map.
        stiffness: N/m, of the string.
        overlap: m.
        radius: m, of the wire.
        force: N, normal to the plectrum, as the wire reaches the edge.

    Returns:
        The curve, shape (n,); a single point where the wire does not roll.
    """

    def at(turn: Floats) -> Curve:
        return _rolled(plectrum, stiffness, plectrum.length - overlap, radius, force, turn)

    turn = np.linspace(0.0, (math.pi / 2 + math.atan(plectrum.friction)) * 0.999, POINTS)
    curve = at(turn)
    falling = np.diff(curve.height) <= 0
    if not falling.any():
        return curve
    top, near = int(np.argmax(falling)), turn
    for _ in range(NARROWINGS):
        near = np.linspace(near[max(top - 1, 0)], near[min(top + 1, POINTS - 1)], POINTS)
        top = int(np.argmax(at(near).height))
    curve = at(np.linspace(0.0, near[top], POINTS))
    return curve if np.all(np.diff(curve.height) > 0) else at(turn[:1])


def _rolled(
    plectrum: PlectrumMap, stiffness: float, rest: float, radius: float, force: float, turn: Floats
) -> Curve:
    """Return the equilibria of a wire that has turned by angles [rad], shape (n,)."""
    position = np.full_like(turn, plectrum.length)
    limit = float(plectrum.force_limit(plectrum.length))
    drag = np.tan(math.atan(plectrum.friction) - turn)
    found = np.full_like(turn, force)
    for _ in range(NEWTON_STEPS):
        bend = plectrum.bend(position, found)
        a, a_f = -bend.theta, -bend.theta_f
        out, up = np.sin(a) - drag * np.cos(a), np.cos(a) + drag * np.sin(a)
        value = bend.x - rest + radius * (np.sin(a + turn) - np.sin(a)) - found * out / stiffness
        slope = bend.x_f + radius * (np.cos(a + turn) - np.cos(a)) * a_f
        slope -= (out + found * up * a_f) / stiffness
        step = value / slope
        found = np.clip(found - step, 0, limit)
        if np.all(np.abs(step) <= 1e-14 * force):
            break
    bend = plectrum.bend(position, found)
    a = -bend.theta
    lift = found * (np.cos(a) + drag * np.sin(a)) / stiffness
    shift = found * (np.sin(a) - drag * np.cos(a)) / stiffness
    sunk = radius * (np.cos(a) - np.cos(a + turn))
    load = found * plectrum.length**2
    return Curve(load, lift - bend.z + sunk, found, position, a, lift, shift, drag)
