"""The two servos that turn the joints: limits, power, moves and setpoints.

Positions are counts, 4096 per turn of a joint; a servo at `CENTRE` is at `arm.home_angles`.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Self

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.robot.drivers.driver import Clock, Sleep
from sautereau.robot.drivers.dynamixel import line as table
from sautereau.robot.drivers.dynamixel.line import DynamixelLine
from sautereau.robot.drivers.polling import MARGIN
from sautereau.robot.drivers.serial_port import Port
from sautereau.robot.drivers.settings import refuse_changes
from sautereau.robot.drivers.stream import Rows
from sautereau.robot.drivers.streamed import StreamedDriver
from sautereau.robot.errors import MotionFault, RobotError, SettingNotTaken
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Counts, Segments, motion_at, segment_cubics, to_counts

TURN = 4096
"""Counts in a turn."""
CENTRE = 2048
"""Count in the middle of a turn."""
INTERVAL = 8
"""Controller samples between two setpoints: 128 per second, which both servos answer in time at
1 Mbit/s with a return delay of 0.5 ms."""
LEAD = 13
"""Intervals for which the arm is held and recorded before a motion."""
_SETTLE = 5  # intervals for which the end is held and recorded
_TIME_BASED = 4  # drive mode: the profile's velocity and acceleration are times in ms
_POSITION_CONTROL = 3  # operating mode
_WATCHDOG = 20e-3  # s, unit of the watchdog's period
_LONGEST_WATCHDOG = 127  # units
_RISING = 0.1  # s, of a move's speed
_LONGEST_PROFILE = 32.0  # s
_ERRORS = {
    0: "input voltage",
    2: "overheating",
    3: "motor encoder",
    4: "electrical shock",
    5: "overload",
}
"""Bits of Hardware Error Status, by the e-Manual's heading Shutdown(63)."""


@dataclass(frozen=True)
class Goals(Rows):
    """The setpoints of a motion, one row for each interval."""

    positions: Counts
    """Counts, where each joint should be at the end of the interval; shape (n, 2)."""

    @classmethod
    def of(cls, segments: Segments, sample_period: float) -> Self:
        """Return the goals of a motion, of a rest before it and of one at its end."""
        last = segments.total_samples
        cubics = segment_cubics(segments, 1.0, sample_period)
        position = motion_at(segments, cubics, np.arange(last + 1)).position
        starts = np.arange(-LEAD * INTERVAL, last + _SETTLE * INTERVAL, INTERVAL)
        ends = position[np.clip(starts + INTERVAL, 0, last)]
        planned = position[np.clip(starts, 0, last)]
        return cls(planned, INTERVAL * sample_period, np.rint(ends).astype(np.int64))


