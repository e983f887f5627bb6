"""The driver of a Galil DMC-4x: a press, preloaded as PVT segments and played by itself.

Positions are counts, speeds counts a second, durations controller samples.
"""

from typing import TYPE_CHECKING

import numpy as np

from sautereau.robot.controller import Capture
from sautereau.robot.drivers.galil.arm import GalilArm
from sautereau.robot.drivers.galil.dmc import (
    CLEAR_SEGMENTS,
    END_OF_MOTION,
    NORMAL_ENDS,
    segment_commands,
    segments_from,
)
from sautereau.robot.drivers.galil.handshake import verify
from sautereau.robot.drivers.galil.line import Line
from sautereau.robot.drivers.galil.program import (
    PRESS,
    PUSH,
    PUSH_EVERY,
    PUSHES,
    RATE,
    SOURCES,
    WATCH,
    CapturePlan,
    array_commands,
    plan_capture,
    record_commands,
)
from sautereau.robot.drivers.galil.push import Push, plan_push
from sautereau.robot.drivers.joint_axes import MARGIN
from sautereau.robot.drivers.states import State
from sautereau.robot.errors import MotionFault, NotReady, SettingNotTaken
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Segments

if TYPE_CHECKING:
    from sautereau.robot.experiment.feedforward import TorqueTable

_VOLTAGE_STEP = 1e-4


class GalilController(GalilArm):
    """A `MotionController` over a serial line; arguments as for `GalilArm`."""

    _motion: Segments | None = None
    _plan: CapturePlan | None = None
    _push: Push | None = None
    _played: tuple[Segments, CapturePlan] | None = None

    def load(self, segments: Segments, torque: "TorqueTable | None" = None) -> Segments:
        """Preload a motion; return what was really sent.

        The controller repeats every segment as it hears it, and holds the torques in arrays
        that are read back.

        Args:
            segments: The motion, for the controller's FIFO.
            torque: Joint torques over time that the controller adds to those of its position
                loops, from the start of motion on; None for none.
        """
        line = self._axes("load").line
        self._states.require("load")
        settings = self._settings
        self._limits.check_motion(segments, settings.segment_limit, settings.sample_period)
        push = None if torque is None else plan_push(self._rig, torque, segments)
        self._states.enter(State.HOMED)
        self._motion = self._plan = self._push = self._played = None
        free = self._empty_fifo(line)
        commands = segment_commands(segments)
        line.ask_packed([*commands, *END_OF_MOTION])
        left = line.read("_PVA", "_PVB")
        falls = [before - after for before, after in zip(free, left, strict=True)]
        count = len(segments)
        # The end may count as one, of both axes alike.
        if falls[0] != falls[1] or falls[0] not in (count, count + 1):
            raise SettingNotTaken(
                f"controller on {line.name}: {count} segments were sent and its FIFO took"
                f" {falls[0]:g} and {falls[1]:g}; load() again, and check the cable's shield"
            )
        self._plan = self._make_room(line, segments.total_samples, push)
        self._push = _write(line, push)
        self._motion = segments_from(commands, segments.start)
        self._states.enter(State.LOADED)
        return self._motion

    @property
    def loaded_torque(self) -> "TorqueTable | None":
        """The torques that the loaded motion takes, as the controller holds them; None for none."""
        if self._push is None:
            return None
        from sautereau.robot.experiment.feedforward import TorqueTable

        per_volt = self._arm.torque_limit / self._settings.full_torque
        push, period = self._push, self._settings.sample_period
        middles = np.arange(len(push.volts), dtype=np.float64) + 0.5
        return TorqueTable(middles * push.interval * period, push.volts * per_volt)

    def _empty_fifo(self, line: Line) -> list[float]:
        """Return the free space of both FIFOs, emptied of a motion that was never played."""
        limit = self._settings.segment_limit
        free = line.read("_PVA", "_PVB")
        if free != [limit, limit]:
            line.ask(*CLEAR_SEGMENTS)
            free = line.read("_PVA", "_PVB")
        if min(free) < limit:
            raise SettingNotTaken(
                f"controller on {line.name}: its FIFO has room for {min(free):g} segments after"
                f" it was cleared, and controller.segment_limit is {limit}; switch the"
                " controller off and on, or correct the rig file"
            )
        return free

    def _make_room(self, line: Line, total_samples: int, push: Push | None) -> CapturePlan:
        """Give the capture, and the torques, their arrays; return how the capture goes."""
        line.ask("DA *[]")
        (room,) = line.read("_DM")
        rows = 0 if push is None else len(push.volts)
        plan = plan_capture(total_samples, int(room) - rows * len(PUSH))
        for command in array_commands(plan, rows):
            line.ask(command)
        return plan

    def arm(self) -> None:
        """Prepare capture, trigger and start; refuse where the arm is not at the start."""
        axes = self._axes("arm")
        self._states.require("arm")
        if self._motion is None or self._plan is None:
            raise NotReady("arm: no motion is loaded; call load() first")
        self._limits.check_at(axes.positions(), self._motion.start, "arm: the arm")
        for command in record_commands():
            axes.line.ask(command)
        axes.line.ask(f"{RATE}={self._plan.exponent}")
        verify(axes.line, {RATE: self._plan.exponent, f"_XQ{PRESS}": -1, "_MOA": 0, "_MOB": 0})
        self._states.enter(State.ARMED)

    def start(self) -> None:
        """Let the controller start the motion and return at once."""
        axes = self._axes("start")
        self._states.require("start")
        self._states.enter(State.MOVING)
        with self._guarded(axes):
            axes.line.ask(f"XQ #PRESS,{PRESS}")

    def wait(self) -> None:
        """Wait until the motion has ended, and verify that it ended as it should."""
        axes = self._axes("wait")
        self._states.require("wait")
        motion, plan = self._motion, self._plan
        if motion is None or plan is None:
            raise NotReady("wait: no motion was started; call load(), arm() and start() first")
        duration = motion.total_samples * self._settings.sample_period
        with self._guarded(axes):
            axes.await_(lambda: _ended(axes.line), "the press", duration + MARGIN)
            axes.check_stop("the press", NORMAL_ENDS)
            played = axes.line.read("_BTA", "_BTB")
            if any(done not in (len(motion), len(motion) + 1) for done in played):
                raise MotionFault(
                    f"the press ended after {played[0]:g} and {played[1]:g} of its"
                    f" {len(motion)} segments; check the stop inputs, then load() again"
                )
        self._motion, self._played = None, (motion, plan)
        self._states.enter(State.HOMED)

    def capture(self) -> Capture:
        """Read what was recorded of the last whole motion."""
        line = self._axes("capture").line
        self._states.require("capture")
        if self._played is None:
            raise NotReady("capture: no motion is done; wait() for the end of one first")
        _, plan = self._played
        columns = {
            name: np.array(line.numbers(f"QU {name}[],0,{plan.rows - 1},1", plan.rows))
            for name in SOURCES
        }
        volts = np.column_stack([columns["trqA"], columns["trqB"]])
        return Capture(
            samples=plan.interval * np.arange(plan.rows, dtype=np.int64),
            counts=_whole(columns, "pos"),
            following_errors=_whole(columns, "err"),
            torques=volts * self._arm.torque_limit / self._settings.full_torque,
            sample_period=self._settings.sample_period,
        )


