"""Parameters of presses, from a rig and values that vary between them."""

import math
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.rig.schema import Rig
from sautereau.rig.section import GRAVITY
from sautereau.sim_backend.physics.base import steps_in_sample
from sautereau.sim_backend.physics.exact.compile import records
from sautereau.sim_backend.physics.exact.structures import (
    ABOVE,
    BELOW,
    EVENTS,
    FINGER,
    JACK,
    KEY,
    PASSING,
    RUN,
    Press,
)
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.dynamics import armature
from sautereau.trajectory.motion import Floats

FINGERS = ("push", "ideal", "servo")
"""Kinds of finger, as the structures number them."""
ORDER = 4
"""Order of the steps with which a scene is simulated."""
RATED, RATED_STEP, LEAST = 1e-9, 1e-3, 1e-16
"""A step of length `RATED_STEP` [s] may have the relative error `RATED`; the limit scales with the
order's power of the step, and is at least `LEAST`. A step with a larger error is divided."""

_LIMITS = {"gt": np.greater, "ge": np.greater_equal, "lt": np.less, "le": np.less_equal}


class Numbers:
    """Values of a rig and of a scene's push by dotted key, SI; some may vary between presses.

    Args:
        rig: The true bench.
        scene: With its push, if it has one.
        given: Values that replace the rig's, each a number or of shape (presses,).
    """

    def __init__(self, rig: Rig, scene: Scene, given: Mapping[str, Floats]):
        self.rig, self.scene, self.given = rig, scene, given
        self.prefixes = ["", *(f"more_choirs.{k}." for k in range(len(rig.more_choirs)))]
        """The first parts of the dotted keys of each choir."""
        self.used: dict[str, tuple[Any, str]] = {}
        """Model and name of every value asked for so far."""

    def __call__(self, key: str) -> Any:
        """Return the value of a dotted key, a number or of shape (presses,)."""
        *path, name = _parts(key)
        node: Any = self.scene if path[0] == "push" else self.rig
        for part in path:
            node = node[part] if isinstance(part, int) else getattr(node, part)
        self.used[key] = type(node), name
        return self.given[key] if key in self.given else getattr(node, name)

    def within_limits(self, presses: int) -> NDArray[np.bool_]:
        """Return the presses with all given values within their limits; shape (presses,)."""
        good = np.ones(presses, bool)
        for key, value in self.given.items():
            model, name = self.used[key]
            field = model.model_fields.get(name)
            good &= np.isfinite(value) & (field is not None or value > 0)  # or a derived quantity
            for limit in field.metadata if field else ():
                for bound, holds in _LIMITS.items():
                    if hasattr(limit, bound):
                        good &= holds(value, getattr(limit, bound))
        for at in self.prefixes:
            good &= self(f"{at}string.plucking_point") < self(f"{at}string.length")
            good &= self(f"{at}plectrum.overlap") < self(f"{at}plectrum.length")
        back = self("jack.mass") * GRAVITY * self("key.jack_arm")
        return good & (self("key.gravity_moment") < back)


@cache
def _parts(key: str) -> tuple[Any, ...]:
    """Return the parts of a dotted key, and numbers of choirs as numbers."""
    return tuple(int(part) if part.isdecimal() else part for part in key.split("."))


