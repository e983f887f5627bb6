"""The power of the two motors behind an ODrive: states of the axes, errors, on and off.

Property names are those of firmware 0.5.6: `Firmware/odrive-interface.yaml` of
odriverobotics/ODrive, tag fw-v0.5.6. The bits of its errors are in errors.csv; there, flags without
a `bit` follow the one before them.
"""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from sautereau.rig.disk import table_beside
from sautereau.rig.schema import Rig
from sautereau.robot.drivers.driver import POLL, Clock, Sleep, refuse_changes
from sautereau.robot.drivers.keep_alive import first_wait
from sautereau.robot.drivers.odrive.line import OdriveLine, same
from sautereau.robot.drivers.odrive.setpoints import Setpoints
from sautereau.robot.drivers.serial_port import Port
from sautereau.robot.drivers.streamed import StreamedDriver
from sautereau.robot.errors import (
    GarbledAnswer,
    MotionFault,
    RobotError,
    SettingNotTaken,
)

AXES = ("axis0", "axis1")  # Names of the axes, which turn joints 1 and 2
IDLE = 1  # State of an axis whose motor is off
CLOSED_LOOP = 8  # State of an axis whose motor is on
POSITION_CONTROL = 3  # Control mode
POSITION_FILTER = 3  # Input mode in which an axis follows setpoints
TRAPEZOID = 5  # Input mode for moves with a trapezoidal speed
SWITCHING = 0.5  # s that an axis may take to change its state
_BEFORE_POWER = {"config.control_mode": POSITION_CONTROL, "input_vel": 0, "input_torque": 0}
"""Properties of an axis's controller with which it holds its position when it is switched on: the
firmware keeps the velocity of an earlier input. Writing the control mode replaces the target by
the position, so it is never written in motion."""
_DEVICE = "error"  # Property of the device's errors; the others of `_BITS` are an axis's
_CUT = 9  # Characters to which the firmware cuts a value: a number of so many digits may be longer
_BITS: dict[str, dict[int, str]] = {}
"""Names of errors by the number of their bit, by property: `axis` is `axis0` or `axis1`."""
for _property, _bit, _name in table_beside(Path(__file__).with_name("errors")):
    _BITS.setdefault(_property, {})[int(_bit)] = _name
_OFF = tuple(f"w {name}.requested_state {IDLE}" for name in AXES)


class Power(StreamedDriver[Setpoints]):
    """The power of axes 0 and 1; arguments as for `Driver`."""

    def __init__(self, rig: Rig, port: Port, clock: Clock, sleep: Sleep):
        settings = rig.controller
        self.line = OdriveLine(port, settings.port, settings.timeout, first_wait(settings))
        super().__init__(rig, clock, sleep, self.line, "motors' supply")
        self.due: dict[str, float] = {}
        """Properties that this driver has set, or found when it connected."""

    def renew(self, _keep_waiting: Callable[[], bool] | None = None, /) -> None:
        """Renew both watchdogs."""
        self.line.ask("u 0", "u 1", answers=0)

    @property
    def running(self) -> bool:
        """Whether both axes hold their position."""
        return self.states() == [CLOSED_LOOP, CLOSED_LOOP]

    def states(self) -> list[int]:
        """Read the state of both axes."""
        return [int(self.line.read(f"{name}.current_state")) for name in AXES]

    def check_running(self, what: str) -> None:
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
            MotionFault: Lists the errors of the device and of both joints.
        """
        registers = [(_DEVICE, _DEVICE, f"device {_DEVICE}")] + [
            (name.replace("axis", axis), name, f"joint {joint} {name.removeprefix('axis.')}")
            for joint, axis in enumerate(AXES, 1)
            for name in _BITS
            if name != _DEVICE
        ]
        faults = [
            f"{whose}: {names}"
            for name, register, whose in registers
            if (names := self._errors(name, register))
        ]
        if faults:
            raise MotionFault(
                f"{what} broke off: {'; '.join(faults)}; remove the cause, then home() again"
            )

    def _errors(self, name: str, register: str) -> str:
        """Return the names of the bits that are set in an error property, empty for none."""
        question = f"r {name}"

        def ask() -> tuple[str, int]:
            (digits,) = self.line.ask(question)
            try:
                return digits, int(digits)
            except ValueError as error:
                why = "a whole number was expected"
                raise self.line.garbled(question, digits, why) from error

        digits, value = self.line.reading(ask)
        if not value:
            return ""
        if len(digits) >= _CUT:  # which bits are set cannot be known
            return f"an error whose number begins with {digits}; `dump_errors(odrv0)` in odrivetool"
        bits = _BITS[register]
        names = [name for bit, name in bits.items() if value >> bit & 1]
        if unknown := value & ~sum(1 << bit for bit in bits):
            names.append(f"0x{unknown:x}")
        return ", ".join(names)

    def check_settings(self) -> None:
        """Read limits, gains and watchdogs again, and refuse those that have changed.

        Raises:
            SettingChanged: Names each property, the value found and the value set.
        """
        refuse_changes(self.line.name, self._changes)

    def _changes(self) -> list[str]:
        return [
            f"{name} is {value:g}, set to {self.due[name]:g}"
            for name, value in self.line.read_many(self.due).items()
            if not same(value, self.due[name])
        ]

    def switch_on(self) -> None:
        """Verify watchdogs and limits, switch the motors on where they are, and verify that."""
        line = self.line
        self.check_settings()
        line.set(
            {f"{name}.controller.{key}": due for name in AXES for key, due in _BEFORE_POWER.items()}
        )
        self.hold()
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

    def hold(self) -> None:
        self.line.set({f"{name}.controller.config.input_mode": TRAPEZOID for name in AXES})

    def switch_off(self) -> None:
        """Stop at once, switch the motors off, and verify by reading back.

        Raises:
            RobotError: The controller did not confirm that the motors are off.
        """
        try:
            self._off_and_read_back()
        except (GarbledAnswer, MotionFault):  # a spoilt line
            self._off_and_read_back()

    def send_abort(self) -> None:
        with suppress(RobotError):  # the error that it was not confirmed is raised already
            self.line.ask(*_OFF, answers=0)

    def _off_and_read_back(self) -> None:
        """Switch off, and wait for the idle state of both axes."""
        self.line.resynchronise(*_OFF)
        deadline = self.polling.clock() + SWITCHING
        while (states := self.states()) != [IDLE, IDLE]:
            if self.polling.clock() > deadline:
                raise MotionFault(
                    f"the axes are in states {states[0]} and {states[1]} after {SWITCHING:g} s,"
                    f" not off ({IDLE})"
                )
            self.polling.sleep(POLL)
