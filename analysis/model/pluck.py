"""The quasi-static pluck: contact, bending, sliding, release for a jack going up.

Between plectrum and spring string all is a function of the jack's height h above first
contact. With the force F as parameter the contact's position s solves
X(s, F) = x0 - F sin(theta) / K, and then h = F cos(theta) / K - Z(s, F): PHYSICS of the
string (paper, 2.4) and of the plectrum's map. The string leaves at s = length.
"""

import math
from dataclasses import dataclass

import numpy as np

from analysis.errors import ModelError
from analysis.model.plectrum.base import Floats, PlectrumMap

POINTS = 401
"""Points of the tabulated pluck."""
ROUNDING = 1e-15
"""1, of the plectrum's length: a residual that is no more than rounding."""


@dataclass(frozen=True)
class Pluck:
    """Pluck from contact to release, at increasing height; arrays of shape (n,)."""

    height: Floats
    """m, of the jack above first contact."""
    force: Floats
    """N, normal to the plectrum's surface."""
    position: Floats
    """m, of the string along the plectrum, from the clamp."""
    angle: Floats
    """rad, by which the plectrum is bent down under the string."""
    lift: Floats
    """m, of the string, upwards."""
    shift: Floats
    """m, of the string, outwards along the plectrum."""

    @property
    def vertical_force(self) -> Floats:
        """N, with which the string pushes the jack down."""
        return self.force * np.cos(self.angle)

    @property
    def release_height(self) -> float:
        """m, of the jack above first contact when the string leaves."""
        return float(self.height[-1])

    def force_on_jack(self, height: Floats) -> Floats:
        """Return the string's downward force [N] at heights [m]; zero off the string."""
        from scipy.interpolate import CubicSpline

        height = np.asarray(height, float)
        touching = (height >= 0) & (height <= self.release_height)
        spline = CubicSpline(self.height, self.vertical_force)
        return np.where(touching, spline(np.clip(height, 0, self.release_height)), 0.0)


def solve_pluck(plectrum: PlectrumMap, stiffness: float, overlap: float) -> Pluck:
    """Follow the string along the plectrum from first contact to the tip.

    Args:
        plectrum: The plectrum's map.
        stiffness: N/m, of the string at the plucking point, K of the paper's equation 2.
        overlap: m, from the string at rest to the tip, along the undeformed mid-line.

    Raises:
        ModelError: The overlap is not on the plectrum, the string has no stiffness, or it
            does not leave the plectrum within the range of its level.
    """
    if not 0 < stiffness < math.inf:
        raise ModelError(
            f"string: its stiffness of {stiffness:.4g} N/m must be finite and above 0;"
            " see string.tension and string.plucking_point"
        )
    if not 0 < overlap < plectrum.length:
        raise ModelError(
            f"plectrum.overlap: {overlap * 1e3:.6g} mm must lie between 0 and the plectrum's"
            f" length of {plectrum.length * 1e3:.6g} mm; change it"
        )
    rest = plectrum.length - overlap
    release = _release_force(plectrum, stiffness, rest)
    force = np.linspace(0.0, release, POINTS)
    position = _position(plectrum, stiffness, rest, force)
    position[-1] = plectrum.length
    bend = plectrum.bend(position, force)
    lift = force * np.cos(bend.theta) / stiffness
    height = lift - bend.z
    if np.any(np.diff(height) <= 0):
        turn = float(height[np.argmax(np.diff(height) <= 0)])
        raise ModelError(
            f"plectrum.overlap: at {overlap * 1e3:.6g} mm the plectrum gives way under the string"
            f" at a jack height of {turn * 1e3:.4g} mm, before the string reaches its tip;"
            " lower overlap or raise plectrum.thickness"
        )
    return Pluck(
        height, force, position, -bend.theta, lift, -force * np.sin(bend.theta) / stiffness
    )


def _release_force(plectrum: PlectrumMap, stiffness: float, rest: float) -> float:
    """Return the force [N] at which the string has come to the tip."""
    from scipy.optimize import root_scalar

    def beyond(force: float) -> float:
        bend = plectrum.bend(plectrum.length, force)
        return float(bend.x - (rest - force * np.sin(bend.theta) / stiffness))

    limit = float(plectrum.force_limit(plectrum.length))
    if beyond(limit) > 0:
        raise ModelError(
            f"plectrum.overlap: at {(plectrum.length - rest) * 1e3:.6g} mm the string is still held"
            f" at {limit:.4g} N, where the plectrum is bent beyond this level's range;"
            " lower overlap or raise string.tension"
        )
    found = root_scalar(
        beyond, bracket=(0.0, limit), method="brentq", xtol=1e-15 * limit, rtol=1e-14
    )
    return float(found.root)


def _position(plectrum: PlectrumMap, stiffness: float, rest: float, force: Floats) -> Floats:
    """Solve X(s, F) = x0 - F sin(theta) / K for s [m] by Newton's method, shape (n,)."""
    s, residual = np.full_like(force, rest), np.full_like(force, np.inf)
    for _ in range(50):
        bend = plectrum.bend(s, force)
        residual = bend.x - rest + force * np.sin(bend.theta) / stiffness
        slope = bend.x_s + force * np.cos(bend.theta) * bend.theta_s / stiffness
        step = residual / slope
        found = np.abs(residual) <= ROUNDING * plectrum.length
        if np.all(found | (np.abs(step) <= 10 * ROUNDING * plectrum.length)):
            return s
        s = np.clip(s - step, 0.5 * rest, 1.01 * plectrum.length)
    raise ModelError(
        "the string's position on the plectrum was not found (residual"
        f" {np.abs(residual).max():.3g} m at a string of {stiffness:.4g} N/m);"
        " stiffness or overlap are out of the model's range"
    )
