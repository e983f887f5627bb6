"""The reduced engine: one equation of the key, for a push or an ideal finger; compiled.

It solves the scene's equations for the key's angle, and for the rise of jacks off the key,
without rigid bodies. Steps are of order 4, events are located, and steps with a large error are
divided.
"""

import math

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.choirs import choir_pluck, choirs
from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.events import Motions, PluckEvents, StringEvent
from sautereau.sim_backend.physics.finger import Reference, StandingFinger
from sautereau.sim_backend.physics.reduced import state as ix
from sautereau.sim_backend.physics.reduced.bench import Numbers, benches, new_drive_segment
from sautereau.sim_backend.physics.reduced.laws import Laws, joined, laws_of, mute_law
from sautereau.sim_backend.physics.reduced.play import play_sample
from sautereau.sim_backend.physics.reduced.state import new_state
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.motion import Floats

ENDS = np.array([0.0, 1.0])

_FAULTS = {
    ix.TURNED_OVER: "the key has turned by 1.2 rad, the limit of the model; lower the push, or"
    " enable the felt in the scene",
    ix.CHATTERS: "the motion chatters: its mode changes without end within one step; change the"
    " scene's forces",
    ix.LOST: "the simulation diverged; the scene's forces are out of its range: lower masses,"
    " stiffness or damping",
    ix.JUMPED: "the fingertip is suddenly within the key; use a continuous reference",
    ix.AT_PIN: "the fingertip is so close to the balance pin that no angle of the key gives a"
    " contact; keep the arm in front of it",
}


class ReducedWorld:
    """The physics of a scene with a push or an ideal finger; see `physics.world.World`.

    Args:
        rig: The nominal bench.
        scene: With `engine = "reduced"` and its step.
        start: rad, joints when power comes on; None for home and the scene's offset.

    Raises:
        SceneError: This engine does not support the scene, or its plectrum has no pluck.
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
        self._bench = benches(Numbers(rig, scene, {}), laws.places[None])[0]
        self._cells = laws.cells
        self._state, self._modes, self._guards, self._string_events = new_state(
            1 + len(rig.more_choirs)
        )
        self._segment = new_drive_segment(rig, scene)
        self._segment[[ix.CUBICS, ix.CUBICS + 4]] = self.start

    @property
    def time(self) -> float:
        """Simulated time [s]; advanced by motion and acquisition only."""
        return self.samples * self._period

    def advance(self, reference: Reference, powered: bool) -> Motions:
        """Advance by one controller sample.

        Args:
            reference: Of the arm over this sample, in raw encoder counts.
            powered: Whether the motors are on; without power there is no push.

        Raises:
            SceneError: The motion diverges or chatters.
        """
        time, end = self.time, (self.samples + 1) * self._period
        new_segment = self._set_segment(reference, powered, time)
        rows, changes = np.empty((self.steps, 6)), np.empty((ix.CHANGE_ROWS, 6))
        status = play_sample(
            self._bench, self._cells, self._state, self._modes, self._guards, self._string_events,
            changes, self._segment, time, end, rows, new_segment,
        )  # fmt: skip
        count = int(self._modes[0, ix.COUNT])
        if status == ix.FINE and count > ix.EVENTS:
            status = ix.CHATTERS
        if status == ix.FINE and not np.isfinite(rows).all():
            status = ix.LOST
        if status != ix.FINE:
            raise SceneError(f"rig {self.rig.name}: before {end:.6g} s {_FAULTS[status]}")
        if count:
            self._append_events(count)
        self.samples += 1
        rows = np.concatenate([changes[: self._modes[0, ix.CHANGES]], rows])
        if not self._ideal:
            rows[:, 4] /= self.rig.key.press_arm
        return Motions(*rows[np.argsort(rows[:, 0], kind="stable")].T)

    def _set_segment(self, reference: Reference, powered: bool, time: float) -> int:
        """Set the drive segment of a sample; return 2 for the first, 1 for a new one, else 0."""
        segment = self._segment
        if self._ideal:
            counts, speeds = reference(ENDS)
            places, speeds = counts * self.radians_per_count, speeds * self.radians_per_count
            segment[ix.START], segment[ix.CUBICS : ix.LINKAGE] = (
                time,
                joint_cubics(self.start, places, speeds),
            )
            first, second = (self.start + places[1]).tolist()
            self.finger = StandingFinger((first, second))
            return 1 if self.samples else 2
        pushes = powered and time < self._bench[0, ix.PUSH_END]
        push = float(self._bench[0, ix.PUSHES]) if pushes else 0.0
        new_segment = int(push != segment[ix.PUSH]) if self.samples else 2
        segment[ix.PUSH] = push
        return new_segment

    def _append_events(self, count: int) -> None:
        events = self.events
        lists = {
            ix.CONTACT: events.contacts,
            ix.RELEASE: events.releases,
            ix.RETURN: events.returns,
        }
        for e in range(count):
            time, force, _, kind, choir = self._string_events[e].tolist()
            lists[int(kind)].append(StringEvent(time, int(choir), force))


def check_scene(scene: Scene) -> None:
    """Refuse a scene that the reduced engine does not support.

    Raises:
        SceneError: The scene has a servo, a modal string, or an open choice.
    """
    faults = []
    if scene.finger == "servo" or scene.string == "modal":
        faults.append(
            f'engine: "reduced" does not support finger = "{scene.finger}" with'
            f' string = "{scene.string}"; set engine = "rigid"'
        )
    if scene.step is None or "auto" in (scene.plectrum, scene.string):
        faults.append(
            "step, plectrum, string: the scene leaves them open; choose them with"
            " `sautereau.sim_backend.trade.select.select_solver`, or give a step, a level and a"
            " string"
        )
    if faults:
        raise SceneError("\n".join(faults))


def steps_of(rig: Rig, scene: Scene) -> int:
    """Return the number of steps in a controller sample."""
    return math.ceil(rig.controller.sample_period / (scene.step or math.inf) - 1e-9)


def rig_laws(rig: Rig, scene: Scene) -> Laws:
    """Return the force laws of a rig's strings, one per choir.

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
        places: rad from the start, at both ends of the sample; shape (..., 2 ends, 2 joints).
        speeds: rad per sample, of the same shape.

    Returns:
        rad, shape (..., 8).
    """
    step = places[..., 1, :] - places[..., 0, :]
    v0, v1 = speeds[..., 0, :], speeds[..., 1, :]
    found = np.stack(
        [start + places[..., 0, :], v0, 3 * step - 2 * v0 - v1, v0 + v1 - 2 * step], -1
    )
    return found.reshape(*found.shape[:-2], 8)
