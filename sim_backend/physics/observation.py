"""Observation of a complete drive, of the same form for every engine, and its error."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sautereau.rig.schema import Rig
from sautereau.sim_backend.physics.base import World
from sautereau.sim_backend.physics.drive import Drive, drive_of
from sautereau.sim_backend.physics.events import Motions, PluckEvents, StringEvent
from sautereau.sim_backend.physics.world import new_world
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.motion import Floats

GRID, GRID_ORDER = 50e-6, 6
"""s, step of the reference solution, and its order."""


@dataclass(frozen=True)
class Observation:
    """Motion and events of a drive; times in s from its start."""

    motions: Motions
    events: PluckEvents


@dataclass(frozen=True)
class Errors:
    """Difference of two observations; infinite if their numbers of events differ."""

    time: float
    """s, largest of all contacts, releases and returns."""
    force: float
    """Dimensionless: error of the strings' forces at release, and of the finger's force while a
    string is held, relative to the largest of each; where it jumps at another time it has none."""


def observe(rig: Rig, scene: Scene, drive: Drive | None = None) -> Observation:
    """Simulate a drive in a new world and return the observation.

    Args:
        rig: The nominal bench.
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
    tolerance: float = 1e-12,
) -> Observation:
    """Solve a scene's equations as finely as rounding lets it, and return the observation.

    Args:
        rig: The nominal bench.
        scene: Its engine, step and accuracy are ignored.
        drive: Reference to follow; None for `drive_of` the scene.
        step: s, longest one.
        order: Of the steps.
        tolerance: Dimensionless, relative error of a step.

    Raises:
        SceneError: The scene has a modal string or no chosen level, or its motion diverges.
    """
    from sautereau.sim_backend.physics.presses.world import ExactWorld

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
    string = _release_error(found.events.releases, true.events.releases)
    return Errors(max(apart, default=0.0), max(string, _held_error(found, true)))


def _release_error(found: list[StringEvent], true: list[StringEvent]) -> float:
    largest = max((abs(e.force) for e in true), default=0.0)
    if largest == 0.0:
        return 0.0
    return max(abs(a.force - b.force) for a, b in zip(found, true, strict=True)) / largest


def _held_error(found: Observation, true: Observation) -> float:
    """Return the rms error of the finger's force while strings are held, over its largest."""
    a, b = found.motions, true.motions
    held = np.zeros(len(b.time), bool)
    for contact, release in zip(true.events.contacts, true.events.releases, strict=False):
        # An event at a slightly different time is no error of the force.
        margin = 0.1 * (release.time - contact.time)
        inside = (b.time > contact.time + margin) & (b.time < release.time - margin)
        held |= inside & ~_between_jumps(a, b, margin)
    jump = np.diff(b.time) == 0  # there the force has two values
    held[:-1] &= ~jump
    held[1:] &= ~jump
    largest = float(np.abs(b.finger_force[held]).max(initial=0.0))  # no blow, which has no bound
    if largest == 0.0:
        return 0.0
    difference = np.interp(b.time[held], a.time, a.finger_force) - b.finger_force[held]
    return float(np.sqrt(np.mean(difference**2))) / largest


def _between_jumps(a: Motions, b: Motions, margin: float) -> NDArray[np.bool_]:
    """Return the rows of b from a jump of the finger's force to that of a, within a margin [s]."""
    between, jumps = np.zeros(len(b.time), bool), _jumps(b)
    others = np.concatenate([[-math.inf], _jumps(a), [math.inf]])
    place = np.searchsorted(others, jumps)
    before, after = others[place - 1], others[place]
    nearest = np.where(jumps - before < after - jumps, before, after)
    first = np.searchsorted(b.time, np.minimum(jumps, nearest))
    last = np.searchsorted(b.time, np.maximum(jumps, nearest), "right")
    for i in np.flatnonzero(np.abs(nearest - jumps) <= margin):
        between[first[i] : last[i]] = True
    return between


def _jumps(motions: Motions) -> Floats:
    """Return the times [s] at which the finger's force has two values."""
    jump = (np.diff(motions.time) == 0) & (np.diff(motions.finger_force) != 0)
    return motions.time[1:][jump]
