"""Observation of a complete drive, of the same form for every engine, and its error."""

import math
from dataclasses import dataclass

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.sim_backend.parts import Accuracy
from sautereau.sim_backend.physics.base import World
from sautereau.sim_backend.physics.drive import Drive, drive_of
from sautereau.sim_backend.physics.events import Motions, PluckEvents
from sautereau.sim_backend.physics.world import new_world
from sautereau.sim_backend.scene import Scene

GRID, GRID_ORDER = 50e-6, 6  # s, step of the reference solution, and its order


@dataclass(frozen=True)
class Observation:
    """Motion and events of a drive; times in s from its start."""

    motions: Motions
    events: PluckEvents


@dataclass(frozen=True)
class Errors:
    """Difference of two observations; infinite if their numbers of events differ."""

    time: float
    """s, largest of all contacts, releases and returns, and of the jumps of the finger's force
    while a string is held; where no string is touched, that of the key's angle over its largest
    rate."""
    force: float
    """Dimensionless: error of the strings' forces at release, and of the finger's force while a
    string is held, relative to the largest of each; between a jump and that of the truth none."""

    def over(self, asked: Accuracy) -> float:
        """Return the error over the one asked for, dimensionless."""
        return asked.excess(self.time, self.force)


def observe(rig: Rig, scene: Scene, drive: Drive | None = None) -> Observation:
    """Simulate a drive in a new world and return the observation.

    Args:
        scene: With a chosen step and engine.
        drive: Reference to follow; None for `drive_of` the scene.

    Raises:
        SceneError: The scene cannot be simulated.
    """
    drive = drive or drive_of(rig, scene)
    return play(new_world(rig, scene, start=drive.start), drive)


def reference(
    rig: Rig,
    scene: Scene,
    drive: Drive | None = None,
    *,
    step: float = GRID,
    order: int = GRID_ORDER,
    tolerance: float = 1e-18,
) -> Observation:
    """Solve a scene's equations as finely as rounding lets it, and return the observation.

    Args:
        scene: Its engine, step and accuracy are ignored.
        drive: Reference to follow; None for `drive_of` the scene.
        step: s, longest one.
        tolerance: Dimensionless, relative error of a step where forces are smooth; where cells of
            a force law join, its power 2/3 at order 6.

    Raises:
        SceneError: The scene has a modal string or no chosen level, or its motion diverges.
    """
    from sautereau.sim_backend.physics.exact_world import ExactWorld

    drive = drive or drive_of(rig, scene)
    fine = scene.model_copy(update={"step": step, "accuracy": None})
    return play(ExactWorld(rig, fine, drive.start, order=order, tolerance=tolerance), drive)


def play(world: World, drive: Drive) -> Observation:
    """Simulate a drive in a world at its start, and return the observation."""
    return Observation(world.play(drive), world.events)


def errors(found: Observation, true: Observation) -> Errors:
    """Return the error of an observation."""
    pairs = [
        (getattr(found.events, name), getattr(true.events, name))
        for name in ("contacts", "releases", "returns")
    ]
    if any([e.choir for e in a] != [e.choir for e in b] for a, b in pairs):
        return Errors(math.inf, math.inf)
    apart = (abs(a.time - b.time) for x, y in pairs for a, b in zip(x, y, strict=True))
    off = (abs(a.force - b.force) for a, b in zip(*pairs[1], strict=True))
    largest = max((abs(e.force) for e in true.events.releases), default=0.0) or math.inf
    held = _held_errors(found, true) if pairs[0][1] else _motion_errors(found, true)
    return Errors(max([held.time, *apart]), max(held.force, max(off, default=0.0) / largest))


def _motion_errors(found: Observation, true: Observation) -> Errors:
    """Return the errors of a press without a string: the time by which the key's motion is off."""
    a, b = found.motions, true.motions
    fastest = float(np.abs(b.angular_velocity).max(initial=0.0))
    off = float(np.abs(a.angle - np.interp(a.time, b.time, b.angle)).max(initial=0.0))
    return Errors(off / fastest if fastest else 0.0, 0.0)


def _held_errors(found: Observation, true: Observation) -> Errors:
    """Return the errors of the finger's force while strings are held.

    Of a jump of nearly the same size the time counts, and else the rms error over the largest
    force.
    """
    a, b = found.motions, true.motions
    spans = []
    for contact, release in zip(true.events.contacts, true.events.releases, strict=False):
        # An event at a slightly different time is no error of the force.
        margin = 0.1 * (release.time - contact.time)
        spans.append((contact.time + margin, release.time - margin, margin))
    inside = [(b.time > start) & (b.time < end) for start, end, _ in spans]
    single = np.ones(len(b.time), bool)
    single[:-1] &= np.diff(b.time) > 0  # else the force has two values
    single[1:] &= np.diff(b.time) > 0
    held = np.logical_or.reduce(inside, axis=0, initial=False) & single
    largest = float(np.abs(b.finger_force[held]).max(initial=0.0))
    if largest == 0.0:
        return Errors(0.0, 0.0)
    late, least = 0.0, 1e-3 * largest
    jumps, others = _jumps(b, least), _jumps(a, least / 2)  # which may be half as large
    for (start, end, margin), rows in zip(spans, inside, strict=True):
        for time, size in jumps:
            alike = [(t, own) for t, own in others if abs(own - size) <= abs(size) / 2]
            if not alike:
                continue
            there, own = min(alike, key=lambda jump: abs(jump[0] - time))
            shift = there - time
            # A servo's next jump may be alike, too: that is another one's, which is nearer to it.
            back = min(abs(there - t) for t, real in jumps if abs(own - real) <= abs(real) / 2)
            if abs(shift) <= margin and abs(shift) == back:
                between = (b.time >= time + min(shift, 0.0)) & (b.time <= time + max(shift, 0.0))
                held &= ~(rows & between)
                late = max(late, abs(shift) if start < time < end else 0.0)
    if not held.any():
        return Errors(late, 0.0)
    difference = np.interp(b.time[held], a.time, a.finger_force) - b.finger_force[held]
    return Errors(late, float(np.sqrt(np.mean(difference**2))) / largest)


def _jumps(motions: Motions, least: float) -> list[tuple[float, float]]:
    """Return times [s] and sizes [N] of the jumps of the finger's force by more than the least."""
    change = np.diff(motions.finger_force)
    jump = (np.diff(motions.time) == 0) & (np.abs(change) > least)
    return list(zip(motions.time[1:][jump].tolist(), change[jump].tolist(), strict=True))
