"""Wait for a controller by asking it repeatedly, up to a limit."""

from collections.abc import Callable

from sautereau.robot.drivers.driver import Clock, Sleep
from sautereau.robot.drivers.limits import Limits
from sautereau.robot.errors import MotionFault
from sautereau.trajectory.segments import Counts

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
