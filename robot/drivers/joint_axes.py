"""The two motors behind a controller, as far as every driver treats them alike."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, Generic, TypeVar

import numpy as np

from sautereau.robot.drivers.wire import Wire
from sautereau.robot.errors import MotionFault
from sautereau.trajectory.segments import Counts

SETTLING = 1.0
"""s that a joint may take to come within tolerance after a motion."""
MARGIN = 10.0
"""s that a motion may last longer than it should before it counts as stuck."""
STOPPING = 5.0
"""s, longest that a decelerated stop may take."""
POLL = 0.01
"""s between two questions whether something has come about."""

WireT_co = TypeVar("WireT_co", bound=Wire, covariant=True)


class JointAxes(ABC, Generic[WireT_co]):
    """Motors of joints 1 and 2.

    Args:
        line: To the controller.
        clock: Seconds, of any origin.
        sleep: Wait for seconds.
    """

    _SUPPLY: ClassVar[str]
    """What gives the motors power, for messages."""

    def __init__(self, line: WireT_co, clock: Callable[[], float], sleep: Callable[[float], None]):
        self.line, self.clock, self.sleep = line, clock, sleep

    @abstractmethod
    def positions(self) -> Counts:
        """Read the encoders: counts, shape (2,)."""

    @abstractmethod
    def renew(self, patient: Callable[[], bool] | None = None, /) -> None:
        """Give the watchdog a sign of life; ``patient`` says whether to wait on for an answer."""

    @abstractmethod
    def abort(self) -> None:
        """Stop at once, switch motors and trigger off, and verify by reading back.

        Raises:
            RobotError: The controller did not confirm that the motors are off.
        """

    @abstractmethod
    def shout(self) -> None:
        """Say once more what `abort` says to a controller that does not answer."""

    def await_(self, ended: Callable[[], bool], what: str, patience: float) -> None:
        """Poll until ``ended``, ``patience`` seconds at most; ``what`` names the motion."""
        deadline = self.clock() + patience
        while not ended():
            if self.clock() > deadline:
                raise MotionFault(
                    f"{what} has not ended after {patience:.3g} s; check that the arm moves"
                    f" freely, its switches and the {self._SUPPLY}"
                )
            self.sleep(POLL)

    def settle(self, target: Counts, tolerance: int) -> None:
        """Wait until both joints are within ``tolerance`` counts of ``target`` (counts, (2,))."""
        deadline = self.clock() + SETTLING
        while np.abs((actual := self.positions()) - target).max() > tolerance:
            if self.clock() > deadline:
                raise MotionFault(
                    f"the joints stand at {actual[0]}, {actual[1]} counts, {SETTLING:g} s after"
                    f" a motion to {target[0]}, {target[1]} that may miss by {tolerance}; check"
                    " that the arm moves freely, and the gains of its position loops"
                )
            self.sleep(POLL)
