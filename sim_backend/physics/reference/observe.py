"""A scene's drive as it truly is: the reference to which the engines are held."""

import math

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.drive import Drive, drive_of
from sautereau.sim_backend.physics.events import Motions
from sautereau.sim_backend.physics.observation import Observation
from sautereau.sim_backend.physics.reference.drive_segments import (
    Hand,
    IdealHand,
    PushHand,
    ServoHand,
)
from sautereau.sim_backend.physics.reference.integrate import Integrator, Solution
from sautereau.sim_backend.physics.reference.jack import jack_laws
from sautereau.sim_backend.physics.reference.linkage import Linkage
from sautereau.sim_backend.physics.reference.system import State, System
from sautereau.sim_backend.scene import Scene

GRID = 50e-6
"""s, longest time between the points of the motion."""
TOLERANCE = 1e-10
"""1, of each step of the integrator, against a small motion of the bench."""


def reference(
    rig: Rig, scene: Scene, drive: Drive | None = None, *, tolerance: float = TOLERANCE
) -> Observation:
    """Solve a scene's equations in minimal coordinates and return all that happened.

    Args:
        rig: The nominal bench.
        scene: Its engine, step and accuracy do not matter.
        drive: What is played; None for `drive_of` the scene.
        tolerance: 1, of each step of the integrator.

    Raises:
        SceneError: The scene has a modal string or no chosen level, or its motion cannot be
            followed.
    """
    solution = solve(rig, scene, drive, tolerance=tolerance)
    rows = zip(solution.times, solution.instants, solution.legs, strict=True)
    press_arm = scene.true_rig(rig).key.press_arm
    table = [
        (
            time,
            now.angle,
            now.spin,
            now.jacks[0].rise,
            now.finger / now.touch.lever if now.touch else leg.moment / press_arm,
            sum(jack.string for jack in now.jacks),
        )
        for time, now, leg in rows
    ]
    return Observation(Motions(*np.array(table).T), solution.events)


def solve(
    rig: Rig, scene: Scene, drive: Drive | None = None, *, tolerance: float = TOLERANCE
) -> Solution:
    """Solve a scene's equations and return them with every state and force; see `reference`."""
    _check(scene)
    drive = drive or drive_of(rig, scene)
    true = scene.true_rig(rig)
    period = true.controller.sample_period
    hand = _hand(true, scene, drive)
    system = System.of(true, scene, jack_laws(true, scene), hand.linkage)
    parts = math.ceil(period / GRID)
    starts = np.arange(drive.samples)[:, None] * period
    grid = starts + np.arange(1, parts + 1) * (period / parts)
    grid[:, -1] = np.arange(1, drive.samples + 1) * period
    integrator = Integrator(system, hand, grid.ravel().tolist(), tolerance)
    return integrator.run(_at_rest(system, true, drive, scene))


def _hand(rig: Rig, scene: Scene, drive: Drive) -> Hand:
    if scene.push:
        return PushHand(rig, scene.push, drive.samples * rig.controller.sample_period)
    return ServoHand(rig, scene.servo, drive) if scene.servo else IdealHand(rig, drive)


def _at_rest(system: System, rig: Rig, drive: Drive, scene: Scene) -> State:
    """Return the bench before anything moves: the key on its rail, or on a fingertip above it."""
    angle = 0.0
    joints = list(drive.start)
    if not scene.push:
        linkage = system.arm or Linkage(rig)
        angle = max(0.0, linkage.touch(joints[0], joints[1], 0.0, 0.0).angle)
    state = [angle, 0.0]
    for jack in system.jacks:
        state += [jack.foot(angle)[0], 0.0]
    return state + ([*joints, 0.0, 0.0] if system.arm else [])


def _check(scene: Scene) -> None:
    if scene.string in ("modal", "auto") or scene.plectrum == "auto":
        raise SceneError(
            f'string = "{scene.string}", plectrum = "{scene.plectrum}": the reference has spring'
            ' strings and a chosen level alone; take string = "spring" and a level, or leave both'
            " out"
        )
