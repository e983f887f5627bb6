"""The model's prediction of a complete press with the jack at a given speed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.choirs import (
    ChoirPluck,
    PlacedPluck,
    choir_pluck,
    choirs,
    hold,
    ignored,
    key_of,
    level_name,
    plucked,
    string_names,
)
from sautereau.analysis.model.key import finger_force
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.pluck.pluck import Pluck
from sautereau.rig.schema import Rig
from sautereau.trajectory.expected import Expectation
from sautereau.trajectory.key import angle_of_rise, key_motion, rise_of_angle
from sautereau.trajectory.motion import Motion


@dataclass(frozen=True)
class JackSpeed:
    """Speed and acceleration of a jack at increasing rises; arrays of shape (n,).

    Below the first rise and above the last both are as there.
    """

    rise: Floats
    """m."""
    speed: Floats
    """m/s, above 0."""
    acceleration: Floats
    """m/s^2."""

    @classmethod
    def constant(cls, speed: float) -> Self:
        """Return a constant speed [m/s]."""
        return cls(np.zeros(1), np.array([speed]), np.zeros(1))

    def at(self, rise: Floats) -> tuple[Floats, Floats]:
        """Return speed [m/s] and acceleration [m/s^2] at rises [m]."""
        return (
            np.interp(rise, self.rise, self.speed),
            np.interp(rise, self.rise, self.acceleration),
        )

    def scaled(self, factor: float) -> Self:
        """Return the motion with all rises multiplied by a factor."""
        return type(self)(factor * self.rise, factor * self.speed, factor * self.acceleration)

    def followed_by(self, later: Self) -> Self:
        """Return this speed, and beyond its last rise a later one."""
        beyond = later.rise > self.rise[-1]
        return type(self)(
            np.concatenate([self.rise, later.rise[beyond]]),
            np.concatenate([self.speed, later.speed[beyond]]),
            np.concatenate([self.acceleration, later.acceleration[beyond]]),
        )

    def time(self, rise: Floats) -> Floats:
        """Return the times [s] of increasing rises [m], the first of which is at 0 s."""
        slowness = 1 / self.at(rise)[0]
        steps = (slowness[1:] + slowness[:-1]) / 2 * np.diff(rise)
        return np.concatenate([[0.0], np.cumsum(steps)])


STEPS = 2000  # Instants of a prediction
DENSITIES = 1000.0, 20_000.0  # kg/m^3: gut and nylon have 1150 to 1350, overspun wires up to 18,000


@dataclass(frozen=True)
class Prediction(ChoirPluck):
    """A press with the jack at a given speed; arrays of shape (n,) on one time base.

    The inherited values are those of the first choir; `choirs` has all of them.
    """

    level: str
    """Of the plectra, as computed: for `auto` the level that was chosen."""
    warnings: tuple[str, ...]
    """What the level ignores, strings of no material, outlines that point to the clamp, a press
    that ends on the front felt, and strings that move too fast for a static model."""
    time: Floats
    """s, after the jack leaves rest."""
    rise: Floats
    """m, of the jack."""
    deflection: Floats
    """m, of the key at the laser, downwards."""
    finger_force: Floats
    """N, of the finger on the key, against all strings."""
    work: float
    """J, of the finger against the plectra of all choirs."""
    choirs: tuple[ChoirPluck, ...]
    """The pluck of every choir, in their order."""

    @property
    def peak_force(self) -> float:
        """Largest force of the finger [N]."""
        return float(self.finger_force.max())

    @property
    def release_force(self) -> float:
        """Finger force just before the first choir's string is released [N]."""
        return float(self.finger_force[np.flatnonzero(self.string_force > 0)[-1]])

    def near_pluck(self, beside: float, string: int = 1) -> NDArray[np.bool_]:
        """Return which instants are at most a time [s] before contact or after release.

        Args:
            string: Number of the string, from 1.
        """
        own = self.choirs[string - 1]
        return (self.time > own.contact - beside) & (self.time < own.release + beside)

    def from_contact(self, beside: float, string: int = 1) -> tuple[Floats, Floats]:
        """Return the key deflection since contact [m] and the finger force [N], shape (steps,).

        Args:
            beside: s, before contact and after release, that is returned as well.
            string: Number of the string, from 1.
        """
        near = self.near_pluck(beside, string)
        at_contact = np.interp(self.choirs[string - 1].contact, self.time, self.deflection)
        return self.deflection[near] - at_contact, self.finger_force[near]


def expectation(prediction: Prediction) -> Expectation:
    """Return force, contact and release of a predicted press for the planner, over all plucks."""
    held = np.flatnonzero(np.any([c.string_force > 0 for c in prediction.choirs], axis=0))
    return Expectation(
        rise=prediction.rise,
        force=prediction.finger_force,
        contact=float(prediction.rise[held[0] - 1]),
        release=float(prediction.rise[held[-1]]),
    )


def rig_pluck(rig: Rig, level: str = "auto") -> Pluck:
    """Return the pluck of the rig's first choir.

    Raises:
        ModelError: The level has no solution for this rig.
    """
    return choir_pluck(choirs(rig)[0], level)


def predict(rig: Rig, level: str = "auto", *, speed: JackSpeed | None = None) -> Prediction:
    """Predict the press of a rig: deflection and force while the jack rises.

    Args:
        rig: The bench; all its choirs are plucked.
        speed: Speed of the first jack; None: the constant `press.jack_speed`.

    Raises:
        ModelError: The level has no solution for this rig, or the press ends before release.
    """
    found = pressed(rig, hold(rig, level), level, speed)
    warnings = *ignored(rig, level), *_of_no_material(rig), *_to_clamp(rig), *_on_felt(rig, found)
    return replace(found, warnings=(*warnings, *_moving(rig, found)))


