"""The two motors behind a Galil controller: on and off, stopping and standstill."""

from collections.abc import Callable, Collection

import numpy as np

from sautereau.robot.drivers.galil.dmc import stop_reason
from sautereau.robot.drivers.galil.handshake import verify
from sautereau.robot.drivers.galil.line import Line
from sautereau.robot.drivers.galil.program import LEFT, PRESS, TICK, TORQUES, WATCH
from sautereau.robot.drivers.keep_alive import TICKS
from sautereau.robot.drivers.polling import STOPPING, Polling
from sautereau.robot.errors import (
    CommandRefused,
    GarbledAnswer,
    MotionFault,
    SettingNotTaken,
)
from sautereau.trajectory.segments import Counts

_STATE = ("_MOA", "_MOB", "_BGA", "_BGB", "_OFA", "_OFB")
_SAFE = [1, 1, 0, 0, 0, 0]


class Axes:
    """Axes A and B, which turn joints 1 and 2.

    Args:
        line: To the controller.
        polling: Waits for it.
        trigger_output: Digital output that an aborted program leaves high.
        halting: DC of a stop; a Galil accepts it while its axes move [confirm].
    """

    def __init__(self, line: Line, polling: Polling, trigger_output: int, halting: str):
        self.line, self.polling = line, polling
        self._halting = halting
        # Ends everything that the program does except its watchdog.
        self._quiet = (f"HX {PRESS}", f"HX {TORQUES}", "OF 0,0", "RC 0", f"CB {trigger_output}")

    def positions(self) -> Counts:
        """Read the encoders: counts, shape (2,)."""
        return np.rint(self.line.read("_TPA", "_TPB")).astype(np.int64)

    def await_standstill(self, what: str, limit: float) -> None:
        """Wait until both axes are at rest, ``limit`` seconds at most; ``what`` is the motion."""
        self.polling.until(lambda: not any(self.line.read("_BGA", "_BGB")), what, limit)

    def check_stop(self, what: str, normal: Collection[int]) -> None:
        """Refuse a motion that stopped for another reason than the stop codes ``normal``."""
        *codes, watch, left = self.line.read("_SCA", "_SCB", f"_XQ{WATCH}", LEFT)
        if watch < 0 or left <= 0:  # it has tripped, or is about to end after tripping
            raise MotionFault(
                f"{what} broke off: the controller's watchdog has switched the motors off,"
                " because the host gave no sign of life for too long"
                " (controller.watchdog_period); reduce the load on this machine, then home()"
                " again"
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
        """Start the watchdog and see it count; then switch the motors on, and verify.

        Args:
            watchdog_period: s without `renew` until the watchdog trips.
        """
        tick = round(watchdog_period * 1e3 / TICKS)
        self.line.ask(f"{TICK}={tick}", f"{LEFT}={TICKS}")
        verify(self.line, {TICK: tick, LEFT: TICKS})
        self.line.ask(f"XQ #WATCH,{WATCH}")
        self.polling.until(lambda: self._watched() < TICKS, "the watchdog's first count", STOPPING)
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

    def renew(self, keep_waiting: Callable[[], bool] | None = None) -> None:
        """Give the watchdog a sign of life; ``keep_waiting`` as for `Line.ask`."""
        self.line.ask(f"{LEFT}={TICKS}", keep_waiting=keep_waiting)

    def stop(self) -> None:
        """Decelerate to a standstill, motors on, without a torque from the program."""
        self.line.resynchronise()
        self._ask_with_retry(self._halting, "ST AB")
        self._ask_with_retry(*self._quiet)
        self.await_standstill("the stop", STOPPING)

    def abort(self) -> None:
        """Stop at once, switch motors and trigger off, and verify by reading back.

        Raises:
            RobotError: The controller did not confirm that the motors are off.
        """
        state: list[float] = []
        for _ in range(2):  # what was sent before may have spoilt the first
            try:
                state = self.line.send_unchecked(self._abort_commands, *_STATE)
            except GarbledAnswer:
                state = self.line.send_unchecked((), *_STATE)
            if state == _SAFE:
                return
        raise MotionFault(
            f"the controller reads {','.join(_STATE)} = {state}, not motors off and at rest"
        )

    def send_abort(self) -> None:
        """Send what `abort` sends, unacknowledged."""
        self.line.send_unacknowledged(*self._abort_commands)

    @property
    def _abort_commands(self) -> tuple[str, ...]:
        return ("AB", "MO AB", ";".join(self._quiet))

    def _ask_with_retry(self, *commands: str) -> None:
        """Send commands, twice where a broken-off line before them spoilt the first."""
        try:
            self.line.ask(*commands)
        except (CommandRefused, GarbledAnswer):
            self.line.resynchronise()
            self.line.ask(*commands)