def benches(numbers: Numbers, presses: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the parameters of presses without their force laws.

    Returns:
        `KEY`s, shape (presses,), and `JACK`s, shape (presses, choirs).
    """
    scene, arm = numbers.scene, numbers("key.press_arm")
    keys, jacks = np.zeros(presses, KEY), np.zeros((presses, len(numbers.prefixes)), JACK)
    keys["inertia"], keys["gravity"] = numbers("key.inertia"), scene.gravity
    keys["gravity_moment"] = numbers("key.gravity_moment") * (scene.gravity / GRAVITY)
    keys["height"], keys["press_arm"] = numbers("key.jack_surface_height"), arm
    if scene.friction:
        keys["viscous"] = numbers("key.pivot_viscous_friction")
        keys["dry"] = numbers("key.pivot_coulomb_friction")
    keys["dip"] = numbers("key.dip") / arm if scene.felt else math.inf
    if scene.felt:
        keys["felt_stiffness"] = numbers("key.felt_stiffness") * arm * arm
        keys["felt_damping"] = numbers("key.felt_damping") * arm * arm
    keys["push_end"] = math.inf
    if scene.push:
        keys["force"], keys["push_end"] = numbers("push.force"), numbers("push.duration")
    for k, at in enumerate(numbers.prefixes):
        _set_jack(numbers, at, jacks[:, k])
    return keys, jacks


def _set_jack(numbers: Numbers, at: str, jack: NDArray[Any]) -> None:
    scene = numbers.scene
    jack["mass"] = numbers(f"{at}jack.mass")
    jack["arm"] = numbers(f"{at or 'key.'}jack_arm")
    mute = scene.plectrum == "none"
    jack["clearance"] = math.inf if mute else numbers(f"{at}jack.string_clearance")
    jack["range"] = jack["clearance"][:, None, None]
    jack["range"][:, BELOW, 0] = -math.inf
    jack["range"][:, ABOVE, 1] = math.inf
    if scene.friction:
        jack["friction"] = numbers(f"{at}jack.register_friction")
    if scene.tongue:
        overlap = numbers(f"{at}plectrum.overlap")
        lever = numbers(f"{at}plectrum.length") - overlap
        jack["tongue_force"] = numbers(f"{at}jack.tongue.bristle_moment") / lever
        jack["tongue_stiffness"] = numbers(f"{at}jack.tongue.bristle_stiffness") / lever**2
        jack["range"][:, PASSING, 0] -= lever * overlap / numbers(f"{at}jack.tongue.pivot")
    jack["lift"] = numbers(f"{at}jack.damper.lift") if scene.damper else -math.inf
    if scene.damper:
        jack["damper"] = numbers(f"{at}jack.damper.stiffness")


def finger_of(rig: Rig, scene: Scene, start: tuple[float, float]) -> NDArray[Any]:
    """Return one `FINGER` with its brakes on, all zero for a push.

    The equations are those of `sautereau.trajectory.dynamics`.
    """
    arm, found = rig.arm, np.zeros(1, FINGER)
    found["kind"] = FINGERS.index(scene.finger)
    if scene.push:
        return found
    first, second = armature(arm)
    l1, l2, mass1, mass2 = arm.upper_length, arm.lower_length, arm.upper_mass, arm.lower_mass
    values: dict[str, Any] = {
        "base_x": arm.base_x, "base_z": arm.base_z, "upper": l1, "lower": l2,
        "height": rig.key.surface_height + arm.fingertip_radius,
        "inertia1": (mass1 / 3 + mass2) * l1**2 + first, "inertia2": mass2 * l2**2 / 3,
        "rotor2": second, "coupling": mass2 * l1 * l2 / 2,
        "weight1": scene.gravity * (mass1 / 2 + mass2) * l1,
        "weight2": scene.gravity * mass2 * l2 / 2,
        "radians": arm.radians_per_count, "start": start, "limit": arm.torque_limit, "locked": 1,
    }  # fmt: skip
    if scene.servo:
        values |= dict(scene.servo)
    if scene.fingertip:
        values |= {f"pad_{name}": value for name, value in scene.fingertip}
    for name, value in values.items():
        found[name] = value
    return found


def new_presses(
    numbers: Numbers,
    start: tuple[float, float],
    keys: NDArray,
    jacks: NDArray,
    cells: Floats,
    order: int = ORDER,
    tolerance: float | None = None,
) -> Press:
    """Return presses at time 0 before their first sample, of which one at a time is played.

    Args:
        numbers: Of a scene with its step.
        start: rad, joints when power comes on.
        keys: Of `KEY`; shape (presses,).
        jacks: Of `JACK`; shape (presses, choirs).
        order: Of the steps, even, at most 8.
        tolerance: Dimensionless, relative error of a step; None for one that suits the step.
    """
    rig, scene, run = numbers.rig, numbers.scene, np.zeros(1, RUN)
    period = rig.controller.sample_period
    steps = steps_in_sample(rig, scene.step or period)
    if tolerance is None:
        tolerance = max(RATED * (period / steps / RATED_STEP) ** order, LEAST)
    run["period"], run["step"], run["steps"] = period, period / steps, steps
    run["order"], run["tolerance"] = order, tolerance
    work = np.zeros((16, 1 + jacks.shape[1] + (2 if scene.servo else 0)))
    return Press(
        records(keys), records(jacks), cells, records(finger_of(rig, scene, start)), records(run),
        work[0], work[1], work[2], work, np.zeros((EVENTS, 5)), np.zeros((0, 6)),
    )  # fmt: skip