class Servos(StreamedDriver[Goals]):
    """Servos 1 and 2; arguments as for `Driver`."""

    def __init__(self, rig: Rig, port: Port, clock: Clock, sleep: Sleep):
        self.line = DynamixelLine(port, rig.controller.port, rig.controller.timeout)
        super().__init__(rig, clock, sleep, self.line, "servos' supply")
        self.offset = CENTRE - to_counts(rig.arm.home_angles, TURN)
        """Position of a servo minus that of its joint, counts; shape (2,)."""
        self._due: dict[table.Item, tuple[int, ...]] = {}
        """Registers that this driver has set, with the values of both servos."""

    def set_up_axes(self) -> None:
        """Switch off, set modes and limits, and verify them.

        Raises:
            RobotError: Lists the values of the rig and settings of the servos that do not match.
        """
        self.abort()
        arm, period = self._rig.arm, self._settings.watchdog_period
        faults = []
        if arm.counts_per_revolution != TURN or arm.gear_ratios != (1.0, 1.0):
            faults.append(
                f"arm.counts_per_revolution is {arm.counts_per_revolution} with gear ratios"
                f" {arm.gear_ratios}, and the servos have {TURN} on the joints"
            )
        if self._watchdog() > _LONGEST_WATCHDOG and not self.stepped:
            longest = _WATCHDOG * _LONGEST_WATCHDOG
            faults.append(f"controller.watchdog_period is {period:g} s, at most {longest:g} s")
        lower, upper = self.limits.lower + self.offset, self.limits.upper + self.offset
        if (lower < 0).any() or (upper >= TURN).any():
            faults.append(
                f"arm limits are {lower[0]} to {upper[0]} and {lower[1]} to {upper[1]} counts of"
                f" the servos, within one turn of 0 to {TURN - 1}; mount the horns so that"
                " the arm's home is in the middle of their turn"
            )
        if (offsets := self.line.read(table.HOMING_OFFSET)).any():
            faults.append(f"Homing Offset(20) is {offsets[0]} and {offsets[1]}, not 0")
        if faults:
            raise SettingNotTaken(f"controller on {self.line.name}: {'; '.join(faults)}")
        self._due = {
            table.DRIVE_MODE: (_TIME_BASED, _TIME_BASED),
            table.OPERATING_MODE: (_POSITION_CONTROL, _POSITION_CONTROL),
            table.MIN_POSITION_LIMIT: tuple(map(int, lower)),
            table.MAX_POSITION_LIMIT: tuple(map(int, upper)),
        }
        for item, values in self._due.items():
            self.line.set(item, values)
        self._due[table.HOMING_OFFSET] = (0, 0)

    def check_settings(self) -> None:
        """Read modes, limits and watchdogs again, and refuse those that have changed."""
        refuse_changes(self.line.name, self._changes)

    def _changes(self) -> list[str]:
        watchdogs = {table.BUS_WATCHDOG: (self._watchdog(), self._watchdog())}
        return [
            f"{item.name}({item.address}) of servo {servo} is {value}, set to {due}"
            for item, values in (self._due | watchdogs).items()
            for servo, value, due in zip(table.SERVOS, self.line.read(item), values, strict=True)
            if value != due
        ]

    def _watchdog(self) -> int:
        """Return the watchdog's period in its units; the stand-in's host is never late."""
        units = round(self._settings.watchdog_period / _WATCHDOG)
        return min(units, _LONGEST_WATCHDOG) if self.stepped else units

    def renew(self, _keep_waiting: Callable[[], bool] | None = None, /) -> None:
        """Renew the watchdogs: any packet to both."""
        self.line.read(table.TORQUE_ENABLE)

    def switch_on(self) -> None:
        """Switch the torque on where the joints are, then the watchdogs, and verify both."""
        line, period = self.line, self._watchdog()
        line.write(table.BUS_WATCHDOG, (0, 0))  # an old error would lock the goal
        line.write(table.GOAL_POSITION, line.read(table.PRESENT_POSITION))
        line.write(table.TORQUE_ENABLE, (1, 1))
        line.write(table.BUS_WATCHDOG, (period, period))
        self.check_running("switching on")

    def check_running(self, what: str) -> None:
        """Refuse ``what`` where a servo has switched itself off, or its watchdog has run out."""
        on, errors, watchdogs = (
            self.line.read(item)
            for item in (table.TORQUE_ENABLE, table.HARDWARE_ERROR_STATUS, table.BUS_WATCHDOG)
        )
        faults = [
            f"servo {servo}: {fault}"
            for servo, state in enumerate(zip(on, errors, watchdogs, strict=True), 1)
            if (fault := _fault(*map(int, state)))
        ]
        if faults:
            raise MotionFault(
                f"{what} broke off: {'; '.join(faults)}; remove the cause, switch the servos'"
                " supply off and on, then connect() and home() again"
            )

    def switch_off(self) -> None:
        """Switch the torque off, and verify it.

        Raises:
            RobotError: A servo did not confirm it.
        """
        self.send_abort()
        if (on := self.line.read(table.TORQUE_ENABLE)).any():
            raise MotionFault(f"Torque Enable(64) is {on[0]} and {on[1]} after it was cleared")

    def send_abort(self) -> None:
        with suppress(RobotError):  # the error that it was not confirmed is raised already
            self.line.say(table.TORQUE_ENABLE, (0, 0))

    def positions(self) -> Counts:
        return self.line.read(table.PRESENT_POSITION) - self.offset

    def go(self, target: Counts, speed: float) -> None:
        duration = float(np.abs(target - self.positions()).max()) / speed + _RISING
        if duration > _LONGEST_PROFILE:
            raise MotionFault(
                f"move_to: {duration:.3g} s, and a servo moves for {_LONGEST_PROFILE:g} s at most;"
                " raise arm.approach_speed"
            )
        self._move(target, duration, min(_RISING, duration / 2))
        self.await_still("the move", duration + MARGIN)
        self.check_running("the move")
        self.polling.settle(self.positions, target, self.limits.tolerance)

    def await_still(self, what: str, limit: float) -> None:
        """Wait until both servos have ended their motion, ``limit`` s at most."""
        self.polling.until(lambda: not self.line.read(table.MOVING).any(), what, limit)

    def _move(self, target: Counts, duration: float, rising: float) -> None:
        """Start a motion of ``duration`` s, with ``rising`` s to its speed and as many back."""
        for item, seconds in (
            (table.PROFILE_VELOCITY, duration),
            (table.PROFILE_ACCELERATION, rising),
        ):
            self.line.write(item, [round(seconds * 1e3)] * 2)
        self.line.write(table.GOAL_POSITION, target + self.offset)

    def stay(self) -> None:
        """Let the joints come to rest where they are."""
        self._move(self.positions(), _RISING, 0.0)

    def follow(self, at: Counts) -> None:
        """Let both servos take an interval for the way to each setpoint, the first one ``at``."""
        self._move(at, INTERVAL * self._settings.sample_period, 0.0)
        self._hold_time(True)

    def hold(self) -> None:
        """End the motion of the servos; they stay at the last setpoint."""
        self._hold_time(False)

    def _hold_time(self, held: bool) -> None:
        if self.stepped:
            self.line.write_one(1, table.HOLD, int(held))

    def send(self, rows: Goals, index: int, /) -> tuple[Counts, Floats | None]:
        self.line.say(table.GOAL_POSITION, rows.positions[index] + self.offset)
        return self.positions(), None


def _fault(on: int, errors: int, watchdog: int) -> str:
    """Return the faults of a servo that should be on; empty without a fault."""
    if errors:
        bits = [name for bit, name in _ERRORS.items() if errors >> bit & 1]
        return f"hardware error: {', '.join(bits) or hex(errors)}"
    if watchdog < 0:
        return "its watchdog has run out"
    return "" if on else "its torque is off"
