"""The two motors behind a Galil controller: on and off, moving and standing."""

from collections.abc import Callable, Collection

import numpy as np

from robot.dmc import stop_reason
from robot.errors import (
    CommandRefused,
    GarbledAnswer,
    LineLost,
    MotionFault,
    RobotError,
    SettingNotTaken,
)
from robot.line import Line
from trajectory.segments import Counts

STOPPING = 5.0
"""s, longest that a decelerated stop may take."""
SETTLING = 1.0
"""s that a joint may take to come within tolerance after a motion."""
_POLL = 0.01


class Axes:
    """Axes A and B.

    Args:
        line: To the controller.
        trigger_output: Digital output that an aborted program leaves high.
        clock: Seconds, of any origin.
        sleep: Wait for seconds.
    """

    def __init__(
        self,
        line: Line,
        trigger_output: int,
        clock: Callable[[], float],
        sleep: Callable[[float], None],
    ):
        self.line, self.trigger_output = line, trigger_output
        self.clock, self.sleep = clock, sleep

    def positions(self) -> Counts:
        """Read the encoders: counts, shape (2,)."""
        return np.rint(self.line.read("_TPA", "_TPB")).astype(np.int64)

    def await_standing(self, what: str, patience: float) -> None:
        """Wait until both axes stand, ``patience`` seconds at most; ``what`` names the motion."""
        self.await_(lambda: not any(self.line.read("_BGA", "_BGB")), what, patience)

    def await_(self, ended: Callable[[], bool], what: str, patience: float) -> None:
        """Poll until ``ended``, ``patience`` seconds at most."""
        deadline = self.clock() + patience
        while not ended():
            if self.clock() > deadline:
                raise MotionFault(
                    f"{what} has not ended after {patience:.3g} s; check that the arm moves"
                    " freely, its switches and the amplifiers"
                )
            self.sleep(_POLL)

    def settle(self, target: Counts, tolerance: int) -> None:
        """Wait until both joints are within ``tolerance`` counts of ``target`` (counts, (2,))."""
        deadline = self.clock() + SETTLING
        while np.abs((actual := self.positions()) - target).max() > tolerance:
            if self.clock() > deadline:
                raise MotionFault(
                    f"the joints stand at {actual[0]}, {actual[1]} counts, {SETTLING:g} s after"
                    f" a motion to {target[0]}, {target[1]} that may miss by {tolerance}; check"
                    " that the arm moves freely, and the gains of its position loops"
                )
            self.sleep(_POLL)

    def check_stop(self, what: str, normal: Collection[int]) -> None:
        """Refuse a motion that stopped for another reason than ``normal`` stop codes say."""
        codes = self.line.read("_SCA", "_SCB")
        if faults := [
            f"joint {joint} {stop_reason(code)}"
            for joint, code in enumerate(codes, 1)
            if code not in normal
        ]:
            raise MotionFault(
                f"{what} broke off: {', '.join(faults)}; remove the cause, then home() again"
            )

    def switch_on(self) -> None:
        """Switch the motors on where they stand, and verify."""
        self.line.ask("SH AB")
        if any(self.line.read("_MOA", "_MOB")):
            raise SettingNotTaken(
                "the controller accepted SH AB and its motors are still off; check the"
                " emergency stop and the amplifiers"
            )

    def stop(self) -> None:
        """Decelerate to a stand, motors on."""
        self.line.resynchronise()
        self._insist("ST AB")
        self.await_standing("the stop", STOPPING)

    def switch_off(self) -> None:
        """Stop with deceleration where possible, then abort."""
        try:
            self.stop()
        except RobotError:  # abort says what became of it
            pass
        finally:
            self.abort()

    def abort(self) -> None:
        """Stop at once, switch motors and trigger off, and verify by reading back.

        Raises:
            RobotError: The controller did not confirm that the motors are off.
        """
        for command in ("AB", "MO AB", f"CB {self.trigger_output}"):
            try:
                self._insist(command)
            except LineLost:
                raise
            except RobotError:  # the next one may pass, and the reading back decides
                continue
        try:
            state = self._read_state()
        except GarbledAnswer:  # a late answer of an earlier command
            state = self._read_state()
        if state != [1, 1, 0, 0]:
            raise MotionFault(
                f"the controller reads _MOA,_MOB,_BGA,_BGB = {state}, not motors off and standing"
            )

    def _read_state(self) -> list[float]:
        self.line.resynchronise()
        return self.line.read("_MOA", "_MOB", "_BGA", "_BGB")

    def _insist(self, command: str) -> None:
        """Send a command, again where a broken-off line before it spoilt the first."""
        self.line.resynchronise()
        try:
            self.line.ask(command)
        except (CommandRefused, GarbledAnswer):
            self.line.resynchronise()
            self.line.ask(command)
