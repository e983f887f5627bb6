"""The power of the two motors behind an ODrive: states of the axes, errors, on and off.

Property names are those of firmware 0.5.x (check them with `odrivetool` for another version).
"""

import math
from collections.abc import Callable
from contextlib import suppress

from sautereau.rig.schema import Rig
from sautereau.robot.drivers.driver import Clock, Sleep
from sautereau.robot.drivers.limits import Limits
from sautereau.robot.drivers.odrive.line import LineRefused, OdriveLine
from sautereau.robot.drivers.polling import POLL, Polling
from sautereau.robot.drivers.serial_port import Port
from sautereau.robot.errors import GarbledAnswer, MotionFault, RobotError, SettingNotTaken

AXES = ("axis0", "axis1")
"""Names of the axes, which turn joints 1 and 2."""
IDLE, CLOSED_LOOP = 1, 8
"""States of an axis."""
SWITCHING = 0.5
"""s that an axis may take to change its state."""
_ERRORS = {
    "error": {
        0x1: "INVALID_STATE",
        0x40: "MOTOR_FAILED",
        0x100: "ENCODER_FAILED",
        0x200: "CONTROLLER_FAILED",
        0x800: "WATCHDOG_TIMER_EXPIRED",
        0x1000: "MIN_ENDSTOP_PRESSED",
        0x2000: "MAX_ENDSTOP_PRESSED",
        0x4000: "ESTOP_REQUESTED",
        0x20000: "HOMING_WITHOUT_ENDSTOP",
        0x40000: "OVER_TEMP",
        0x80000: "UNKNOWN_POSITION",
    },
    "motor.error": {
        0x8: "DRV_FAULT",
        0x10: "CONTROL_DEADLINE_MISSED",
        0x80: "MODULATION_MAGNITUDE",
        0x400: "CURRENT_SENSE_SATURATION",
        0x1000: "CURRENT_LIMIT_VIOLATION",
    },
    "encoder.error": {
        0x2: "CPR_POLEPAIRS_MISMATCH",
        0x4: "NO_RESPONSE",
        0x20: "INDEX_NOT_FOUND_YET",
    },
    "controller.error": {
        0x1: "OVERSPEED",
        0x2: "INVALID_INPUT_MODE",
        0x20: "INVALID_ESTIMATE",
        0x80: "SPINOUT_DETECTED",
    },
}
"""Bits of the error properties in firmware 0.5.x, from memory: others are given as numbers."""


