"""The whole press as the model sees it: a jack at constant speed."""

from dataclasses import dataclass

import numpy as np

from analysis.errors import ModelError
from analysis.model.key import finger_force
from analysis.model.plectrum.base import Floats, PlectrumMap
from analysis.model.plectrum.elastica import Elastica
from analysis.model.pluck import Pluck, solve_pluck
from analysis.model.string import release_speed
from rig.schema import Rig
from trajectory.expected import Expectation
from trajectory.key import key_motion
from trajectory.motion import Motion

LEVELS: dict[str, type[Elastica]] = {"elastica": Elastica}
"""Levels of the plectrum by name."""
STEPS = 2000
"""Instants of a prediction."""


@dataclass(frozen=True)
class Prediction:
    """A press with the jack at constant speed; arrays of shape (n,) on one time base."""

    level: str
    time: Floats
    """s, from the moment the jack leaves its rest."""
    rise: Floats
    """m, of the jack."""
    deflection: Floats
    """m, of the key at the laser, downwards."""
    string_force: Floats
    """N, of the string on the jack."""
    finger_force: Floats
    """N, of the finger on the key."""
    contact: float
    """s."""
    release: float
    """s."""
    release_force: float
    """N, between plectrum and string."""
    release_lift: float
    """m, of the string."""
    release_angle: float
    """rad, of the plectrum under the string."""
    v_osc: float
    """m/s, of the released string."""

    @property
    def contact_duration(self) -> float:
        """Time the string is held [s]."""
        return self.release - self.contact

    @property
    def finger_force_peak(self) -> float:
        """Largest force of the finger [N]."""
        return float(self.finger_force.max())


def expectation(prediction: Prediction) -> Expectation:
    """Return what a planner needs to know of a predicted press."""
    held = np.flatnonzero(prediction.string_force > 0)
    return Expectation(
        rise=prediction.rise,
        force=prediction.finger_force,
        contact=float(prediction.rise[held[0] - 1]),
        release=float(prediction.rise[held[-1]]),
    )


def plectrum_map(rig: Rig, level: str) -> PlectrumMap:
    """Return the map of the rig's plectrum at a level.

    Raises:
        ModelError: There is no such level.
    """
    if level not in LEVELS:
        raise ModelError(f"level {level!r} is not known; take one of {', '.join(LEVELS)}")
    return LEVELS[level](rig.plectrum)


def rig_pluck(rig: Rig, level: str = "elastica") -> Pluck:
    """Return the pluck of the rig's plectrum and spring string."""
    stiffness = rig.string.static_stiffness
    return solve_pluck(plectrum_map(rig, level), stiffness, rig.plectrum.overlap)


def predict(rig: Rig, level: str = "elastica") -> Prediction:
    """Predict the press of a rig: deflection and force while the jack rises steadily.

    Raises:
        ModelError: The level has no solution for this rig, or the press ends too soon.
    """
    pluck = rig_pluck(rig, level)
    speed, clearance = rig.press.jack_speed, rig.jack.string_clearance
    released = clearance + pluck.release_height
    if released >= rig.press.jack_rise:
        raise ModelError(
            f"press.jack_rise: {rig.press.jack_rise * 1e3:.4g} mm ends before the string is"
            f" released at {released * 1e3:.4g} mm; raise jack_rise or lower plectrum.overlap"
        )
    # Contact and release are instants of the time base, release with the string still held.
    after = released * (1 + 1e-12)
    rise = np.linspace(0.0, rig.press.jack_rise, STEPS)
    rise = np.sort(np.concatenate([rise, [clearance, released, after]]))
    still = np.zeros_like(rise)
    angle = key_motion(rig.key, Motion(rise, np.full_like(rise, speed), still))
    held = (rise >= clearance) & (rise <= released)
    string_force = np.zeros_like(rise)
    string_force[held] = pluck.force_on_jack(
        np.minimum(rise[held] - clearance, pluck.release_height)
    )
    return Prediction(
        level=level,
        time=rise / speed,
        rise=rise,
        deflection=rig.key.laser_arm * angle.position,
        string_force=string_force,
        finger_force=finger_force(rig, angle, string_force),
        contact=clearance / speed,
        release=released / speed,
        release_force=float(pluck.force[-1]),
        release_lift=float(pluck.lift[-1]),
        release_angle=float(pluck.angle[-1]),
        v_osc=release_speed(rig.string, float(pluck.lift[-1])),
    )
