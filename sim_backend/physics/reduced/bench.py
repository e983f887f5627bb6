"""A rig's numbers, and what varies in them, as the reduced engine's presses."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.sim_backend.physics.reduced.state import (
    ARM,
    CLEARANCE,
    DAMPER,
    DIP,
    DRY,
    FELT_DAMPING,
    FELT_STIFFNESS,
    FRICTION,
    HEAVINESS,
    HEIGHT,
    IDEAL,
    INERTIA,
    LEG,
    LIFT,
    LINKAGE,
    MASS,
    NUMBERS,
    PERIOD,
    PUSH_END,
    PUSHES,
    STRETCHES,
    TONGUE_FORCE,
    TONGUE_STIFFNESS,
    TRAVEL,
    VISCOUS,
)
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.motion import Floats


class Numbers:
    """Values of a rig and of a scene's push by dotted key, SI; some vary from press to press.

    Args:
        rig: As it truly is.
        scene: With its push, if it has one.
        given: Values that replace them, each one number or of shape (presses,).
    """

    def __init__(self, rig: Rig, scene: Scene, given: Mapping[str, Floats]):
        self.rig, self.scene, self.given = rig, scene, given

    def __call__(self, name: str) -> Floats:
        """Return the value of a dotted key."""
        if name in self.given:
            return self.given[name]
        node: Any = self.scene if name.startswith("push.") else self.rig
        for part in name.split("."):
            node = node[int(part)] if part.isdecimal() else getattr(node, part)
        return np.asarray(node, float)

    def varies(self, names: Sequence[str]) -> bool:
        """Return whether one of the values is given."""
        return any(name in self.given for name in names)


def choir_prefixes(rig: Rig) -> list[str]:
    """Return what stands before "jack" in the keys of each choir."""
    return ["", *(f"more_choirs.{k}." for k in range(len(rig.more_choirs)))]


def bending_stiffness(of: Numbers, prefix: str) -> Floats:
    """Return E W h^3 / 12 [N m^2] of a choir's plectrum, or what is given in its place."""
    name = f"{prefix}plectrum."
    if f"{name}bending_stiffness" in of.given:
        return of.given[f"{name}bending_stiffness"]
    return of(f"{name}youngs_modulus") * of(f"{name}width") * of(f"{name}thickness") ** 3 / 12


def static_stiffness(of: Numbers, prefix: str) -> Floats:
    """Return T / (L b (1 - b)) [N/m] of a choir's string, or what is given in its place."""
    name = f"{prefix}string."
    if f"{name}static_stiffness" in of.given:
        return of.given[f"{name}static_stiffness"]
    length = of(f"{name}length")
    b = of(f"{name}plucking_point") / length
    return of(f"{name}tension") / (length * b * (1 - b))


def benches(of: Numbers, places: Floats) -> Floats:
    """Return presses in numbers, shape (presses, 1 + choirs, NUMBERS).

    Args:
        of: Values of the keys.
        places: Of the strings' laws; shape (presses, choirs, 9).
    """
    found = np.zeros((len(places), 1 + places.shape[1], NUMBERS))
    found[:, 1:, STRETCHES:] = places
    _set_key(of, found[:, 0])
    for k, at in enumerate(choir_prefixes(of.rig)):
        _set_jack(of, at, found[:, 1 + k])
    return found


def _set_key(of: Numbers, found: Floats) -> None:
    scene, arm = of.scene, of("key.press_arm")
    found[:, INERTIA] = of("key.inertia")
    found[:, HEAVINESS] = of("key.gravity_moment")
    if scene.friction:
        found[:, VISCOUS] = of("key.pivot_viscous_friction")
        found[:, DRY] = of("key.pivot_coulomb_friction")
    found[:, DIP] = of("key.dip") / arm if scene.felt else np.inf
    found[:, FELT_STIFFNESS] = of("key.felt_stiffness") * arm**2
    found[:, FELT_DAMPING] = of("key.felt_damping") * arm**2
    found[:, HEIGHT] = of("key.jack_surface_height")
    if scene.push:
        found[:, PUSHES] = of("push.force") * arm
        found[:, PUSH_END] = of("push.duration")


def _set_jack(of: Numbers, at: str, jack: Floats) -> None:
    scene = of.scene
    jack[:, MASS] = of(f"{at}jack.mass")
    jack[:, ARM] = of(f"{at or 'key.'}jack_arm")
    jack[:, CLEARANCE] = np.inf if scene.plectrum == "none" else of(f"{at}jack.string_clearance")
    if scene.friction:
        jack[:, FRICTION] = of(f"{at}jack.register_friction")
    if scene.tongue:
        overlap = of(f"{at}plectrum.overlap")
        lever = of(f"{at}plectrum.length") - overlap
        jack[:, TONGUE_FORCE] = of(f"{at}jack.tongue.bristle_moment") / lever
        jack[:, TONGUE_STIFFNESS] = of(f"{at}jack.tongue.bristle_stiffness") / lever**2
        jack[:, TRAVEL] = lever * overlap / of(f"{at}jack.tongue.pivot")
    jack[:, LIFT] = of(f"{at}jack.damper.lift") if scene.damper else -np.inf
    if scene.damper:
        jack[:, DAMPER] = of(f"{at}jack.damper.stiffness")


def new_leg(rig: Rig, scene: Scene) -> Floats:
    """Return what the finger does, without its path; see `reduced_state.PUSH`."""
    arm = rig.arm
    leg = np.zeros(LEG)
    leg[IDEAL] = scene.finger == "ideal"
    leg[PERIOD] = rig.controller.sample_period
    height = rig.key.surface_height + arm.fingertip_radius
    leg[LINKAGE:] = arm.base_x, arm.base_z, arm.upper_length, arm.lower_length, height
    return leg
