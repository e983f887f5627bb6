"""A jack and its forces: weight, string, tongue and damper, in plain floats."""

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


class StringMode(Enum):
    """Mode of a plectrum and its string."""

    BELOW = "below"
    HELD = "held"
    ABOVE = "above"
    PASSING = "passing"


class PluckLaw:
    """A pluck's force spline, each cubic recovered from four of its values.

    Outside the pluck it continues linearly, for the trial steps of an integrator.
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
    """Parameters of one jack; the key's rise under it is b tan a + hb (1 / cos a - 1)."""

    mass: float
    """kg."""
    friction: float
    """N, dry."""
    arm: float
    """m, b."""
    height: float
    """m, hb."""
    clearance: float
    """m, rise at contact of plectrum and string."""
    pluck: PluckLaw | None
    """None for a mute jack."""
    tongue_force: float
    """N, of the tongue as it starts to turn."""
    tongue_stiffness: float
    """N/m, increase of that force per drop."""
    travel: float
    """m, drop at which the plectrum has passed the string."""
    lift: float
    """m, rise at which the damper leaves the string; minus infinity without a damper."""
    damper_stiffness: float
    """N/m."""

    def kinematics(self, angle: float) -> tuple[float, float, float]:
        """Return the key's rise [m] under the jack and its derivatives [m/rad, m/rad^2]."""
        sine, cosine = math.sin(angle), math.cos(angle)
        b, hb = self.arm, self.height
        rise = b * sine / cosine + hb * 2 * math.sin(angle / 2) ** 2 / cosine
        slope = (b + hb * sine) / cosine**2
        return rise, slope, (2 * b * sine + hb * (1 + sine * sine)) / cosine**3

    def string_force(self, state: StringMode, rise: float) -> float:
        """Return the force [N] of string on plectrum, downwards."""
        height = rise - self.clearance
        if state is StringMode.HELD and self.pluck:
            return self.pluck.force(height)
        if state is StringMode.PASSING:
            return -(self.tongue_force - self.tongue_stiffness * height)
        return 0.0

    def static_load(self, string_force: float, damped: bool, rise: float) -> float:
        """Return the sum of weight, string and damper [N], downwards."""
        felt = self.damper_stiffness * (self.lift - rise) if damped else 0.0
        return self.mass * GRAVITY + string_force - felt


def jack_laws(rig: Rig, scene: Scene) -> tuple[JackLaw, ...]:
    """Return the jacks of a bench, those of the first choir first.

    Args:
        rig: The true bench.
        scene: Which parts are enabled.

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
