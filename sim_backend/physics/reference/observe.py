"""The reference solution of a scene's drive."""

import math

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.drive import Drive, drive_of
from sautereau.sim_backend.physics.events import Motions
from sautereau.sim_backend.physics.observation import Observation
from sautereau.sim_backend.physics.reference.drive_segments import (
    IdealFingerSegments,
    PushSegments,
    SegmentSource,
    ServoSegments,
)
from sautereau.sim_backend.physics.reference.integrate import Integrator, Solution
from sautereau.sim_backend.physics.reference.jack import jack_laws
from sautereau.sim_backend.physics.reference.linkage import Linkage
from sautereau.sim_backend.physics.reference.system import State, System
from sautereau.sim_backend.scene import Scene

GRID = 50e-6
"""s, longest time between output points."""
TOLERANCE = 1e-10
"""Dimensionless, relative tolerance of the integrator."""


def reference(
    rig: Rig, scene: Scene, drive: Drive | None = None, *, tolerance: float = TOLERANCE
) -> Observation:
    """Solve a scene's equations in minimal coordinates and return the observation.

    Args:
        rig: The nominal bench.
        scene: Its engine, step and accuracy are ignored.
        drive: Reference to follow; None for `drive_of` the scene.
        tolerance: Dimensionless, relative tolerance of the integrator.

    Raises:
        SceneError: The scene has a modal string or no chosen level, or its motion diverges.
    """
    solution = solve(rig, scene, drive, tolerance=tolerance)
    return observed(solution, scene.true_rig(rig).key.press_arm)


def observed(solution: Solution, press_arm: float) -> Observation:
    """Return the observation of a solution.

    Args:
        solution: As `solve` returns it.
        press_arm: m, of the key.
    """
    rows = zip(solution.times, solution.instants, solution.segments, strict=True)
    table = [
        (
            time,
            now.angle,
            now.angular_velocity,
            now.jacks[0].rise,
            now.finger / now.contact.lever if now.contact else segment.moment / press_arm,
            sum(jack.string for jack in now.jacks),
        )
        for time, now, segment in rows
    ]
    return Observation(Motions(*np.array(table).T), solution.events)


def solve(
    rig: Rig, scene: Scene, drive: Drive | None = None, *, tolerance: float = TOLERANCE
) -> Solution:
    """Solve a scene's equations and return every state and force; see `reference`."""
    _check(scene)
    drive = drive or drive_of(rig, scene)
    true = scene.true_rig(rig)
    period = true.controller.sample_period
    source = _segment_source(true, scene, drive)
    system = System.of(true, scene, jack_laws(true, scene), source.linkage)
    parts = math.ceil(period / GRID)
    starts = np.arange(drive.samples)[:, None] * period
    grid = starts + np.arange(1, parts + 1) * (period / parts)
    grid[:, -1] = np.arange(1, drive.samples + 1) * period
    integrator = Integrator(system, source, grid.ravel().tolist(), tolerance)
    return integrator.run(_at_rest(system, true, drive, scene))


def _segment_source(rig: Rig, scene: Scene, drive: Drive) -> SegmentSource:
    if scene.push:
        return PushSegments(rig, scene.push, drive.samples * rig.controller.sample_period)
    if scene.servo:
        return ServoSegments(rig, scene.servo, drive)
    return IdealFingerSegments(rig, drive)


def _at_rest(system: System, rig: Rig, drive: Drive, scene: Scene) -> State:
    """Return the state at rest: the key on its rail, or on a fingertip above that."""
    angle = 0.0
    joints = list(drive.start)
    if not scene.push:
        linkage = system.arm or Linkage(rig)
        angle = max(0.0, linkage.key_under_fingertip(joints[0], joints[1], 0.0, 0.0).angle)
    state = [angle, 0.0]
    for jack in system.jacks:
        state += [jack.kinematics(angle)[0], 0.0]
    return state + ([*joints, 0.0, 0.0] if system.arm else [])


def _check(scene: Scene) -> None:
    if scene.string in ("modal", "auto") or scene.plectrum == "auto":
        raise SceneError(
            f'string = "{scene.string}", plectrum = "{scene.plectrum}": the reference needs a'
            ' spring string and a chosen level; set string = "spring" and a level, or both'
            ' "none"'
        )
