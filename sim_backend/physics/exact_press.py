"""Parameters of a press for the exact engine, from a rig and a scene."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.choirs import choirs, pluck_of
from sautereau.rig.instrument import Choir, Plectrum, String
from sautereau.rig.schema import Rig
from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.base import LARGEST_ANGLE, steps_in_sample
from sautereau.sim_backend.physics.exact import structures as ix
from sautereau.sim_backend.physics.exact.compile import records
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.dynamics import armature
from sautereau.trajectory.motion import Floats

FINGERS = ("push", "ideal", "servo")  # Kinds of finger, as the structures number them
ORDER = 4  # Order of the steps with which a scene is simulated
RATED, RATED_STEP, LEAST = 1e-9, 1e-3, 1e-16
"""A step of length `RATED_STEP` [s] may have the relative error `RATED`; the limit scales with the
order's power of the step, and is at least `LEAST`. A step with a larger error is divided."""


@dataclass(frozen=True)
class Law:
    """Force law of a string."""

    cells: Floats
    """Start of each cell [m], and the cubic of the force [N] from there; shape (cells, 5)."""
    first: NDArray[np.int64]
    """First cells where the string sticks and where it slides, and the end of the last; (3,)."""
    border: Floats
    """Heights there [m], equal where the string never sticks or never slides; shape (3,)."""


@lru_cache(maxsize=256)
def law_of(plectrum: Plectrum, string: String, level: str) -> Law:
    """Return the law of one pluck, with the same cubics as its `force_on_jack`.

    Raises:
        ModelError: The plectrum and string have no pluck.
    """
    pluck = pluck_of(plectrum, string, level)  # pyright: ignore[reportArgumentType]
    knots = pluck.height
    places = np.array([1, 3, 5, 7]) / 8
    steps = np.diff(knots)[:, None]
    values = pluck.force_on_jack(knots[:-1, None] + steps * places)
    cubics = np.linalg.solve(np.vander(places, 4, increasing=True), values.T).T
    cells = np.column_stack([knots[:-1], cubics / steps ** np.arange(4)])
    first = np.array([0, pluck.stretches[-1], len(cells)])
    return Law(cells, first, knots[first])


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
    keys["dip"] = key.dip / arm if scene.felt else LARGEST_ANGLE
    if scene.felt:
        keys["felt_stiffness"] = key.felt_stiffness * arm * arm
        keys["felt_damping"] = key.felt_damping * arm * arm
    keys["push_end"] = math.inf
    if scene.push:
        keys["force"], keys["push_end"] = scene.push.force, scene.push.duration
    cells, found = 0, [np.zeros((0, 5))]
    for k, choir in enumerate(strings):
        _set_jack(scene, choir, jacks[k])
        if scene.plectrum == "none":
            continue
        try:
            plectrum, string = choir.plectrum, choir.string
            law = law_of(plectrum, string, scene.plectrum)  # pyright: ignore[reportArgumentType]
        except ModelError as error:
            at = f"more_choirs.{k - 1}." if k else ""
            raise SceneError(f"rig {rig.name}: {at}{error}") from error
        jack = jacks[k]
        jack["first"] = law.first + cells
        jack["range"][ix.STUCK] += law.border[:2]
        jack["range"][ix.SLIDING] += law.border[1:]
        cells += len(law.cells)
        found.append(law.cells)
    return keys, jacks, np.concatenate(found)


def _set_jack(scene: Scene, choir: Choir, found: Any) -> None:
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


def new_press(
    rig: Rig,
    scene: Scene,
    start: tuple[float, float],
    keys: NDArray,
    jacks: NDArray,
    cells: Floats,
    order: int = ORDER,
    tolerance: float | None = None,
) -> ix.Press:
    """Return a press at time 0 before its first sample, as `play` takes it.

    Args:
        rig: The true bench.
        scene: With its step.
        start: rad, joints when power comes on.
        keys: Of `KEY`; shape (1,).
        jacks: Of `JACK`; shape (choirs,).
        order: Of the steps, even, at most 8.
        tolerance: Dimensionless, relative error of a step; None for one that suits the step.
    """
    run = np.zeros(1, ix.RUN)
    period = rig.controller.sample_period
    steps = steps_in_sample(rig, scene.step or period)
    if tolerance is None:
        tolerance = max(RATED * (period / steps / RATED_STEP) ** order, LEAST)
    run["period"], run["step"], run["steps"] = period, period / steps, steps
    run["order"], run["tolerance"] = order, tolerance
    work = np.zeros((16, 1 + len(jacks) + (2 if scene.servo else 0)))
    return ix.Press(
        records(keys), records(jacks), cells, records(finger_of(rig, scene, start)), records(run),
        work[0], work[1], work[2], work, np.zeros((ix.EVENTS, 4)), np.zeros((0, 7)),
    )  # fmt: skip
