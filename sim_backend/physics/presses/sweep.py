"""Many presses of a scene with varied values, simulated together by the exact engine."""

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.drive import drive_of
from sautereau.sim_backend.physics.exact import structures as ix
from sautereau.sim_backend.physics.exact.play import play
from sautereau.sim_backend.physics.finger import joint_cubics
from sautereau.sim_backend.physics.presses.laws import DERIVED, PLECTRUM, STRING, set_laws
from sautereau.sim_backend.physics.presses.parameters import Numbers, benches, new_presses
from sautereau.sim_backend.physics.presses.world import check_scene
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.motion import Floats

CHUNK = 64
"""Presses per task of a thread."""


class Ending(IntEnum):
    """How a press ended; times of events after its end are infinite."""

    PLAYED = ix.FINE
    """Complete, with or without a pluck."""
    TURNED_OVER = ix.TURNED_OVER
    """The key has turned by 1.2 rad, the limit of the model."""
    LOST = ix.LOST
    """The simulation diverged, or is too stiff."""
    JUMPED = ix.JUMPED
    """An ideal fingertip was suddenly within the key."""
    AT_PIN = ix.AT_PIN
    """An ideal fingertip came so close to the pin that no angle gives a contact."""
    NO_PLUCK = 5
    """Plectrum and string have no quasi-static pluck; `predict_many` reports why. Not simulated."""
    OUT_OF_RANGE = 6
    """A value is outside the limits of the rig or the scene. Not simulated."""


@dataclass(frozen=True)
class Sweep:
    """First contact and release of each string in many presses; times in s from the drive's start.

    Arrays have the shape to which the values broadcast; those of strings have a leading axis of
    choirs. Values of events that do not occur are infinite; none is ever NaN.
    """

    contact: Floats
    """s, first contact; shape (choirs, ...)."""
    release: Floats
    """s, first release; shape (choirs, ...)."""
    release_force: Floats
    """N, of the string on the jack, downwards, just before it; shape (choirs, ...)."""
    release_speed: Floats
    """m/s, of the jack just before it; shape (choirs, ...)."""
    status: NDArray[np.int8]
    """An `Ending` each; shape (...)."""

    @property
    def plucked(self) -> NDArray[np.bool_]:
        """Whether each string was released; shape (choirs, ...)."""
        return np.isfinite(self.release)


def sweep(
    rig: Rig, scene: Scene, values: Mapping[str, ArrayLike], *, threads: int | None = None
) -> Sweep:
    """Simulate presses of a scene that differ in some values of the rig, or of the push.

    Every press equals that of a separate `ExactWorld`, bit for bit if plectrum and string do not
    vary. Varied plectra and strings are solved together, which is faster.

    Args:
        rig: The nominal bench; the scene's `truth` applies, then the values replace it.
        scene: With a push, or with an ideal finger that makes the rig's planned press, and with a
            chosen step and level.
        values: SI, by their dotted names as in `sautereau.rig.load.with_values`, of the parts that
            the scene simulates; broadcast together. Those of the push, and the derived
            `plectrum.bending_stiffness` and `string.static_stiffness` of the elastica, too.
        threads: Number of threads; None for one per processor. Without numba they gain
            nothing.

    Raises:
        SceneError: A name cannot be varied, the shapes do not fit, or the scene cannot be swept.
            The fault of a single press is reported by its status only.
    """
    rig = scene.true_rig(rig)
    check_scene(scene)
    if scene.finger == "servo":
        raise SceneError('finger: a servo cannot be swept; use finger = "push" or "ideal"')
    arrays = {name: np.asarray(value, float) for name, value in values.items()}
    try:
        shape = np.broadcast_shapes(*(v.shape for v in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {v.shape}" for name, v in arrays.items())
        raise SceneError(
            f"values: shapes do not fit together: {shapes}; give shapes that broadcast"
        ) from None
    flat = {n: np.broadcast_to(v, shape).ravel() if v.ndim else v for n, v in arrays.items()}
    presses, choirs = int(np.prod(shape)), 1 + len(rig.more_choirs)
    numbers = Numbers(rig, scene, flat)
    with np.errstate(all="ignore"):  # of presses that are not simulated
        keys, jacks = benches(numbers, presses)
    plucked = (*PLECTRUM, *STRING, *(DERIVED if scene.plectrum == "elastica" else ()))
    for at in numbers.prefixes if scene.plectrum != "none" else ():
        for name in plucked:
            numbers(f"{at}{name}")
    if unknown := sorted(set(values) - set(numbers.used)):
        raise SceneError(
            f"values: {', '.join(unknown)} cannot be varied in this scene; choose from"
            f" {', '.join(numbers.used)}"
        )
    good = numbers.within_limits(presses)
    cells, plucks = set_laws(numbers, jacks, good)
    status = np.where(good, np.where(plucks, Ending.PLAYED, Ending.NO_PLUCK), Ending.OUT_OF_RANGE)
    found = np.full((presses, choirs, 4), np.inf)
    samples, cubics, start = _drive(numbers, presses)

    def play_chunk(first: int) -> None:
        part = slice(first, first + CHUNK)
        presses = new_presses(numbers, start, keys[part], jacks[part], cells)
        play(presses, 0, cubics, samples[part], True, found[part], status[part])

    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        list(pool.map(play_chunk, range(0, presses, CHUNK)))
    contact, release, force, speed = (
        np.ascontiguousarray(part.T).reshape(choirs, *shape) for part in np.moveaxis(found, -1, 0)
    )
    return Sweep(contact, release, force, speed, status.astype(np.int8).reshape(shape))


def _drive(numbers: Numbers, presses: int) -> tuple[NDArray[np.int64], Floats, tuple[float, float]]:
    """Return the samples of each press, and the joints' cubics and start of an ideal finger."""
    rig, push = numbers.rig, numbers.scene.push
    if push:
        seconds = np.broadcast_to(numbers("push.duration") + push.rest, (presses,))
        within = np.where((seconds >= 0) & (seconds < np.inf), seconds, 0.0)
        samples = np.ceil(within / rig.controller.sample_period - 1e-9).astype(np.int64)
        return samples, np.zeros((samples.max(initial=0), 2, 4)), rig.arm.home_angles
    drive = drive_of(rig, numbers.scene)
    cubics = joint_cubics(drive.start, *drive.ends(), rig.arm.radians_per_count)
    return np.full(presses, drive.samples, np.int64), cubics, drive.start
