"""The reduced engine: the key of a push or an ideal finger as one equation, compiled.

It obeys the scene's equations in the key's angle, and in the rise of the jacks that leave it,
without rigid bodies. Steps are of order 4, events are located, and a step that something
stiff would make wrong is divided.
"""

import math

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.choirs import choir_pluck, choirs
from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.events import Motions, PluckEvents, StringEvent
from sautereau.sim_backend.physics.finger import Reference, StandingFinger
from sautereau.sim_backend.physics.reduced.bench import Numbers, benches, new_leg
from sautereau.sim_backend.physics.reduced.laws import Laws, joined, laws_of, mute_law
from sautereau.sim_backend.physics.reduced.play import play_sample
from sautereau.sim_backend.physics.reduced.state import (
    AT_PIN,
    CHATTERS,
    CONTACT,
    COUNT,
    CUBICS,
    EVENTS,
    FINE,
    JUMPED,
    LINKAGE,
    LOST,
    PUSH,
    PUSH_END,
    PUSHES,
    RELEASE,
    RETURN,
    START,
    TURNED_OVER,
    new_state,
)
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.motion import Floats

ENDS = np.array([0.0, 1.0])

_FAULTS = {
    TURNED_OVER: "the key has turned by 1.2 rad, where it is no key any more; lower the push, or"
    " let the scene have its felt",
    CHATTERS: "the motion changes without end within one step; change the scene's forces",
    LOST: "the motion has lost its numbers; the scene's forces are out of its range",
    JUMPED: "the fingertip is suddenly within the key; play a reference that is continuous",
    AT_PIN: "the fingertip is so near the balance pin that it touches the key at no angle; keep"
    " the arm in front of it",
}


class ReducedWorld:
    """The physics of a scene with a push or an ideal finger; see `physics.world.World`.

    Args:
        rig: The nominal bench.
        scene: With `engine = "reduced"` and its step.
        start: rad, joints when power comes on; None for the home switches and the scene's
            offset from them.

    Raises:
        SceneError: The scene is none for this engine, or its plectrum has no pluck.
    """

    def __init__(self, rig: Rig, scene: Scene, start: tuple[float, float] | None = None):
        self.rig = rig = scene.true_rig(rig)
        check_scene(scene)
        home, offset = rig.arm.home_angles, scene.start_offset
        self.start = start or (home[0] + offset[0], home[1] + offset[1])
        """rad, joints when power came on."""
        self.radians_per_count = rig.arm.radians_per_count
        self.steps = steps_of(rig, scene)
        """Steps in a controller sample."""
        self.samples = 0
        """Controller samples done."""
        self.events = PluckEvents()
        self.finger = StandingFinger(self.start)
        self._period = rig.controller.sample_period
        self._ideal = scene.finger == "ideal"
        laws = rig_laws(rig, scene)
        self._bench, self._cells = (
            benches(Numbers(rig, scene, {}), laws.places[None])[0],
            laws.cells,
        )
        self._state, self._kinds, self._marks, self._happened = new_state(1 + len(rig.more_choirs))
        self._leg = new_leg(rig, scene)
        self._leg[[CUBICS, CUBICS + 4]] = self.start

    @property
    def time(self) -> float:
        """World's clock [s]: only motion and acquisition make it go."""
        return self.samples * self._period

    def advance(self, reference: Reference, powered: bool) -> Motions:
        """Advance by one controller sample.

        Args:
            reference: Of the arm over this sample, in raw encoder counts.
            powered: Whether the motors are on, without which there is no push.

        Raises:
            SceneError: The motion cannot be followed.
        """
        time, end = self.time, (self.samples + 1) * self._period
        fresh = self._set_leg(reference, powered, time)
        rows = np.empty((self.steps, 6))
        status = play_sample(
            self._bench, self._cells, self._state, self._kinds, self._marks, self._happened,
            self._leg, time, end, rows, fresh,
        )  # fmt: skip
        count = int(self._kinds[0, COUNT])
        if status == FINE and count > EVENTS:
            status = CHATTERS
        if status == FINE and not np.isfinite(rows).all():
            status = LOST
        if status != FINE:
            raise SceneError(f"rig {self.rig.name}: before {end:.6g} s {_FAULTS[status]}")
        if count:
            self._note(count)
        self.samples += 1
        if not self._ideal:
            rows[:, 4] /= self.rig.key.press_arm
        return Motions(*rows.T.copy())

    def _set_leg(self, reference: Reference, powered: bool, time: float) -> int:
        """Set what the finger does in a sample; return 2 for the first, 1 for something else."""
        leg = self._leg
        if self._ideal:
            counts, speeds = reference(ENDS)
            places, speeds = counts * self.radians_per_count, speeds * self.radians_per_count
            leg[START], leg[CUBICS:LINKAGE] = time, joint_cubics(self.start, places, speeds)
            first, second = (self.start + places[1]).tolist()
            self.finger = StandingFinger((first, second))
            return 1 if self.samples else 2
        pushes = powered and time < self._bench[0, PUSH_END]
        push = float(self._bench[0, PUSHES]) if pushes else 0.0
        fresh = int(push != leg[PUSH]) if self.samples else 2
        leg[PUSH] = push
        return fresh

    def _note(self, count: int) -> None:
        events = self.events
        lists = {CONTACT: events.contacts, RELEASE: events.releases, RETURN: events.returns}
        for e in range(count):
            time, force, _, kind, choir = self._happened[e].tolist()
            lists[int(kind)].append(StringEvent(time, int(choir), force))


def check_scene(scene: Scene) -> None:
    """Refuse what the reduced engine does not do.

    Raises:
        SceneError: The scene has a servo, a modal string, or something not settled.
    """
    faults = []
    if scene.finger == "servo" or scene.string == "modal":
        faults.append(
            f'engine: "reduced" is an equation of the key alone, not of finger = "{scene.finger}"'
            f' and string = "{scene.string}"; take engine = "rigid"'
        )
    if scene.step is None or "auto" in (scene.plectrum, scene.string):
        faults.append(
            "step, plectrum, string: the scene leaves them open; settle it with"
            " sim_backend.trade.select.select_solver, or give a step, a level and a string"
        )
    if faults:
        raise SceneError("\n".join(faults))


def steps_of(rig: Rig, scene: Scene) -> int:
    """Return the steps in a controller sample."""
    return math.ceil(rig.controller.sample_period / (scene.step or math.inf) - 1e-9)


def rig_laws(rig: Rig, scene: Scene) -> Laws:
    """Return the laws of a rig's strings, one of each choir.

    Raises:
        SceneError: A choir has no pluck.
    """
    if scene.plectrum == "none":
        return joined([mute_law()] * (1 + len(rig.more_choirs)))
    try:
        return laws_of([choir_pluck(choir, scene.plectrum) for choir in choirs(rig)])
    except ModelError as error:
        raise SceneError(f"rig {rig.name}: {error}") from error


def joint_cubics(start: tuple[float, float], places: Floats, speeds: Floats) -> Floats:
    """Return the joints' cubics over a controller sample, four coefficients each.

    Args:
        start: rad, joints when power came on.
        places: rad from there, at both ends of the sample; shape (..., 2 ends, 2 joints).
        speeds: rad in a sample, likewise.

    Returns:
        rad, shape (..., 8).
    """
    step = places[..., 1, :] - places[..., 0, :]
    v0, v1 = speeds[..., 0, :], speeds[..., 1, :]
    found = np.stack(
        [start + places[..., 0, :], v0, 3 * step - 2 * v0 - v1, v0 + v1 - 2 * step], -1
    )
    return found.reshape(*found.shape[:-2], 8)
