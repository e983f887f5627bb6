"""Parameter arrays of the reduced engine's presses, from a rig and varied values."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.sim_backend.physics.reduced import state as ix
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.motion import Floats


class Numbers:
    """Values of a rig and of a scene's push by dotted key, SI; some may vary between presses.

    Args:
        rig: The true bench.
        scene: With its push, if it has one.
        given: Values that replace the rig's, each a number or of shape (presses,).
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
        """Return whether any of the values is replaced."""
        return any(name in self.given for name in names)


def choir_prefixes(rig: Rig) -> list[str]:
    """Return the prefix of each choir's dotted keys."""
    return ["", *(f"more_choirs.{k}." for k in range(len(rig.more_choirs)))]


def bending_stiffness(numbers: Numbers, prefix: str) -> Floats:
    """Return E W h^3 / 12 [N m^2] of a choir's plectrum, or its replacement."""
    name = f"{prefix}plectrum."
    if f"{name}bending_stiffness" in numbers.given:
        return numbers.given[f"{name}bending_stiffness"]
    return (
        numbers(f"{name}youngs_modulus")
        * numbers(f"{name}width")
        * numbers(f"{name}thickness") ** 3
        / 12
    )


def static_stiffness(numbers: Numbers, prefix: str) -> Floats:
    """Return T / (L b (1 - b)) [N/m] of a choir's string, or its replacement."""
    name = f"{prefix}string."
    if f"{name}static_stiffness" in numbers.given:
        return numbers.given[f"{name}static_stiffness"]
    length = numbers(f"{name}length")
    b = numbers(f"{name}plucking_point") / length
    return numbers(f"{name}tension") / (length * b * (1 - b))


def benches(numbers: Numbers, places: Floats) -> Floats:
    """Return the parameters of presses, shape (presses, 1 + choirs, NUMBERS).

    Args:
        numbers: Values of the keys.
        places: Of the strings' force laws; shape (presses, choirs, 9).
    """
    found = np.zeros((len(places), 1 + places.shape[1], ix.NUMBERS))
    found[:, 1:, ix.STRETCHES :] = places
    _set_key(numbers, found[:, 0])
    for k, at in enumerate(choir_prefixes(numbers.rig)):
        _set_jack(numbers, at, found[:, 1 + k])
    return found


def _set_key(numbers: Numbers, found: Floats) -> None:
    scene, arm = numbers.scene, numbers("key.press_arm")
    found[:, ix.INERTIA] = numbers("key.inertia")
    found[:, ix.GRAVITY_MOMENT] = numbers("key.gravity_moment")
    if scene.friction:
        found[:, ix.VISCOUS] = numbers("key.pivot_viscous_friction")
        found[:, ix.DRY] = numbers("key.pivot_coulomb_friction")
    found[:, ix.DIP] = numbers("key.dip") / arm if scene.felt else np.inf
    found[:, ix.FELT_STIFFNESS] = numbers("key.felt_stiffness") * arm**2
    found[:, ix.FELT_DAMPING] = numbers("key.felt_damping") * arm**2
    found[:, ix.HEIGHT] = numbers("key.jack_surface_height")
    if scene.push:
        found[:, ix.PUSHES] = numbers("push.force") * arm
        found[:, ix.PUSH_END] = numbers("push.duration")


def _set_jack(numbers: Numbers, at: str, jack: Floats) -> None:
    scene = numbers.scene
    jack[:, ix.MASS] = numbers(f"{at}jack.mass")
    jack[:, ix.ARM] = numbers(f"{at or 'key.'}jack_arm")
    jack[:, ix.CLEARANCE] = (
        np.inf if scene.plectrum == "none" else numbers(f"{at}jack.string_clearance")
    )
    if scene.friction:
        jack[:, ix.FRICTION] = numbers(f"{at}jack.register_friction")
    if scene.tongue:
        overlap = numbers(f"{at}plectrum.overlap")
        lever = numbers(f"{at}plectrum.length") - overlap
        jack[:, ix.TONGUE_FORCE] = numbers(f"{at}jack.tongue.bristle_moment") / lever
        jack[:, ix.TONGUE_STIFFNESS] = numbers(f"{at}jack.tongue.bristle_stiffness") / lever**2
        jack[:, ix.TRAVEL] = lever * overlap / numbers(f"{at}jack.tongue.pivot")
    jack[:, ix.LIFT] = numbers(f"{at}jack.damper.lift") if scene.damper else -np.inf
    if scene.damper:
        jack[:, ix.DAMPER] = numbers(f"{at}jack.damper.stiffness")


def new_drive_segment(rig: Rig, scene: Scene) -> Floats:
    """Return a drive segment without a path; see `state.PUSH`."""
    arm = rig.arm
    segment = np.zeros(ix.SEGMENT_NUMBERS)
    segment[ix.IDEAL] = scene.finger == "ideal"
    segment[ix.PERIOD] = rig.controller.sample_period
    height = rig.key.surface_height + arm.fingertip_radius
    segment[ix.LINKAGE :] = arm.base_x, arm.base_z, arm.upper_length, arm.lower_length, height
    return segment