def _whole(columns: dict[str, Floats], name: str) -> np.ndarray:
    pair = np.column_stack([columns[f"{name}A"], columns[f"{name}B"]])
    return np.rint(pair).astype(np.int64)


def _write(line: Line, push: Push | None) -> Push | None:
    """Write the torques into the controller, and return what it holds."""
    if push is None:
        line.ask(f"{PUSHES}=0")
        verify(line, {PUSHES: 0})
        return None
    line.ask_packed(push.commands())
    rows = len(push.volts)
    verify(line, {PUSHES: rows, PUSH_EVERY: -push.interval})
    held = np.column_stack([line.numbers(f"QU {name}[],0,{rows - 1},1", rows) for name in PUSH])
    if (wrong := np.abs(held - push.volts).max()) > _VOLTAGE_STEP:
        raise SettingNotTaken(
            f"controller on {line.name}: a torque that it holds is {wrong:.4g} V off what was"
            " sent; load() again, and check the cable's shield"
        )
    return Push(held, push.interval)


def _ended(line: Line) -> bool:
    """Whether both axes stand and the program has run to its end, or something has struck.

    That is the watchdog, or what stops one axis and would let the other go on: a limit.
    """
    names = ("_BGA", "_BGB", "_SCA", "_SCB", f"_XQ{PRESS}", f"_XQ{WATCH}")
    *moving, code_a, code_b, press, watch = line.read(*names)
    if any(moving):
        codes = zip(moving, (code_a, code_b), strict=True)
        return any(not moves and code not in NORMAL_ENDS for moves, code in codes)
    return press < 0 or watch < 0
