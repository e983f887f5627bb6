"""The interface of a driver for one kind of controller, and how drivers wait for it."""

import logging
from collections.abc import Callable
from typing import ClassVar, Protocol

from sautereau.rig.capabilities import Capabilities
from sautereau.rig.schema import Rig
from sautereau.robot.controller import Player, TorqueTable
from sautereau.robot.drivers.limits import Limits
from sautereau.robot.drivers.serial_port import Port
from sautereau.robot.errors import MotionFault, SettingChanged
from sautereau.trajectory.segments import Counts, Segments

Clock = Callable[[], float]  # Returns seconds from any origin
Sleep = Callable[[float], None]  # Waits for seconds
_LOG = logging.getLogger(__name__)


class Driver(Player, Protocol):
    """One connection to a controller, which sends the commands that `PoweredArm` decides on.

    It is made from an open port, and `set_up` is called first. `PoweredArm` checks the order of
    the calls, the arm's limits and the start position of a motion, and aborts after a failure. A
    method therefore only does its work and raises `RobotError`. Positions are encoder counts,
    speeds counts per second, both of joints 1 and 2, shape (2,).
    """

    CAPABILITIES: ClassVar[Capabilities]
    """Its capabilities, on which depend the torques of `load` and the calls of `home_levels`."""
    WITHOUT_HOST: ClassVar[str]
    """Sentence on what the controller does without its host, with the period {period:g} s."""
    ABORT_AFTER: ClassVar[frozenset[str]]
    """Those of `home_levels` and `arm` that switch or move a motor: a failure in them aborts."""

    def __init__(self, rig: Rig, port: Port, clock: Clock, sleep: Sleep, /) -> None:
        """Hold the port; nothing is sent."""

    def set_up(self) -> str:
        """Identify the controller, switch off and set its limits; return its identity."""
        ...

    def close(self) -> None:
        """Close the port; a port that has gone away counts as closed."""

    def switch_on(self) -> None:
        """Start the watchdog, switch the motors on, and verify both."""

    def renew(self, keep_waiting: Callable[[], bool] | None = None, /) -> None:
        """Renew the watchdog, from the keep-alive's thread.

        Args:
            keep_waiting: Returns whether to continue to wait for an answer; None for one
                timeout only.
        """

    def check_ready(self, what: str, /) -> None:
        """Check, before each motion, that the controller is as this driver left it.

        The motors are on, its own program runs, and limits and gains are those that were set, as
        far as the controller can be asked: another program may use it as well.

        Args:
            what: The motion, for messages.

        Raises:
            RobotError: It is not; nothing has moved.
        """

    def halt(self) -> None:
        """Decelerate to a standstill, motors on."""

    def send_abort(self) -> None:
        """Send what `abort` sends, to a controller that does not answer; never fail."""

    def find_home(self, home: Counts) -> None:
        """Find the home switches, and set the positions there."""

    def home_levels(self) -> list[float]:
        """Return for each joint 0 at its home switch and below, 1 above."""
        ...

    def go(self, target: Counts, speed: float) -> None:
        """Move to a target, and wait until the joints have settled there."""

    def plan(self, segments: Segments, torque: TorqueTable | None) -> None:
        """Work out what `load` will send; the motion is within the arm's limits.

        Raises:
            UnsafeRequest: The controller cannot play it; the motion loaded before stays.
        """

    def load(self) -> Segments:
        """Load the planned motion; return the motion as it was sent."""
        ...


def refuse_changes(controller: str, read: Callable[[], list[str]]) -> None:
    """Refuse settings that have changed since they were set.

    A bit that flips on the line looks like a changed setting, once: what differs is read again,
    and a difference that the second reading does not find is a warning.

    Args:
        controller: Port of the controller, for the message.
        read: Reads all settings; returns a text for each that differs.

    Raises:
        SettingChanged: Two readings found differences; names those of the second.
    """
    if first := read():
        if second := read():
            raise SettingChanged(controller, second)
        _LOG.warning(
            "controller on %s: %s when read once, and as set when read again; the line may be"
            " disturbed: check its cable",
            controller,
            "; ".join(first),
        )


SETTLING = 1.0  # s that a joint may take to come within tolerance after a motion
MARGIN = 10.0  # s that a motion may last longer than planned before it counts as stuck
STOPPING = 5.0  # s, longest that a decelerated stop may take
POLL = 0.01  # s between two questions


class Polling:
    """The clock of a connection, and waiting by it.

    Args:
        clock: Seconds, of any origin.
        sleep: Wait for seconds.
        supply: What powers the motors, for messages.
        delay: s before the first question, in which a command takes effect.
    """

    def __init__(self, clock: Clock, sleep: Sleep, supply: str, delay: float = 0.0):
        self.clock, self.sleep = clock, sleep
        self._supply, self._delay = supply, delay

    def until(self, ended: Callable[[], bool], what: str, limit: float) -> None:
        """Ask ``ended`` until it is true, for ``limit`` seconds at most.

        Raises:
            MotionFault: It is not true within the limit; ``what`` names the motion.
        """
        if self._delay:
            self.sleep(self._delay)
        deadline = self.clock() + limit
        while not ended():
            if self.clock() > deadline:
                raise MotionFault(
                    f"{what} has not ended after {limit:.3g} s; check that the arm moves"
                    f" freely, its switches and the {self._supply}"
                )
            self.sleep(POLL)

    def settle(self, positions: Callable[[], Counts], target: Counts, limits: Limits) -> None:
        """Wait until both joints are at ``target`` (counts, shape (2,)).

        Raises:
            MotionFault: They are not within `SETTLING` seconds.
        """
        deadline = self.clock() + SETTLING
        while off := limits.off_target(positions(), target):
            if self.clock() > deadline:
                raise MotionFault(f"{SETTLING:g} s after the motion {off}")
            self.sleep(POLL)
