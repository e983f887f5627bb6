"""A jack and what acts on it: weight, string, tongue and damper, in plain floats."""

import math
from bisect import bisect_right
from dataclasses import dataclass
from enum import Enum

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.choirs import choir_pluck, choirs
from sautereau.analysis.model.pluck.pluck import Pluck
from sautereau.rig.instrument import Choir
from sautereau.rig.schema import Rig
from sautereau.rig.section import GRAVITY
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.scene import Scene


class StringState(Enum):
    """Where a plectrum is with its string."""

    BELOW = "below"
    HELD = "held"
    ABOVE = "above"
    PASSING = "passing"


class PluckLaw:
    """A pluck's own spline, each cubic of it found again from four of its values.

    Outside the pluck it goes on straight, for the trial steps of an integrator.
    """

    def __init__(self, pluck: Pluck):
        knots = pluck.height
        places = np.array([1, 3, 5, 7]) / 8
        values = pluck.force_on_jack(knots[:-1, None] + np.diff(knots)[:, None] * places)
        coefficients = np.linalg.solve(np.vander(places, 4), values.T).T
        self._knots: list[float] = knots.tolist()
        self._cubics: list[list[float]] = coefficients.tolist()
        self.release_height = self._knots[-1]
        """m, above first contact."""

    def force(self, height: float) -> float:
        """Return the string's force [N] on the jack, downwards, at a height [m]."""
        knots = self._knots
        i = min(max(bisect_right(knots, height) - 1, 0), len(knots) - 2)
        span = knots[i + 1] - knots[i]
        u = (height - knots[i]) / span
        within = min(max(u, 0.0), 1.0)
        c3, c2, c1, c0 = self._cubics[i]
        value = ((c3 * within + c2) * within + c1) * within + c0
        if u == within:
            return value
        return value + ((3 * c3 * within + 2 * c2) * within + c1) * (u - within)


@dataclass(frozen=True)
class JackLaw:
    """One jack in numbers; the key's rise under it is b tan a + hb (1 / cos a - 1)."""

    mass: float
    """kg."""
    friction: float
    """N, dry."""
    arm: float
    """m, b."""
    height: float
    """m, hb."""
    clearance: float
    """m, rise at which the plectrum meets the string."""
    pluck: PluckLaw | None
    """None for a mute jack."""
    tongue_force: float
    """N, of the tongue as it begins to turn."""
    tongue_stiffness: float
    """N/m, its growth with the drop."""
    travel: float
    """m, drop at which the plectrum has passed the string."""
    lift: float
    """m, rise at which the damper leaves the string; minus infinity for none."""
    damper_stiffness: float
    """N/m."""

    def foot(self, angle: float) -> tuple[float, float, float]:
        """Return the key's rise [m] under the jack and its slopes by the angle [m/rad, m/rad^2]."""
        sine, cosine = math.sin(angle), math.cos(angle)
        b, hb = self.arm, self.height
        rise = b * sine / cosine + hb * 2 * math.sin(angle / 2) ** 2 / cosine
        slope = (b + hb * sine) / cosine**2
        return rise, slope, (2 * b * sine + hb * (1 + sine * sine)) / cosine**3

    def string_force(self, state: StringState, rise: float) -> float:
        """Return the force [N] of string on plectrum, downwards."""
        height = rise - self.clearance
        if state is StringState.HELD and self.pluck:
            return self.pluck.force(height)
        if state is StringState.PASSING:
            return -(self.tongue_force - self.tongue_stiffness * height)
        return 0.0

    def burden(self, string_force: float, damped: bool, rise: float) -> float:
        """Return weight, string and damper together [N], downwards."""
        felt = self.damper_stiffness * (self.lift - rise) if damped else 0.0
        return self.mass * GRAVITY + string_force - felt


def jack_laws(rig: Rig, scene: Scene) -> tuple[JackLaw, ...]:
    """Return the jacks of a bench as a scene shows them, the first one first.

    Args:
        rig: The bench as it truly is.
        scene: What of it is shown.

    Raises:
        SceneError: A choir has no pluck.
    """
    try:
        return tuple(_jack_law(rig, scene, choir) for choir in choirs(rig))
    except ModelError as error:
        raise SceneError(f"rig {rig.name}: {error}") from error


def _jack_law(rig: Rig, scene: Scene, choir: Choir) -> JackLaw:
    jack, plectrum = choir.jack, choir.plectrum
    pluck = None if scene.plectrum == "none" else PluckLaw(choir_pluck(choir, scene.plectrum))
    force = stiffness = travel = 0.0
    if scene.tongue and jack.tongue:
        lever = plectrum.length - plectrum.overlap
        force = jack.tongue.bristle_moment / lever
        stiffness = jack.tongue.bristle_stiffness / lever**2
        travel = lever * plectrum.overlap / jack.tongue.pivot
    damper = jack.damper if scene.damper else None
    return JackLaw(
        mass=jack.mass,
        friction=jack.register_friction if scene.friction else 0.0,
        arm=choir.jack_arm,
        height=rig.key.jack_surface_height,
        clearance=jack.string_clearance,
        pluck=pluck,
        tongue_force=force,
        tongue_stiffness=stiffness,
        travel=travel,
        lift=damper.lift if damper else -math.inf,
        damper_stiffness=damper.stiffness if damper else 0.0,
    )
