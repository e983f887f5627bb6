"""The two motors behind a Galil controller: set-up, on and off, stopping and standstill."""

from collections.abc import Callable, Collection

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.robot.drivers.driver import Clock, Sleep
from sautereau.robot.drivers.galil.dmc import (
    halting,
    software_limit_settings,
    software_limits,
    stop_reason,
)
from sautereau.robot.drivers.galil.line import Line
from sautereau.robot.drivers.galil.program import (
    LEFT,
    PRESS,
    TICK,
    TORQUES,
    WATCH,
    controller_program,
)
from sautereau.robot.drivers.keep_alive import TICKS
from sautereau.robot.drivers.limits import Limits
from sautereau.robot.drivers.polling import STOPPING, Polling
from sautereau.robot.drivers.serial_port import Port
from sautereau.robot.errors import (
    CommandRefused,
    GarbledAnswer,
    MotionFault,
    RobotError,
    SettingNotTaken,
)
from sautereau.trajectory.segments import Counts

_STATE = ("_MOA", "_MOB", "_BGA", "_BGB", "_OFA", "_OFB")
_SAFE = [1, 1, 0, 0, 0, 0]
_SAMPLE_PERIODS = (970e-6, 1001e-6)  # s, what firmwares make of TM 1000
_VOLTAGE_STEP = 5e-4  # V, to which the controller rounds TL and OF


class Axes:
    """Axes A and B, which turn joints 1 and 2; arguments as for `Driver`."""

    def __init__(self, rig: Rig, port: Port, clock: Clock, sleep: Sleep):
        settings = rig.controller
        self._rig, self._settings = rig, settings
        self._limits = Limits(rig.arm)
        self.line = Line(port, settings.port, settings.timeout)
        self._polling = Polling(clock, sleep, "amplifiers")
        trigger_off = f"CB {settings.trigger_output}"
        # Ends everything that the program does except its watchdog.
        self._quiet = (f"HX {PRESS}", f"HX {TORQUES}", "OF 0,0", "RC 0", trigger_off)
        self._abort_commands = ("AB", "MO AB", ";".join(self._quiet))

    def close(self) -> None:
        self.line.close()

    def set_up(self) -> str:
        identity = self._introduce()
        self.abort()
        self._set_limits()
        self.line.download(controller_program(self._settings.trigger_output))
        return identity

    def _introduce(self) -> str:
        """Identify the controller, and switch its echo on.

        Returns:
            Model and firmware, as the controller reports them.

        Raises:
            RobotError: It is no Galil controller with PVT mode, or it has no echo.
        """
        line = self.line
        line.resynchronise()
        try:
            line.ask("EO 0")
        except CommandRefused:  # the rest of a line that another host broke off
            line.ask("EO 0")
        identity = " ".join(line.ask("\x12\x16").split())
        if "DMC" not in identity:
            raise GarbledAnswer(
                f"port {line.name}: a Galil controller gives its revision as DMC..., this one"
                f" answers {identity[:40]!r}; correct controller.port in the rig file"
            )
        try:
            line.read("_PVA")
        except CommandRefused as error:
            raise RobotError(
                f"controller on {line.name}: {identity} has no PVT mode ({error.code}"
                f" {error.text}); update its firmware, or use a DMC-40x0 or later"
            ) from error
        line.ask("EO 1")
        line.echo = True
        try:
            line.verify({"_EO": 1})
        except GarbledAnswer as error:
            raise SettingNotTaken(
                f"controller on {line.name}: {identity} does not echo what it receives, so that a"
                f" command corrupted on the line would be executed ({error}); connect it by a"
                " serial line or USB"
            ) from error
        return identity

    def _set_limits(self) -> None:
        """Set sample period, following error, torque and software limits, and read them back.

        Raises:
            RobotError: The controller would not enforce a limit of the rig, or it does not take
                the settings.
        """
        line, settings, limits = self.line, self._settings, self._limits
        error = settings.position_error_limit
        faults = []
        period = settings.sample_period
        if not _SAMPLE_PERIODS[0] <= period <= _SAMPLE_PERIODS[1]:
            faults.append(
                f"controller.sample_period is {period * 1e6:.6g} us, and TM 1000 gives 976 to"
                " 1000 us; correct it as the controller's manual says"
            )
        room = int((limits.upper - limits.lower).min()) // 2
        if error > room:
            faults.append(
                f"controller.position_error_limit is {error} counts, more than half of the smaller"
                f" joint range, {room} counts; lower it"
            )
        if faults:
            raise RobotError(f"rig: {'; '.join(faults)}")
        line.ask("TM 1000")
        line.ask(f"ER {error},{error}", "OE 1,1")
        line.ask(f"TL {settings.full_torque:.4f},{settings.full_torque:.4f}", "OF 0,0")
        line.ask(*software_limits(limits))
        line.verify({"_TM": 1000, "_ERA": error, "_ERB": error, "_OEA": 1, "_OEB": 1})
        torque = settings.full_torque
        line.verify({"_TLA": torque, "_TLB": torque, "_OFA": 0, "_OFB": 0}, _VOLTAGE_STEP)
        line.verify(software_limit_settings(limits))

    def positions(self) -> Counts:
        """Read the encoders: counts, shape (2,)."""
        return np.rint(self.line.read("_TPA", "_TPB")).astype(np.int64)

    def await_standstill(self, what: str, limit: float) -> None:
        """Wait until both axes are at rest, ``limit`` seconds at most; ``what`` is the motion."""
        self._polling.until(lambda: not any(self.line.read("_BGA", "_BGB")), what, limit)

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

    def switch_on(self) -> None:
        """Start the watchdog and see it count; then switch the motors on, and verify."""
        tick = round(self._settings.watchdog_period * 1e3 / TICKS)
        self.line.ask(f"{TICK}={tick}", f"{LEFT}={TICKS}")
        self.line.verify({TICK: tick, LEFT: TICKS})
        self.line.ask(f"XQ #WATCH,{WATCH}")
        self._polling.until(lambda: self._watched() < TICKS, "the watchdog's first count", STOPPING)
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

    def renew(self, keep_waiting: Callable[[], bool] | None = None, /) -> None:
        """Give the watchdog a sign of life; ``keep_waiting`` as for `Line.ask`."""
        self.line.ask(f"{LEFT}={TICKS}", keep_waiting=keep_waiting)

    def halt(self) -> None:
        """Decelerate to a standstill, motors on, without a torque from the program."""
        self.line.resynchronise()
        # A Galil accepts DC while its axes move [confirm].
        self._ask_with_retry(halting(self._limits), "ST AB")
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

    def _ask_with_retry(self, *commands: str) -> None:
        """Send commands, twice where a broken-off line before them spoilt the first."""
        try:
            self.line.ask(*commands)
        except (CommandRefused, GarbledAnswer):
            self.line.resynchronise()
            self.line.ask(*commands)
