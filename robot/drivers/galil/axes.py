"""The two motors behind a Galil controller: on and off, moving and standing."""

from collections.abc import Callable, Collection

import numpy as np

from sautereau.robot.drivers.galil.dmc import stop_reason
from sautereau.robot.drivers.galil.handshake import verify
from sautereau.robot.drivers.galil.line import Line
from sautereau.robot.drivers.galil.program import LEFT, PRESS, TICK, TORQUES, WATCH
from sautereau.robot.drivers.joint_axes import STOPPING, JointAxes
from sautereau.robot.drivers.keep_alive import TICKS
from sautereau.robot.errors import (
    CommandRefused,
    GarbledAnswer,
    MotionFault,
    SettingNotTaken,
)
from sautereau.trajectory.segments import Counts

_QUIET = (f"HX {PRESS}", f"HX {TORQUES}", "OF 0,0", "RC 0")
_STATE = ("_MOA", "_MOB", "_BGA", "_BGB", "_OFA", "_OFB")
_SAFE = [1, 1, 0, 0, 0, 0]


class Axes(JointAxes[Line]):
    """Axes A and B.

    Args:
        line: To the controller.
        trigger_output: Digital output that an aborted program leaves high.
        halting: Sets how hard a stop decelerates; Galil takes it of moving axes too [confirm].
        clock: Seconds, of any origin.
        sleep: Wait for seconds.
    """

    _SUPPLY = "amplifiers"

    def __init__(
        self,
        line: Line,
        trigger_output: int,
        halting: str,
        clock: Callable[[], float],
        sleep: Callable[[float], None],
    ):
        super().__init__(line, clock, sleep)
        self.trigger_output = trigger_output
        self._halting = halting

    def positions(self) -> Counts:
        """Read the encoders: counts, shape (2,)."""
        return np.rint(self.line.read("_TPA", "_TPB")).astype(np.int64)

    def await_standing(self, what: str, patience: float) -> None:
        """Wait until both axes stand, ``patience`` seconds at most; ``what`` names the motion."""
        self.await_(lambda: not any(self.line.read("_BGA", "_BGB")), what, patience)

    def check_stop(self, what: str, normal: Collection[int]) -> None:
        """Refuse a motion that stopped for another reason than ``normal`` stop codes say."""
        *codes, watch, left = self.line.read("_SCA", "_SCB", f"_XQ{WATCH}", LEFT)
        if watch < 0 or left <= 0:  # it has struck, or is about to end after its strike
            raise MotionFault(
                f"{what} broke off: the controller's watchdog has switched the motors off, for"
                " the host was too long without a sign of life (controller.watchdog_period);"
                " take load off this machine, then home() again"
            )
        if faults := [
            f"joint {joint} {stop_reason(code)}"
            for joint, code in enumerate(codes, 1)
            if code not in normal
        ]:
            raise MotionFault(
                f"{what} broke off: {', '.join(faults)}; remove the cause, then home() again"
            )

    def switch_on(self, watchdog_period: float) -> None:
        """Let the watchdog run and see it count; then switch the motors on, and verify.

        Args:
            watchdog_period: s without `renew` until the watchdog strikes.
        """
        tick = round(watchdog_period * 1e3 / TICKS)
        self.line.ask(f"{TICK}={tick}", f"{LEFT}={TICKS}")
        verify(self.line, {TICK: tick, LEFT: TICKS})
        self.line.ask(f"XQ #WATCH,{WATCH}")
        self.await_(lambda: self._watched() < TICKS, "the watchdog's first count", STOPPING)
        self.renew()
        self.line.ask("SH AB")
        if any(self.line.read("_MOA", "_MOB")):
            raise SettingNotTaken(
                "the controller accepted SH AB and its motors are still off; check the"
                " emergency stop and the amplifiers"
            )

    def _watched(self) -> float:
        """Return the counts that the watchdog has left; it must be running."""
        left, running = self.line.read(LEFT, f"_XQ{WATCH}")
        if running < 0:
            raise SettingNotTaken(
                f"controller on {self.line.name}: its watchdog does not run; connect() again"
            )
        return left

    def renew(self, patient: Callable[[], bool] | None = None) -> None:
        """Give the watchdog a sign of life; ``patient`` as for `Line.ask`."""
        self.line.ask(f"{LEFT}={TICKS}", patient=patient)

    def stop(self) -> None:
        """Decelerate to a stand, motors on, without a torque from the program."""
        self.line.resynchronise()
        self._insist(self._halting, "ST AB")
        self._insist(*self._quiet)
        self.await_standing("the stop", STOPPING)

    def abort(self) -> None:
        """Stop at once, switch motors and trigger off, and verify by reading back.

        Raises:
            RobotError: The controller did not confirm that the motors are off.
        """
        state: list[float] = []
        for _ in range(2):  # what was sent before may have spoilt the first
            try:
                state = self.line.insist(("AB", "MO AB", ";".join(self._quiet)), *_STATE)
            except GarbledAnswer:
                state = self.line.insist((), *_STATE)
            if state == _SAFE:
                return
        raise MotionFault(
            f"the controller reads {','.join(_STATE)} = {state}, not motors off and standing"
        )

    def shout(self) -> None:
        """Say once more what `abort` says to a controller that does not answer."""
        self.line.shout("AB", "MO AB", ";".join(self._quiet))

    @property
    def _quiet(self) -> tuple[str, ...]:
        """What ends the program's doings but its watchdog's."""
        return (*_QUIET, f"CB {self.trigger_output}")

    def _insist(self, *commands: str) -> None:
        """Send commands, again where a broken-off line before them spoilt the first."""
        try:
            self.line.ask(*commands)
        except (CommandRefused, GarbledAnswer):
            self.line.resynchronise()
            self.line.ask(*commands)
