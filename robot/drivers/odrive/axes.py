"""The two motors behind an ODrive: power, settings, limits, moves, setpoints and encoders.

Positions are counts of a joint; on the wire they are turns of its motor, 0 at home. Property names
are those of firmware 0.5.6: `Firmware/odrive-interface.yaml` of odriverobotics/ODrive, tag
fw-v0.5.6. The bits of its errors are in errors.csv; there, flags without a `bit` follow the one
before them.
"""

import math
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np

from sautereau.rig.disk import table_beside
from sautereau.rig.schema import Rig
from sautereau.robot.drivers.driver import MARGIN, POLL, Clock, Sleep, refuse_changes
from sautereau.robot.drivers.keep_alive import first_wait
from sautereau.robot.drivers.odrive.line import OdriveLine, framed, same
from sautereau.robot.drivers.odrive.setpoints import Setpoints, bandwidth
from sautereau.robot.drivers.serial_port import Port
from sautereau.robot.drivers.streamed import StreamedDriver
from sautereau.robot.errors import (
    GarbledAnswer,
    MotionFault,
    RobotError,
    SettingNotTaken,
)
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Counts, to_counts

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
_BITS: dict[str, dict[int, str]] = {}
"""Names of errors by the number of their bit, by property: `axis` is `axis0` or `axis1`."""
for _property, _bit, _name in table_beside(Path(__file__).with_name("errors")):
    _BITS.setdefault(_property, {})[int(_bit)] = _name
_OFF = tuple(f"w {name}.requested_state {IDLE}" for name in AXES)
_POSITIONS = ("f 0", "f 1")
_CURRENTS = tuple(f"r {name}.motor.current_control.Iq_setpoint" for name in AXES)
_REQUIRED = {
    "config.enable_sensorless_mode": 0,
    "config.enable_step_dir": 0,
    "config.startup_closed_loop_control": 0,
    "config.startup_homing": 0,
    "controller.config.circular_setpoints": 0,
    "controller.config.enable_overspeed_error": 1,
    "controller.config.enable_vel_limit": 1,
    "encoder.is_ready": 1,
    "motor.is_calibrated": 1,
}
"""Settings of an axis without which it is not safe, or does not move; saved by the user."""


_GAINS = (
    "controller.config.inertia",
    "controller.config.pos_gain",
    "controller.config.vel_gain",
    "controller.config.vel_integrator_gain",
    "controller.config.vel_limit_tolerance",
    "motor.config.current_lim",
    "motor.config.torque_constant",
)
"""Gains and further limits of an axis, saved by the user: they stay what they were found to be."""


