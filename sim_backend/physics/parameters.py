"""Parameters of a press for both engines, from a rig and a scene."""

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.choirs import choirs, level_of, pluck_of
from sautereau.rig.instrument import Choir, Plectrum, String
from sautereau.rig.schema import Rig
from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics import structures as ix
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.dynamics import armature
from sautereau.trajectory.motion import Floats

FINGERS = ("push", "ideal", "servo")  # Kinds of finger, as the structures number them


@lru_cache(maxsize=256)
def law_of(
    plectrum: Plectrum, string: String, level: str
) -> tuple[Floats, NDArray[np.int64], Floats]:
    """Return the force law of one pluck, with the same cubics as its `force_on_jack`.

    Returns:
        Start of each cell [m], and the cubic of the force [N] from there, shape (cells, 5); the
        first cells where the string sticks and where it slides, and the end of the last, (3,); and
        the heights there [m], equal where the string never sticks or never slides, (3,).

    Raises:
        ModelError: The plectrum and string have no pluck.
    """
    pluck = pluck_of(plectrum, string, level)  # pyright: ignore[reportArgumentType]
    knots = pluck.height
    places = np.array([1, 3, 5, 7]) / 8
    steps = np.diff(knots)[:, None]
    values = pluck.force_on_jack(knots[:-1, None] + steps * places)
    cubics = np.linalg.solve(np.vander(places, 4, increasing=True), values.T).T
    cubics[:, 0] = pluck.force_on_jack(knots[:-1])  # exact: at the contact it is 0
    cells = np.column_stack([knots[:-1], cubics / steps ** np.arange(4)])
    first = np.array([0, pluck.stretches[-1], len(cells)])
    return cells, first, knots[first]


def bench_of(rig: Rig, scene: Scene) -> tuple[NDArray[Any], NDArray[Any], Floats]:
    """Return the parameters of a press.

    Returns:
        One `KEY`, shape (1,); its `JACK`s, shape (choirs,); and the cells of their force laws.

    Raises:
        SceneError: A plectrum and string have no pluck.
    """
    key, arm, strings = rig.key, rig.key.press_arm, choirs(rig)
    keys, jacks = np.zeros(1, ix.KEY), np.zeros(len(strings), ix.JACK)
    keys["inertia"], keys["gravity"] = key.inertia, scene.gravity
    keys["gravity_moment"] = key.gravity_moment * (scene.gravity / GRAVITY)
    keys["height"], keys["press_arm"] = key.jack_surface_height, arm
    if scene.friction:
        keys["viscous"] = key.pivot_viscous_friction
        keys["dry"] = key.pivot_coulomb_friction
    keys["dip"] = key.dip / arm if scene.felt else ix.LARGEST_ANGLE
    if scene.felt:
        keys["felt_stiffness"] = key.felt_stiffness * arm * arm
        keys["felt_damping"] = key.felt_damping * arm * arm
    keys["push_end"] = math.inf
    if scene.push:
        keys["force"], keys["push_end"] = scene.push.force, scene.push.duration
    cells, found = 0, [np.zeros((0, 5))]
    for k, choir in enumerate(strings):
        jacks[k], own = jack_of(scene, choir, k)
        jacks[k]["first"] += cells
        cells += len(own)
        found.append(own)
    return keys, jacks, np.concatenate(found)


def jack_of(scene: Scene, choir: Choir, number: int) -> tuple[Any, Floats]:
    """Return one jack as a record of `JACK`, and the cells of its force law.

    Args:
        number: Of the choir, 0 for the first.

    Raises:
        SceneError: Its plectrum and string have no pluck.
    """
    found = np.zeros(1, ix.JACK)[0]
    jack, plectrum = choir.jack, choir.plectrum
    found["mass"], found["arm"] = jack.mass, choir.jack_arm
    found["clearance"] = math.inf if scene.plectrum == "none" else jack.string_clearance
    found["range"] = found["clearance"]
    found["range"][ix.BELOW, 0] = -math.inf
    found["range"][ix.ABOVE, 1] = math.inf
    if scene.friction:
        found["friction"] = jack.register_friction
    tongue = jack.tongue if scene.tongue else None
    if tongue is not None:
        lever = plectrum.length - plectrum.overlap
        found["tongue_force"] = tongue.bristle_moment / lever
        found["tongue_stiffness"] = tongue.bristle_stiffness / lever**2
        found["range"][ix.PASSING, 0] -= lever * plectrum.overlap / tongue.pivot
    damper = jack.damper if scene.damper else None
    found["lift"] = damper.lift if damper is not None else -math.inf
    if damper is not None:
        found["damper"] = damper.stiffness
    if scene.plectrum == "none":
        return found, np.zeros((0, 5))
    try:
        level = level_of(plectrum, scene.plectrum)
        law = law_of(plectrum, choir.string, level)  # pyright: ignore[reportArgumentType]
        cells, found["first"], border = law
    except ModelError as error:
        raise SceneError(f"more_choirs[{number - 1}]." * (number > 0) + str(error)) from error
    found["range"][ix.STUCK] += border[:2]
    found["range"][ix.SLIDING] += border[1:]
    return found, cells


def finger_of(rig: Rig, scene: Scene, start: tuple[float, float]) -> NDArray[Any]:
    """Return one `FINGER` with its brakes on, or a push.

    The equations are those of `sautereau.trajectory.dynamics`.
    """
    arm, found = rig.arm, np.zeros(1, ix.FINGER)
    found["kind"], found["reach"] = FINGERS.index(scene.finger), rig.key.press_arm
    found["surface"] = rig.key.surface_height
    if scene.friction:
        found["friction"] = arm.fingertip_friction
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
