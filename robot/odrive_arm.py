"""The arm behind an ODrive: connection, power, homing and moves.

Positions are counts, speeds counts a second.
"""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Self

import numpy as np

from rig.schema import Rig
from robot.errors import GarbledAnswer, MotionFault, NotReady, RobotError
from robot.limits import Limits
from robot.odrive_axes import OdriveAxes
from robot.odrive_homing import find_switches, switches_closed
from robot.odrive_line import OdriveLine
from robot.odrive_stream import Stream
from robot.odrive_time import HostTime
from robot.port import Port, open_port
from robot.states import State, States
from robot.watchdog import Renewing
from trajectory.counts import to_counts
from trajectory.segments import Counts

_STOPPING = 5.0  # s, longest that a decelerated stop may take
_SAFE = "The arm was stopped and its motors are off: the controller confirms it."
_NOT_SAFE = (
    "The motors are NOT confirmed off ({reason}): press the emergency stop. The controller's"
    " watchdogs switch them off {period:g} s after the host's last sign of life."
)

Renewal = Callable[[Callable[[Callable[[], bool]], None], float], AbstractContextManager[object]]
"""Makes what gives the watchdogs their signs of life; called as `Renewing` is."""


class OdriveArm:
    """Two joints that can be powered, homed and moved.

    Args:
        rig: Its controller and arm are used.
        open_port: Opens the port: name, baud rate, timeout in seconds.
        clock: Seconds, of any origin.
        sleep: Wait for seconds.
        renewing: Gives the controller's watchdogs signs of life while the motors are on.
    """

    def __init__(
        self,
        rig: Rig,
        *,
        open_port: Callable[[str, int, float], Port] = open_port,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
        renewing: Renewal = Renewing,
    ):
        self._arm, self._settings, self._rig = rig.arm, rig.controller, rig
        self._limits = Limits(rig.arm)
        self._open_port, self._clock, self._sleep = open_port, clock, sleep
        self._renewing = renewing
        self._connection: OdriveAxes | None = None
        self._identity = ""
        self._states = States()
        self._stream: Stream | None = None

    @property
    def identity(self) -> str:
        """Hardware, firmware and serial number, as the controller says them."""
        self._axes("identity")
        return self._identity

    @property
    def simulated(self) -> bool:
        """Whether the controller says of itself that it is a stand-in."""
        return "SIM" in self.identity

    @property
    def state(self) -> State:
        """What state the arm is in; see `robot.states`."""
        return self._states.now

    def connect(self) -> str:
        """Open the port, switch off, set limits and watchdogs, and return the identity."""
        if self._connection is not None:
            raise NotReady("connect: already connected; call disconnect() first")
        name, timeout = self._settings.port, self._settings.timeout
        line = OdriveLine(self._open_port(name, self._settings.baud_rate, timeout), name, timeout)
        try:
            line.resynchronise()
            self._identity = _introduced(line)
            clock, sleep = self._clock, self._sleep
            if HostTime.is_kept_by(self._identity):
                clock, sleep = (host := HostTime(line)).clock, host.sleep
            axes = OdriveAxes(line, self._rig, clock, sleep)
            axes.set_up()
        except BaseException:
            line.close()
            raise
        self._states.enter(State.OFF)
        self._connection, self._stream = axes, None
        return self._identity

    def disconnect(self) -> None:
        """Switch off what is on, and close the port; never hides an earlier error."""
        axes, earlier = self._connection, sys.exception()
        if axes is None:
            return
        try:
            if self._states.now is State.FAULTED:
                axes.shout()
            elif self._states.on:
                if earlier is None:
                    self._switch_off(axes)
                else:
                    self._make_safe(earlier, lambda: self._switch_off(axes))
        finally:
            self._connection = None
            self._states.enter(State.OFF)
            axes.line.close()

    def __enter__(self) -> Self:
        self.connect()
        return self

    def __exit__(self, *exception: object) -> None:
        self.disconnect()

    @contextmanager
    def powered(self) -> Iterator[Self]:
        """Switch the motors on; leaving, by whatever way, stops and switches them off."""
        axes = self._axes("powered")
        self._states.require("powered")
        self._states.enter(State.STOPPED)
        try:
            axes.switch_on()
            with self._renewing(axes.renew, self._settings.watchdog_period):
                yield self
        except BaseException as error:
            if self._states.on and self._states.now is not State.FAULTED:
                self._make_safe(error, lambda: self._switch_off(axes))
            raise
        else:
            if self._states.on:
                self._switch_off(axes)

    def home(self) -> Counts:
        """Find the home switches; return the joint positions (counts, (2,)) set there."""
        axes = self._axes("home")
        self._states.require("home")
        home = self._home_counts()
        with self._guarded(axes), self._states.moving(State.HOMED):
            find_switches(axes, self._limits, home)
        return home

    def check_home(self) -> None:
        """Go back to the home switches, and refuse to go on if they are not where they were.

        The arm comes to either side of them, `controller.home_tolerance` off, where the
        motors are off while the switches are read.

        Raises:
            MotionFault: An encoder has slipped, or a switch has moved; the motors are off.
        """
        axes = self._axes("check_home")
        self._states.require("check_home")
        home, tolerance = self._home_counts(), self._settings.home_tolerance
        levels = []
        for side in (-1, 1):
            self.move_to(home + side * tolerance, self._limits.in_counts(self._arm.approach_speed))
            with self._guarded(axes):
                levels.append(switches_closed(axes))
        slipped = [
            f"joint {joint}"
            for joint, sides in enumerate(zip(*levels, strict=True), 1)
            if sides != (True, False)
        ]
        if slipped:
            with self._guarded(axes):
                raise MotionFault(
                    f"the home switch of {' and '.join(slipped)} is not within {tolerance} counts"
                    " of where it was found (controller.home_tolerance): an encoder has slipped or"
                    " a switch has moved; distrust what was recorded since home(), check coupling"
                    " and switch, then home() again"
                )

    def _home_counts(self) -> Counts:
        return to_counts(self._arm.home_angles, self._arm.counts_per_revolution)

    def move_to(self, counts: Counts, speed_counts_per_s: float) -> Counts:
        """Move both joints from point to point, and wait until they stand there.

        Args:
            counts: Counts, absolute target of each joint; shape (2,).
            speed_counts_per_s: Counts a second, largest of either joint.

        Returns:
            Counts, target as it was sent; shape (2,).
        """
        axes = self._axes("move_to")
        self._states.require("move_to")
        target = np.rint(counts).astype(np.int64)
        self._limits.check_move(target, speed_counts_per_s)
        loaded = self._states.now is not State.HOMED
        with (
            self._guarded(axes),
            self._states.moving(State.LOADED if loaded else State.HOMED),
        ):
            axes.go(target, speed_counts_per_s, self._limits.acceleration, self._limits.tolerance)
        return target

    def positions(self) -> Counts:
        """Read the joint positions: counts, shape (2,)."""
        return self._axes("positions").positions()

    def stop(self) -> Counts:
        """Decelerate to a stand, motors on; return where (counts, shape (2,))."""
        axes = self._axes("stop")
        self._states.require("stop")
        with self._guarded(axes):
            self._halt(axes)
            self._states.enter(State.STOPPED)
            return axes.positions()

    def abort(self) -> None:
        """Stop at once and switch the motors off; raise where this is not confirmed."""
        axes = self._axes("abort")
        self._confirm(lambda: self._abort(axes))

    def _axes(self, caller: str) -> OdriveAxes:
        """Return the connected axes."""
        if self._connection is None:
            raise NotReady(f"{caller}: not connected; call connect() first")
        return self._connection

    def _halt(self, axes: OdriveAxes) -> None:
        """Send no more setpoints, and move on to where the joints can stand."""
        if self._stream is not None:
            self._stream.cancel()
        axes.line.resynchronise()
        if axes.running:
            axes.halt(self._limits.acceleration, self._limits.speed)
            axes.await_moved("the stop", _STOPPING)

    def _abort(self, axes: OdriveAxes) -> None:
        try:
            if self._stream is not None:
                self._stream.cancel()
        finally:
            axes.abort()

    @contextmanager
    def _guarded(self, axes: OdriveAxes) -> Iterator[None]:
        """Abort a motion that fails, and say in the error what became of it."""
        try:
            yield
        except RobotError as error:
            self._make_safe(error, lambda: self._confirm(lambda: self._abort(axes)))
            raise

    def _switch_off(self, axes: OdriveAxes) -> None:
        """Stop with deceleration where possible, then abort."""

        def off() -> None:
            try:
                self._halt(axes)
            except RobotError:  # abort says what became of it
                pass
            finally:
                self._abort(axes)

        try:
            self._confirm(off)
        except KeyboardInterrupt:  # impatience must not leave the motors on
            self._confirm(off)
            raise

    def _confirm(self, switch_off: Callable[[], None]) -> None:
        """Switch off, and say so where the controller does not confirm it."""
        self._states.enter(State.FAULTED)
        try:
            switch_off()
        except RobotError as error:
            error.aftermath = self._not_safe("see above")
            raise
        self._states.enter(State.OFF)

    def _make_safe(self, error: BaseException, switch_off: Callable[[], None]) -> None:
        """Switch off, and put the outcome into an error that is on its way."""
        try:
            switch_off()
            outcome = _SAFE
        except RobotError as fault:
            outcome = self._not_safe(fault.args[0])
        if isinstance(error, RobotError):
            error.aftermath = outcome
        else:
            error.add_note(outcome)

    def _not_safe(self, reason: str) -> str:
        return _NOT_SAFE.format(reason=reason, period=self._settings.watchdog_period)


def _introduced(line: OdriveLine) -> str:
    """Return hardware, firmware and serial number of an ODrive, and refuse other things."""
    lines = line.ask("i", 3)
    identity = ", ".join(lines)
    if not lines[0].startswith("Hardware version: 3."):
        raise GarbledAnswer(
            f"port {line.name}: an ODrive 3.x gives its hardware version, this one says"
            f" {identity[:60]!r}; correct controller.port in the rig file"
        )
    if not lines[1].startswith("Firmware version: 0.5."):
        raise RobotError(
            f"controller on {line.name}: {lines[1]!r}, and this driver knows the properties of"
            " 0.5.x; install 0.5.6"
        )
    return f"ODrive, {identity}"