class Power:
    """The power of axes 0 and 1; arguments as for `Driver`."""

    def __init__(self, rig: Rig, port: Port, clock: Clock, sleep: Sleep):
        settings = rig.controller
        self._rig, self._settings = rig, settings
        self.limits = Limits(rig.arm)
        self.line = OdriveLine(port, settings.port, settings.timeout)
        # The axes take up to 1 ms to start.
        self.polling = Polling(clock, sleep, "motors' supply", delay=POLL)
        self._trigger = f"gpio{settings.trigger_output}.state"

    def close(self) -> None:
        self.line.close()

    def edge(self, level: bool) -> str:
        """Return the command that sets the output wired to the acquisition's trigger."""
        return f"w {self._trigger} {int(level)}"

    def renew(self, _keep_waiting: Callable[[], bool] | None = None, /) -> None:
        """Give both watchdogs a sign of life."""
        self.line.say("u 0", "u 1")

    @property
    def running(self) -> bool:
        """Whether both axes hold their position."""
        return self.states() == [CLOSED_LOOP, CLOSED_LOOP]

    def states(self) -> list[int]:
        """Read the state of both axes."""
        return [int(self.line.read(f"{name}.current_state")) for name in AXES]

    def check_running(self, what: str) -> None:
        """Refuse ``what`` where an axis has switched itself off; name its errors."""
        states = self.states()
        if states != [CLOSED_LOOP, CLOSED_LOOP]:
            self.check_errors(what)
            raise MotionFault(
                f"{what} broke off: the axes are in states {states[0]} and {states[1]}, not in"
                f" closed loop ({CLOSED_LOOP}), and report no error; check the motors' supply,"
                " then home() again"
            )

    def check_errors(self, what: str) -> None:
        """Refuse to continue with ``what`` where an axis reports an error.

        Raises:
            MotionFault: Lists the errors of both joints.
        """
        faults = [
            f"joint {joint} {error_names(register, value)}"
            for joint, name in enumerate(AXES, 1)
            for register in _ERRORS
            if (value := int(self.line.read(f"{name}.{register}")))
        ]
        if faults:
            raise MotionFault(
                f"{what} broke off: {'; '.join(faults)}; remove the cause, then home() again"
            )

    def switch_on(self) -> None:
        """Verify the watchdogs, switch the motors on where they are, and verify that."""
        line, period = self.line, self._settings.watchdog_period
        guards = {f"{name}.config.enable_watchdog": 1.0 for name in AXES}
        guards |= {f"{name}.config.watchdog_timeout": period for name in AXES}
        line.refuse(
            [
                f"{name} is {value:g} and should be {due:g}"
                for name, due in guards.items()
                if not math.isclose(value := line.read(name), due, abs_tol=2e-6)
            ]
        )
        self.renew()
        line.confirmed("sc")  # a watchdog that ran out with the motors off counts as an error
        self.check_errors("switching on")
        line.confirmed(*(f"w {name}.requested_state {CLOSED_LOOP}" for name in AXES))
        try:
            self.polling.until(lambda: self.running, "switching on", SWITCHING)
        except MotionFault as error:
            self.check_errors("switching on")
            raise SettingNotTaken(
                "the controller accepted closed loop and its motors are still off; check that"
                " they are calibrated, the emergency stop and the supply"
            ) from error

    @property
    def off(self) -> tuple[str, ...]:
        """The commands that switch both motors and the trigger off."""
        return (*(f"w {name}.requested_state {IDLE}" for name in AXES), self.edge(False))

    def abort(self) -> None:
        """Stop at once, switch motors and trigger off, and verify by reading back.

        Raises:
            RobotError: The controller did not confirm that the motors are off.
        """
        try:
            found = self._off_and_read_back()
        except (GarbledAnswer, MotionFault):  # a spoilt line, or a late answer to an earlier one
            found = self._off_and_read_back()
        if found:
            raise SettingNotTaken(
                f"controller on {self.line.name}: {self._trigger} is {found:g} after it was"
                " cleared; check what is wired to it"
            )

    def send_abort(self) -> None:
        """Send what `abort` sends, unacknowledged."""
        with suppress(RobotError):  # the error that it was not confirmed is raised already
            self.line.say(*self.off)

    def _off_and_read_back(self) -> float:
        """Switch off, wait for the idle state of both axes, and return the trigger's level."""
        self.line.resynchronise()
        self.line.say(*self.off)
        deadline = self.polling.clock() + SWITCHING
        while (states := self._states_read_again()) != [IDLE, IDLE]:
            if self.polling.clock() > deadline:
                raise MotionFault(
                    f"the axes are in states {states[0]} and {states[1]} after {SWITCHING:g} s,"
                    f" not off ({IDLE})"
                )
            self.polling.sleep(POLL)
        try:
            return self.line.read(self._trigger)
        except LineRefused as error:
            raise SettingNotTaken(
                f"controller on {self.line.name} has no {self._trigger}, which makes the trigger's"
                " edge: stock firmware sets no pin, so build one that has this property,"
                " or use another controller"
            ) from error

    def _states_read_again(self) -> list[int]:
        """Read the states, again where a refused `w` was answered before them."""
        try:
            return self.states()
        except (GarbledAnswer, LineRefused):
            self.line.resynchronise()
            return self.states()


def error_names(register: str, value: int) -> str:
    """Return the names of the bits that are set in an error property (`motor.error`)."""
    names = [name for bit, name in _ERRORS[register].items() if value & bit]
    if unknown := value & ~sum(_ERRORS[register]):
        names.append(f"0x{unknown:x}")
    return f"{register}: {', '.join(names)}"