class Axes(StreamedDriver[Setpoints]):
    """Axes 0 and 1, which turn joints 1 and 2; arguments as for `Driver`."""

    def __init__(self, rig: Rig, port: Port, clock: Clock, sleep: Sleep):
        settings = rig.controller
        self.line = OdriveLine(port, settings.port, settings.timeout, first_wait(settings))
        super().__init__(rig, clock, sleep, self.line, "motors' supply")
        self.due: dict[str, float] = {}
        """Properties that this driver has set, or found when it connected."""
        self._home = to_counts(rig.arm.home_angles, rig.arm.counts_per_revolution)
        self.per_turn = rig.arm.counts_per_revolution / np.array(rig.arm.gear_ratios)
        """Counts of each joint per turn of its motor."""
        self._per_ampere = np.ones(2)

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
        if len(digits) >= 9:  # cut by the firmware: which bits are set cannot be known
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

    def set_up_axes(self) -> None:
        self.abort()
        # Limits, filter and watchdog timeout; the watchdog does not run yet. Nothing is saved.
        line, arm, controller = self.line, self._rig.arm, self._settings
        width = bandwidth(controller.sample_period)
        self.due, settings = {}, {}
        for axis, (name, ratio) in enumerate(zip(AXES, arm.gear_ratios, strict=True)):
            required = _REQUIRED | {
                "encoder.config.cpr": arm.counts_per_revolution / ratio,
                "controller.config.load_encoder_axis": axis,
            }
            self.due |= {f"{name}.{key}": due for key, due in required.items()}
            settings |= {
                f"{name}.config.watchdog_timeout": controller.watchdog_period,
                f"{name}.controller.config.vel_limit": arm.speed_limit * ratio / (2 * math.pi),
                f"{name}.motor.config.torque_lim": arm.torque_limit / ratio,
                f"{name}.controller.config.input_filter_bandwidth": width,
                f"{name}.min_endstop.config.offset": 0.0,
                # At 0.05 rad/s a joint moves by 0.1 mrad in that time.
                f"{name}.min_endstop.config.debounce_ms": 2,
            }
        found = line.read_many(self.due)
        line.refuse(
            [
                f"{name} is {found[name]:g} and should be {due:.9g}"
                for name, due in self.due.items()
                if found[name] != due
            ]
        )
        line.set(settings)
        self.due |= settings
        self.renew()
        guards = {f"{name}.config.enable_watchdog": 1.0 for name in AXES}
        line.set(guards)
        gains = line.read_many(f"{name}.{gain}" for name in AXES for gain in _GAINS)
        self.due |= guards | gains
        constants = [gains[f"{name}.motor.config.torque_constant"] for name in AXES]
        self._per_ampere = np.array(constants) * self._rig.arm.gear_ratios

    def _commands(self, setpoints: Setpoints, row: int) -> tuple[str, str]:
        """Return the commands of a row of setpoints, for both axes."""
        first, second = self._turns(setpoints.positions[row])
        v, w = setpoints.velocities[row] / self.per_turn
        return f"p 0 {first:.7f} {v:.6f}", f"p 1 {second:.7f} {w:.6f}"

    def needed_baud_rate(self, setpoints: Setpoints) -> float:
        """Return the bits per second at which setpoints reach the controller in time."""
        asked = sum(len(framed(command)) for command in (*_POSITIONS, *_CURRENTS))
        rows = (self._commands(setpoints, row) for row in range(len(setpoints)))
        longest = asked + max(sum(len(framed(command)) for command in row) for row in rows)
        return 10 * longest / setpoints.interval

    def send(self, rows: Setpoints, index: int, /) -> tuple[Counts, Floats | None]:
        """Send a row of setpoints, and ask in the same write for positions and torques.

        A lost answer is not asked for again: the arm has moved on, and the record is of now.

        Returns:
            Joint positions (counts) and commanded torques at the joints (N m); shape (2,) each.
        """
        answers = self.line.ask(*self._commands(rows, index), *_POSITIONS, *_CURRENTS, answers=4)
        turns, _ = np.transpose(self.line.numbers(_POSITIONS, answers[:2], 2))
        currents = np.ravel(self.line.numbers(_CURRENTS, answers[2:], 1))
        return self._counts(turns), currents * self._per_ampere

    def positions(self) -> Counts:
        turns, _ = np.transpose(self.line.query(*_POSITIONS, count=2))
        return self._counts(turns)

    def move(self, target: Floats | Counts, speed: float, acceleration: float) -> None:
        """Start a move of both joints; counts, counts per second, counts per second squared."""
        settings = {}
        for name, per_turn in zip(AXES, self.per_turn, strict=True):
            settings |= {
                f"{name}.trap_traj.config.vel_limit": speed / per_turn,
                f"{name}.trap_traj.config.accel_limit": acceleration / per_turn,
                f"{name}.trap_traj.config.decel_limit": acceleration / per_turn,
            }
        self.line.set(settings)
        first, second = self._turns(target)
        self.line.confirmed(f"t 0 {first:.7f}", f"t 1 {second:.7f}")

    def start_halt(self) -> None:
        """Start a decelerated stop: a move to where the joints can come to rest."""
        acceleration = self.limits.acceleration
        turns, rates = np.transpose(self.line.query(*_POSITIONS, count=2))
        speeds = rates * self.per_turn
        rest = self._counts(turns) + speeds * np.abs(speeds) / (2 * acceleration)
        self.move(rest, self.limits.speed, acceleration)

    def follow(self, at: Counts) -> None:
        self.line.set({f"{name}.controller.config.input_mode": POSITION_FILTER for name in AXES})
        first, second = self._turns(at)
        self.line.confirmed(f"p 0 {first:.7f} 0", f"p 1 {second:.7f} 0")

    def await_moved(self, what: str, limit: float) -> None:
        """Wait until both moves are done, ``limit`` seconds at most; ``what`` is the motion."""

        def ended() -> bool:
            self.check_running(what)
            return all(self.line.read(f"{name}.controller.trajectory_done") for name in AXES)

        self.polling.until(ended, what, limit)

    def go(self, target: Floats | Counts, speed: float) -> None:
        rounded: Counts = np.rint(np.asarray(target)).astype(np.int64)
        distance = int(np.abs(rounded - self.positions()).max())
        self.move(rounded, speed, self.limits.move_acceleration(speed))
        self.await_moved("the move", distance / speed + MARGIN)
        self.polling.settle(self.positions, rounded, self.limits)

    def _turns(self, counts: Floats | Counts) -> Floats:
        """Return the motors' turns from home of joint positions (counts, (..., 2))."""
        return (counts - self._home) / self.per_turn

    def _counts(self, turns: Floats) -> Counts:
        """Return joint positions (counts, (2,)) of the motors' turns from home."""
        return np.rint(turns * self.per_turn + self._home).astype(np.int64)