def _of_no_material(rig: Rig) -> list[str]:
    """Return a warning for each string whose numbers contradict each other."""
    return [
        f"{name}: tension, length, frequency and diameter belong to a wire of"
        f" {choir.string.density:.2g} kg/m^3, and materials have {DENSITIES[0]:g} to"
        f" {DENSITIES[1]:g}; check them in [string]"
        for name, choir in zip(string_names(rig), choirs(rig), strict=True)
        if not DENSITIES[0] < choir.string.density < DENSITIES[1]
    ]


def _to_clamp(rig: Rig) -> list[str]:
    """Return a warning for each outline that is thicker in its outer half than in its inner one."""
    found = []
    for name, choir in zip(string_names(rig), choirs(rig), strict=True):
        if (outline := choir.plectrum.outline) is None:
            continue
        thickness = np.subtract(outline.top, outline.bottom)
        at = np.linspace(0, outline.x[-1], 100)
        inner, outer = np.interp(at, outline.x, thickness).reshape(2, -1).mean(1) * 1e3
        if outer > 1.05 * inner:  # a photograph of a uniform one is within that
            found.append(
                f"{name}: plectrum.outline is {inner:.3g} mm thick in the half at the clamp and"
                f" {outer:.3g} mm in that at the tip; turn it if clamp and tip are exchanged"
            )
    return found


def _moving(rig: Rig, found: Prediction) -> list[str]:
    """Return a warning for each string that is not well below its Vosc while it is held.

    The errors are bounds of 116 random plucks against `modal_pluck`.
    """
    said = []
    for name, own in zip(string_names(rig), found.choirs, strict=True):
        part = own.release_lift / (own.release - own.contact) / own.v_osc
        if part > 0.1:  # The largest errors below are 3 % of the duration, 6 % of the lift
            said.append(
                f"{name}: while held it moves at {part:.2g} of Vosc, and the model omits its"
                f" inertia: the pluck duration may be wrong by {50 * part:.2g} %, the lift by"
                f" {80 * part:.2g} %; lower press.jack_speed"
            )
    return said


def _on_felt(rig: Rig, found: Prediction) -> list[str]:
    """Return a warning if the press ends with the key on its front felt."""
    key = rig.key
    depth = found.deflection * key.press_arm / key.laser_arm
    if depth[-1] <= key.dip:
        return []
    rise = float(np.interp(key.dip, depth, found.rise))
    return [
        f"press.jack_rise: of {rig.press.jack_rise * 1e3:.4g} mm the key is on its front felt from"
        f" {rise * 1e3:.4g} mm on (key.dip), whose force is part of the finger's; lower jack_rise"
    ]


def pressed(
    rig: Rig, held: Sequence[PlacedPluck], level: str = "auto", speed: JackSpeed | None = None
) -> Prediction:
    """Return the press in which a rig's strings are plucked as given, without warnings.

    `predict` adds them; at another level than `auto` they take that of `auto` to compare.
    """
    speed = speed or JackSpeed.constant(rig.press.jack_speed)
    # The plucks' own points are instants of the time base, release with the string still held.
    plucks = [at for h in held for at in (_rises(rig, h), [h.release * (1 + 1e-12)])]
    rise = np.unique(np.concatenate([np.linspace(0.0, rig.press.jack_rise, STEPS), *plucks]))
    time, moving = speed.time(rise), Motion(rise, *speed.at(rise))
    angle = key_motion(rig.key, moving)
    forces = np.stack([string_force_of(rig, h, rise, angle.position) for h in held])
    all_choirs = tuple(
        plucked(
            rig,
            h,
            force,
            (float(np.interp(h.contact, rise, time)), float(np.interp(h.release, rise, time))),
            float(speed.at(np.array(h.release))[0]),
        )
        for h, force in zip(held, forces, strict=True)
    )
    first: dict[str, Any] = vars(all_choirs[0]) | {"work": sum(c.work for c in all_choirs)}
    return Prediction(
        **first,
        level=level_name(rig, level),
        warnings=(),
        time=time,
        rise=rise,
        deflection=rig.key.laser_arm * angle.position,
        finger_force=finger_force(rig, angle, forces),
        choirs=all_choirs,
    )


def expected_of(rig: Rig) -> tuple[Expectation | None, list[str], tuple[str, ...]]:
    """Return the string's force that the model expects in a press, or why there is none, and the
    model's warnings."""
    try:
        found = predict(rig)
    except ModelError as error:
        why = f"planned without the string's force, because the model failed: {error}"
        return None, [why], ()
    return expectation(found), [], found.warnings


def _rises(rig: Rig, held: PlacedPluck) -> Floats:
    """Return the first jack's rises [m] at the points of a choir's pluck."""
    rise = held.choir.jack.string_clearance + held.pluck.height
    lever = key_of(rig, held.choir)
    if lever is not rig.key:
        rise = rise_of_angle(rig.key, angle_of_rise(lever, rise))
    rise[[0, -1]] = held.contact, held.release
    return rise


def string_force_of(rig: Rig, held: PlacedPluck, rise: Floats, angle: Floats) -> Floats:
    """Return the force [N] of a choir's string on its jack over the first jack's rise."""
    holding = (rise > held.contact) & (rise <= held.release)
    lever = key_of(rig, held.choir)
    own = rise[holding] if lever is rig.key else rise_of_angle(lever, angle[holding])
    height = np.clip(own - held.choir.jack.string_clearance, 0, held.pluck.release_height)
    force = np.zeros_like(rise)
    force[holding] = held.pluck.force_on_jack(height)
    return force
