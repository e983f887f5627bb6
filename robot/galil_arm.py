"""The arm behind a Galil DMC-4x: connection, power, homing and moves.

Positions are counts, speeds counts a second.
"""

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Literal, Self

import numpy as np

from rig.schema import Rig
from robot.axes import Axes
from robot.dmc import HOMED_ENDS, NORMAL_ENDS
from robot.errors import NotReady, RobotError
from robot.handshake import introduce, verify
from robot.limits import Limits
from robot.line import Line
from robot.port import Port, open_port
from trajectory.counts import to_counts
from trajectory.segments import Counts

MARGIN = 10.0
"""s that a motion may last longer than it should before it counts as stuck."""
_HOMING_SPEED = 0.2  # rad/s
_NO_LIMITS = ("FL 2147483647,2147483647", "BL -2147483648,-2147483648")
_SAFE = "The arm was stopped and its motors are off: the controller confirms it."
_NOT_SAFE = (
    "The motors are NOT confirmed off ({reason}): press the emergency stop. A motion that the"
    " controller has begun goes on to its end."
)

Stage = Literal["empty", "loaded", "armed", "running", "done"]
"""How far a press has come."""


class GalilArm:
    """Two joints that can be powered, homed and moved.

    Args:
        rig: Its controller and arm are used.
        open_port: Opens the port: name, baud rate, timeout in seconds.
        clock: Seconds, of any origin.
        sleep: Wait for seconds.
    """

    def __init__(
        self,
        rig: Rig,
        *,
        open_port: Callable[[str, int, float], Port] = open_port,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ):
        self._arm, self._settings = rig.arm, rig.controller
        self._limits = Limits(rig.arm)
        self._open_port, self._clock, self._sleep = open_port, clock, sleep
        self._connection: Axes | None = None
        self._identity = ""
        self._homed = self._powered = False
        self._stage: Stage = "empty"

    @property
    def identity(self) -> str:
        """Model and firmware, as the controller says them."""
        self._axes("identity")
        return self._identity

    @property
    def simulated(self) -> bool:
        """Whether the controller says of itself that it is a stand-in."""
        return "SIM" in self.identity

    def connect(self) -> str:
        """Open the port, set sample period and error limits, and return the identity."""
        if self._connection is not None:
            raise NotReady("connect: already connected; call disconnect() first")
        name, timeout = self._settings.port, self._settings.timeout
        line = Line(self._open_port(name, self._settings.baud_rate, timeout), name, timeout)
        try:
            self._identity = introduce(line, self._settings)
        except BaseException:
            line.close()
            raise
        self._homed = self._powered = False
        self._stage = "empty"
        self._connection = Axes(line, self._settings.trigger_output, self._clock, self._sleep)
        return self._identity

    def disconnect(self) -> None:
        """Switch off what is on, and close the port; never hides an earlier error."""
        axes, earlier = self._connection, sys.exception()
        if axes is None:
            return
        try:
            if self._powered:
                if earlier is None:
                    self._switch_off(axes)
                else:
                    self._make_safe(earlier, lambda: self._switch_off(axes))
        finally:
            self._connection = None
            self._homed = self._powered = False
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
        if self._powered:
            raise NotReady("powered: the motors are on already; leave the first block first")
        self._powered = True
        try:
            axes.switch_on()
            yield self
        except BaseException as error:
            if self._powered:
                self._make_safe(error, lambda: self._switch_off(axes))
            raise
        else:
            if self._powered:
                self._switch_off(axes)
        finally:
            self._powered = False

    def home(self) -> Counts:
        """Find the home switches; return the joint positions (counts, (2,)) set there."""
        axes = self._axes("home", powered=True, standing=True)
        line = axes.line
        home = to_counts(self._arm.home_angles, self._arm.counts_per_revolution)
        (low_a, low_b), (high_a, high_b) = self._limits.lower, self._limits.upper
        self._homed = False
        with self._guarded(axes):
            # Until the switches are found, positions mean nothing, and so do their limits.
            line.ask(*_NO_LIMITS)
            line.ask(*self._limits.profile(self._limits.in_counts(_HOMING_SPEED)))
            line.ask("HM AB", "BG AB")
            axes.await_standing("homing", 2 * math.pi / _HOMING_SPEED + MARGIN)
            axes.check_stop("homing", HOMED_ENDS)
            line.ask(f"DP {home[0]},{home[1]}")
            axes.settle(home, self._limits.tolerance)
            line.ask(f"FL {high_a},{high_b}", f"BL {low_a},{low_b}")
            verify(line, {"_FLA": high_a, "_FLB": high_b, "_BLA": low_a, "_BLB": low_b})
        self._homed = True
        return home

    def move_to(self, counts: Counts, speed_counts_per_s: float) -> Counts:
        """Move both joints from point to point, and wait until they stand there.

        Args:
            counts: Counts, absolute target of each joint; shape (2,).
            speed_counts_per_s: Counts a second, largest of either joint; the controller
                takes even ones, so it is lowered to the next.

        Returns:
            Counts, target as it was sent; shape (2,).
        """
        axes = self._axes("move_to", powered=True, homed=True, standing=True)
        target = np.rint(counts).astype(np.int64)
        self._limits.check_move(target, speed_counts_per_s)
        with self._guarded(axes):
            distance = int(np.abs(target - axes.positions()).max())
            axes.line.ask(*self._limits.profile(speed_counts_per_s))
            axes.line.ask(f"PA {target[0]},{target[1]}", "BG AB")
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
        self._stage = "empty"
        with self._guarded(axes):
            axes.stop()
            return axes.positions()

    def abort(self) -> None:
        """Stop at once and switch the motors off; raise where this is not confirmed."""
        self._confirm(self._axes("abort").abort)

    def _axes(
        self, caller: str, *, powered: bool = False, homed: bool = False, standing: bool = False
    ) -> Axes:
        """Return the connected axes; refuse a call that is out of order."""
        if self._connection is None:
            raise NotReady(f"{caller}: not connected; call connect() first")
        if powered and not self._powered:
            raise NotReady(f"{caller}: the motors are off; enter powered() first")
        if homed and not self._homed:
            raise NotReady(f"{caller}: the joints' positions are unknown; call home() first")
        if standing and self._stage == "running":
            raise NotReady(f"{caller}: a press is running; call wait() or stop() first")
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
        self._stage = "empty"
        try:
            switch_off()
        except RobotError as error:
            error.aftermath = _NOT_SAFE.format(reason="see above")
            raise
        self._powered = False

    def _make_safe(self, error: BaseException, switch_off: Callable[[], None]) -> None:
        """Switch off, and put the outcome into an error that is on its way."""
        try:
            switch_off()
            outcome = _SAFE
        except RobotError as fault:
            outcome = _NOT_SAFE.format(reason=fault.args[0])
        if isinstance(error, RobotError):
            error.aftermath = outcome
        else:
            error.add_note(outcome)
