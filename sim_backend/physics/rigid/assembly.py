"""The bodies of a scene, assembled; disabled parts have none."""

import math
from dataclasses import dataclass

import numpy as np
import pymunk
from pymunk.constraints import Constraint

from sautereau.analysis.model.choirs import choirs
from sautereau.rig.instrument import Choir
from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.events import PluckEvents
from sautereau.sim_backend.physics.finger import PushFinger, SteppedFinger
from sautereau.sim_backend.physics.rigid.arm import ServoFinger
from sautereau.sim_backend.physics.rigid.bodies import (
    MM,
    WEIGHT,
    add_key,
    add_pivot_friction,
    new_space,
)
from sautereau.sim_backend.physics.rigid.division import Division
from sautereau.sim_backend.physics.rigid.ideal import IdealFinger, touching_angle
from sautereau.sim_backend.physics.rigid.jacks import CarriedJack
from sautereau.sim_backend.physics.rigid.key_loads import KeyLoads
from sautereau.sim_backend.physics.rigid.pluck import Plucking, StringForce
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.arm import fingertip_place


@dataclass(frozen=True)
class Assembly:
    """The parts of a scene and the joints between them."""

    space: pymunk.Space
    key: pymunk.Body
    loads: KeyLoads
    jacks: list[CarriedJack]
    finger: SteppedFinger
    division: Division
    dry: list[tuple[Constraint, float]]
    """Joints with dry friction, each with its limit [N mm or N]."""

    def kick(self, step: float, fraction: float, iterations: int) -> None:
        """Step the engine with a fraction of its own weight and friction.

        Args:
            step: ms, always the present step of the engine.
            fraction: Dimensionless, of weight and dry friction.
            iterations: Of its solver.
        """
        across, down = WEIGHT
        self.space.gravity = across, down * fraction
        self.space.iterations = iterations
        for joint, force in self.dry:
            joint.max_force = force * fraction
        self.space.step(step)
        for joint, force in self.dry:
            joint.max_force = force
        self.space.gravity = WEIGHT


def assemble(rig: Rig, scene: Scene, start: tuple[float, float], events: PluckEvents) -> Assembly:
    """Assemble the bodies of a scene, at rest.

    Args:
        rig: The true bench.
        scene: With a chosen step.
        start: rad, of the arm's joints.
        events: List to which the strings append their events.

    Raises:
        SceneError: A part is too stiff, a choir has no pluck, or the finger starts inside the key.
    """
    space, steps = new_space(scene.iterations), _steps(rig, scene)
    angle = 0.0
    if scene.finger != "push":
        x, z = fingertip_place(rig.arm, np.array(start)).tolist()
        angle = max(0.0, touching_angle(rig, x, z))
    key, loads = add_key(space, rig.key, angle), KeyLoads(rig.key, scene)
    if not angle < loads.bottom:
        raise SceneError(
            f"start: the fingertip is in the key: contact needs a key angle of {angle:.4g} rad, and"
            f" the key turns by {loads.bottom:.4g} rad at most; start above the key"
        )
    dry: list[tuple[Constraint, float]] = []
    if loads.friction:
        dry.append((add_pivot_friction(space, key, loads.friction), loads.friction))
    jacks = [
        CarriedJack(space, key, rig, choir, scene, _string(scene, choir, number, events))
        for number, choir in enumerate(choirs(rig))
    ]
    dry += [(jack.dry, jack.dry_force) for jack in jacks if jack.dry]
    division = Division(rig, loads, jacks, rig.controller.sample_period * MM / steps)
    finger = _finger(rig, scene, start, space, key, steps, steps * division.most)
    return Assembly(space, key, loads, jacks, finger, division, dry)


def _steps(rig: Rig, scene: Scene) -> int:
    """Return the number of undivided steps in a controller sample."""
    return math.ceil(rig.controller.sample_period / (scene.step or math.inf) - 1e-9)


def _string(scene: Scene, choir: Choir, number: int, events: PluckEvents) -> StringForce | None:
    if scene.plectrum == "none":
        return None
    if scene.string == "modal":
        from sautereau.sim_backend.physics.rigid.modal import ModalPlucking

        return ModalPlucking(choir, scene, number, events)
    return Plucking(choir, scene, number, events)


def _finger(
    rig: Rig,
    scene: Scene,
    start: tuple[float, float],
    space: pymunk.Space,
    key: pymunk.Body,
    steps: int,
    cells: int,
) -> SteppedFinger:
    if scene.push is not None:
        return PushFinger(scene.push, rig.key.press_arm, start, rig.controller.sample_period)
    if scene.servo is not None:
        return ServoFinger(space, key, rig, start, scene.servo)
    return IdealFinger(space, key, rig, start, steps, cells)
