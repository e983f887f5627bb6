"""The arm behind a Galil DMC-4x: connection, power, homing and moves.

Positions are counts, speeds counts a second.
"""

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Self

import numpy as np

from rig.schema import Rig
from robot.axes import Axes
from robot.dmc import HOMED_ENDS, NORMAL_ENDS
from robot.errors import MotionFault, NotReady, RobotError
from robot.handshake import introduce, set_limits, verify
from robot.limits import Limits
from robot.line import Line
from robot.port import Port, open_port
from robot.program import controller_program
from robot.states import State, States
from robot.watchdog import Renewing
from trajectory.counts import to_counts
from trajectory.segments import Counts

MARGIN = 10.0
"""s that a motion may last longer than it should before it counts as stuck."""
_HOMING_SPEED = 0.2  # rad/s
_NO_LIMITS = ("FL 2147483647,2147483647", "BL -2147483648,-2147483648")
_SAFE = "The arm was stopped and its motors are off: the controller confirms it."
_NOT_SAFE = (
    "The motors are NOT confirmed off ({reason}): press the emergency stop. A motion that the"
    " controller has begun goes on until its watchdog strikes, {period:g} s after the host's last"
    " sign of life."
)

Renewal = Callable[[Callable[[Callable[[], bool]], None], float], AbstractContextManager[object]]
"""Makes what gives the watchdog its signs of life; called as `Renewing` is."""


class GalilArm:
    """Two joints that can be powered, homed and moved.

    Args:
        rig: Its controller and arm are used.
        open_port: Opens the port: name, baud rate, timeout in seconds.
        clock: Seconds, of any origin.
        sleep: Wait for seconds.
        renewing: Gives the controller's watchdog signs of life while the motors are on.
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
        self._rig, self._arm, self._settings = rig, rig.arm, rig.controller
        self._limits = Limits(rig.arm)
        self._open_port, self._clock, self._sleep = open_port, clock, sleep
        self._renewing = renewing
        self._connection: Axes | None = None
        self._identity = ""
        self._states = States()

    @property
    def identity(self) -> str:
        """Model and firmware, as the controller says them."""
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
        """Open the port, switch off, load limits and program, and return the identity."""
        if self._connection is not None:
            raise NotReady("connect: already connected; call disconnect() first")
        name, timeout = self._settings.port, self._settings.timeout
        line = Line(self._open_port(name, self._settings.baud_rate, timeout), name, timeout)
        try:
            self._identity = introduce(line, self._settings)
            axes = Axes(line, self._settings.trigger_output, self._clock, self._sleep)
            axes.abort()
            set_limits(line, self._rig, self._limits)
            line.download(controller_program(self._settings.trigger_output))
        except BaseException:
            line.close()
            raise
        self._states.enter(State.OFF)
        self._connection = axes
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
            axes.switch_on(self._settings.watchdog_period)
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
        line = axes.line
        home = self._home_counts()
        with self._guarded(axes), self._states.moving(State.HOMED):
            # Until the switches are found, positions mean nothing, and so do their limits.
            line.ask(*_NO_LIMITS)
            line.ask(*self._limits.profile(self._limits.in_counts(_HOMING_SPEED)))
            line.ask("HM AB")
            line.ask("BG AB")
            axes.await_standing("homing", 2 * math.pi / _HOMING_SPEED + MARGIN)
            axes.check_stop("homing", HOMED_ENDS)
            line.ask(f"DP {home[0]},{home[1]}")
            axes.settle(home, self._limits.tolerance)
            line.ask(*self._limits.software())
            verify(line, self._limits.software_settings())
        return home

    def check_home(self) -> None:
        """Go back to the home switches, and refuse to go on if they are not where they were.

        The arm comes to either side of them, `controller.home_tolerance` off.

        Raises:
            MotionFault: An encoder has slipped, or a switch has moved; the motors are off.
        """
        axes = self._axes("check_home")
        self._states.require("check_home")
        home, tolerance = self._home_counts(), self._settings.home_tolerance
        levels = []
        for side in (-1, 1):
            self.move_to(home + side * tolerance, self._limits.in_counts(self._arm.approach_speed))
            levels.append(axes.line.read("_HMA", "_HMB"))
        slipped = [
            f"joint {joint}"
            for joint, (before, behind) in enumerate(zip(*levels, strict=True), 1)
            if (before, behind) != (0, 1)
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
            speed_counts_per_s: Counts a second, largest of either joint; the controller
                takes even ones, so it is lowered to the next.

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
            distance = int(np.abs(target - axes.positions()).max())
            axes.line.ask(*self._limits.profile(speed_counts_per_s))
            axes.line.ask(f"PA {target[0]},{target[1]}")
            axes.line.ask("BG AB")
            axes.await_standing("the move", distance / speed_counts_per_s + MARGIN)
            axes.check_stop("the move", NORMAL_ENDS)
            axes.settle(target, self._limits.tolerance)
        return target

    def positions(self) -> Counts:
        """Read the joint positions: counts, shape (2,)."""
        return self._axes("positions").positions()

    def stop(self) -> Counts:
        """Decelerate to a stand, motors on; return where (counts, shape (2,))."""
        axes = self._axes("stop")
        self._states.require("stop")
        with self._guarded(axes):
            axes.stop()
            self._states.enter(State.STOPPED)
            return axes.positions()

    def abort(self) -> None:
        """Stop at once and switch the motors off; raise where this is not confirmed."""
        self._confirm(self._axes("abort").abort)

    def _axes(self, caller: str) -> Axes:
        """Return the connected axes."""
        if self._connection is None:
            raise NotReady(f"{caller}: not connected; call connect() first")
        return self._connection

    @contextmanager
    def _guarded(self, axes: Axes) -> Iterator[None]:
        """Abort a motion that fails, and say in the error what became of it."""
        try:
            yield
        except RobotError as error:
            self._make_safe(error, lambda: self._confirm(axes.abort))
            raise

    def _switch_off(self, axes: Axes) -> None:
        try:
            self._confirm(axes.switch_off)
        except KeyboardInterrupt:  # impatience must not leave the motors on
            self._confirm(axes.switch_off)
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
