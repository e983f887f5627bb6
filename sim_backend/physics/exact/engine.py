"""The exact engine as a world."""

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.base import TURNED_OVER, World
from sautereau.sim_backend.physics.drive import Drive
from sautereau.sim_backend.physics.events import Motions, StringEvent
from sautereau.sim_backend.physics.exact import structures as ix
from sautereau.sim_backend.physics.exact.fingertip import engage
from sautereau.sim_backend.physics.exact.laws import set_laws
from sautereau.sim_backend.physics.exact.parameters import (
    ORDER,
    Numbers,
    benches,
    finger_of,
    run_of,
)
from sautereau.sim_backend.physics.exact.play import play
from sautereau.sim_backend.physics.finger import SETTLED, Reference, StandingFinger, joint_cubics
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.motion import Floats

SPARE_ROWS = 64
"""Rows for changes of mode, in a call and in every sample; further ones are not kept."""

_ENDS = np.array([0.0, 1.0])
_FAULTS = {
    ix.TURNED_OVER: TURNED_OVER,
    ix.LOST: "the simulation diverged or is too stiff; the scene's forces are out of its range:"
    " lower masses, stiffness or damping",
    ix.JUMPED: "the fingertip is suddenly within the key; use a continuous reference",
    ix.AT_PIN: "the fingertip is so close to the balance pin that no angle of the key gives a"
    " contact; keep the arm in front of it",
}


class ExactWorld(World):
    """The physics of a scene with a spring string; see `physics.world.World`.

    Args:
        rig: The nominal bench.
        scene: With its step.
        start: rad, joints when power comes on; None for home and the scene's offset.
        order: Of the steps, even, at most 8.
        tolerance: Dimensionless, relative error of a step; None for one that suits the step.

    Raises:
        SceneError: This engine does not support the scene, or its plectrum has no pluck.
    """

    _compiled = False

    def __init__(
        self,
        rig: Rig,
        scene: Scene,
        start: tuple[float, float] | None = None,
        *,
        order: int = ORDER,
        tolerance: float | None = None,
    ):
        super().__init__(rig, scene, start)
        rig = self.rig
        check_scene(scene)
        numbers = Numbers(rig, scene, {})
        keys, jacks = benches(numbers, 1)
        cells, _ = set_laws(numbers, jacks, np.ones(1, bool))
        finger, run = finger_of(rig, scene, self.start), run_of(rig, scene, order, tolerance)
        self._presses = ix.new_presses(keys, jacks, cells, finger, run)
        self._kind, self._steps = int(finger["kind"][0]), int(run["steps"][0])
        self._powered = False
        if not ExactWorld._compiled:  # now, and not while a host waits for an answer
            self._advance(np.zeros((0, 2, 4)), False)
            ExactWorld._compiled = True
        self.finger = ServoFinger(self.press) if scene.servo else StandingFinger(self.start)

    @property
    def press(self) -> ix.Press:
        """Parameters and state."""
        return ix.one_press(self._presses, 0)

    def advance(self, reference: Reference, powered: bool) -> Motions:
        """Advance by one controller sample; see `World.advance`."""
        return self._play(*reference(_ENDS), powered)

    def play(self, drive: Drive) -> Motions:
        """Advance through a complete drive; see `advance`."""
        return self._play(*drive.ends(), True)

    def _play(self, counts: Floats, speeds: Floats, powered: bool) -> Motions:
        """Advance through controller samples with a reference at their ends."""
        kind = self._kind
        if isinstance(self.finger, ServoFinger) and powered != self._powered:
            self.finger.switch(powered)
        self._powered = powered
        if kind == ix.PUSH:
            cubics = np.zeros((len(counts) - 1, 2, 4))
        else:
            cubics = joint_cubics(self.start, counts, speeds, self.radians_per_count)
        status, found, rows = self._advance(cubics, powered)
        if status == ix.FINE and not np.isfinite(rows).all():
            status = ix.LOST
        if status != ix.FINE:
            reached = rows[-1, 0] if len(rows) else 0.0
            raise SceneError(f"rig {self.rig.name}: after {reached:.6g} s {_FAULTS[status]}")
        self._append_events(found)
        if kind == ix.IDEAL:
            first, second = (np.asarray(self.start) + counts[-1] * self.radians_per_count).tolist()
            self.finger = StandingFinger((first, second))
        return Motions(*rows.T.copy())

    def _advance(self, cubics: Floats, powered: bool) -> tuple[int, Floats, Floats]:
        """Return the status after controller samples, their events and their rows."""
        samples, status = np.array([len(cubics)]), np.zeros(1, np.int64)
        room = len(cubics) * (self._steps + 2) + SPARE_ROWS
        if len(self._presses.rows) < room:
            self._presses = self._presses._replace(rows=np.empty((room, 6)))
        presses, first = self._presses, self.samples
        plucks = np.empty((1, len(presses.x), 4))
        events, rows = play(presses, first, cubics, samples, powered, plucks, status)
        self.samples += len(cubics)
        return int(status[0]), presses.events[:events], presses.rows[:rows]

    def _append_events(self, found: Floats) -> None:
        lists = self.events.contacts, self.events.releases, self.events.returns
        for time, kind, choir, force, _ in found.tolist():
            lists[int(kind)].append(StringEvent(time, int(choir), force))


class ServoFinger:
    """Two links, their motors under the position loops; see `physics.finger.Finger`."""

    def __init__(self, press):
        self._press, self._limit = press, float(press.finger.limit[0])
        self._blocked: set[int] = set()
        press.x[-2:] = press.finger.start

    def joints(self) -> tuple[float, float]:
        """Return the joint angles [rad]."""
        return float(self._press.x[-2]), float(self._press.x[-1])

    def torques(self) -> tuple[float, float]:
        """Return the motors' torques [N m]."""
        return float(self._press.finger.torque[0]), float(self._press.finger.torque[1])

    @property
    def settled(self) -> bool:
        """Whether both loops are within `SETTLED` counts, or the motors are off."""
        arm = self._press.finger
        return bool(arm.locked[0]) or max(map(abs, arm.lag)) <= SETTLED * arm.radians

    def drive(self, offsets: tuple[float, float], limits: tuple[float, float]) -> None:
        """Add offsets [N m] to the loops' torques from now on, and limit the sum [N m]."""
        self._press.finger.offset[:] = offsets
        self._press.finger.limit[:] = np.minimum(limits, self._limit)

    def block(self, joint: int) -> None:
        """Block the motor of a joint, counted from 0, from now on."""
        self._blocked.add(joint)
        self._lock(joint)

    def switch(self, powered: bool) -> None:
        """Switch the motors on, or off with their brakes on."""
        if powered:
            engage(self._press)
        for joint in self._blocked if powered else (0, 1):
            self._lock(joint)
            if not powered:
                self._press.finger.torque[joint] = 0.0

    def _lock(self, joint: int) -> None:
        self._press.finger.locked[joint] = 1
        self._press.v[joint - 2] = 0.0


def check_scene(scene: Scene) -> None:
    """Refuse a scene that the exact engine does not support.

    Raises:
        SceneError: The scene has a part that the engine does not support, or an open choice.
    """
    faults = scene.unsolved
    if scene.step is None or "auto" in (scene.plectrum, scene.string):
        faults.append(
            "step, plectrum, string: the scene leaves them open; choose them with"
            " `sautereau.sim_backend.trade.select.select_solver`, or give a step, a level and a"
            " string"
        )
    if faults:
        raise SceneError("\n".join(faults))
