"""The exact engine as a world."""

import numpy as np
from numpy.typing import NDArray

from sautereau.rig.schema import Arm, Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics import structures as ix
from sautereau.sim_backend.physics.base import TURNED_OVER, World, steps_in_sample
from sautereau.sim_backend.physics.drive import Drive
from sautereau.sim_backend.physics.events import Motions, StringEvent
from sautereau.sim_backend.physics.exact.compile import records
from sautereau.sim_backend.physics.exact.play import play
from sautereau.sim_backend.physics.finger import Finger, LoopedFinger, Reference, joint_cubics
from sautereau.sim_backend.physics.parameters import FINGERS, bench_of, finger_of
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.motion import Floats

ORDER = 4  # Order of the steps with which a scene is simulated
RATED, RATED_STEP, LEAST = 1e-9, 1e-3, 1e-16
"""A step of length `RATED_STEP` [s] may have the relative error `RATED`; the limit scales with the
order's power of the step, and is at least `LEAST`. A step with a larger error is divided."""
_ENDS = np.array([0.0, 1.0])
_FAULTS = {
    ix.TURNED_OVER: TURNED_OVER,
    ix.LOST: "the simulation diverged: the forces are out of the range of its masses; raise the"
    " smallest inertia or mass, or lower the largest force, stiffness or damping",
    ix.STIFF: "the simulation needs too many steps: a stiffness or damping is too large for its"
    " mass; raise the smallest inertia or mass, or lower the largest stiffness or damping",
    ix.JUMPED: "the fingertip is suddenly within the key; use a continuous reference",
    ix.AT_PIN: "the fingertip is so close to the balance pin that no angle of the key gives a"
    " contact; keep the arm in front of it",
    ix.JAMMED: "the friction of the fingertip jams the arm on the key: no motion follows from"
    " the forces; lower arm.fingertip_friction, or move arm.base_x",
}


class ExactWorld(World):
    """The physics of a scene with a spring string; see `physics.world.World`.

    Args:
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
        faults = scene.unsolved
        if scene.step is None or scene.string == "auto":
            faults.append(
                "step, string: the scene leaves them open; choose them with"
                " `sautereau.sim_backend.trade.select.select_solver`, or give a step and a string"
            )
        if faults:
            raise SceneError("\n".join(faults))
        bench = bench_of(rig, scene)
        self._press = new_press(rig, scene, self.start, *bench, order, tolerance)
        self._kind = FINGERS.index(scene.finger)
        self._steps = steps_in_sample(rig, scene.step or rig.controller.sample_period)
        self.finger = Finger(self.start)
        if scene.servo:
            self.finger = ServoFinger(self.press, rig.arm, scene.gravity)
        if not ExactWorld._compiled:  # now, and not while a host waits for an answer
            self._play(np.zeros((1, 2)), np.zeros((1, 2)), False)
            ExactWorld._compiled = True

    @property
    def press(self) -> ix.Press:
        """Parameters and state."""
        return ix.opened(self._press)

    def advance(self, reference: Reference, powered: bool) -> Motions:
        return self._play(*reference(_ENDS), powered)

    def play(self, drive: Drive) -> Motions:
        return self._play(*drive.ends(), True)

    def _play(self, counts: Floats, speeds: Floats, powered: bool) -> Motions:
        """Advance through controller samples with a reference at their ends."""
        kind, samples = self._kind, len(counts) - 1
        if isinstance(self.finger, ServoFinger):
            self.finger.switch(powered)
        if kind == ix.PUSH:
            cubics = np.zeros((samples, 2, 4))
        else:
            cubics = joint_cubics(self.start, counts, speeds, self.radians_per_count)
        # Rows for changes of mode, of which further ones are not kept.
        room = samples * (2 * self._steps + 2) + 64
        if len(self._press.rows) < room:
            self._press = self._press._replace(rows=np.empty((room, 7)))
        press = self._press
        fault, events, last = play(press, self.samples, cubics, samples, powered)
        rows = press.rows[:last]
        if fault == ix.FINE and not np.isfinite(rows).all():
            fault = ix.LOST
        if fault != ix.FINE:
            good = rows[np.isfinite(rows).all(axis=1), 0]
            reached = good[-1] if len(good) else self.time
            raise SceneError(f"rig {self.rig.name}: after {reached:.6g} s {_FAULTS[fault]}")
        self.samples += samples
        lists = self.events.contacts, self.events.releases, self.events.returns
        for time, event, choir, force in press.events[:events].tolist():
            lists[int(event)].append(StringEvent(time, int(choir), force))
        if kind == ix.IDEAL:
            first, second = (np.asarray(self.start) + counts[-1] * self.radians_per_count).tolist()
            self.finger = Finger((first, second))
        return Motions(*rows.T.copy())


class ServoFinger(LoopedFinger):
    """Two links, their motors under the position loops; see `physics.finger.Finger`.

    Args:
        press: Its arm is set to its start.
        gravity: m/s^2.
    """

    def __init__(self, press: ix.Press, arm: Arm, gravity: float):
        super().__init__(press.finger, arm, gravity)
        self._angles, self._speeds = press.x[-2:], press.v[-2:]
        self._angles[:] = press.finger.start
        self._blocked = np.zeros(2, bool)

    def joints(self) -> tuple[float, float]:
        return float(self._angles[0]), float(self._angles[1])

    def block(self, joint: int) -> None:
        self._blocked[joint] = True
        self._lock()

    def switch(self, powered: bool) -> bool:
        changed = super().switch(powered)
        if changed:
            self._lock()
        return changed

    def _lock(self) -> None:
        locked = self._blocked | (not self._powered)
        self._loops.locked[:] = locked
        self._speeds[locked] = 0.0


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
