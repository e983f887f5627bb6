"""What a motion controller must be able to do for a press, whoever made it."""

from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, Self

import numpy as np

from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Counts, Segments

if TYPE_CHECKING:
    from sautereau.robot.experiment.feedforward import TorqueTable


@dataclass(frozen=True)
class Capture:
    """What the controller recorded of one motion on its own clock."""

    samples: Counts
    """Controller samples since the capture and the motion began; shape (n,)."""
    counts: Counts
    """Counts, absolute joint positions; shape (n, 2)."""
    sample_period: float
    """s, of one controller sample."""
    following_errors: Counts | None = None
    """Counts, by which the joints are short of where they should be; shape (n, 2). None where
    the controller does not record them."""
    torques: Floats | None = None
    """N m, that the controller asked the amplifiers for; shape (n, 2). None as above."""

    def __len__(self) -> int:
        return len(self.samples)

    @property
    def times(self) -> Floats:
        """s, since the motion began; shape (n,)."""
        return self.samples.astype(np.float64) * self.sample_period


class MotionController(Protocol):
    """Two joints that play a loaded motion.

    A controller that keeps motions (`GalilController`) plays them by itself: it starts one,
    raises the trigger output in the same sample and records the encoders, and the host's
    timing does not matter. To one that keeps none the host streams the motion, and the times
    of a press are the host's (`OdriveController`).
    A press: ``connect``, ``powered``, ``home``, ``move_to`` its start, ``load``, ``arm``,
    ``start``, ``wait``, ``capture``. The controller itself is a context manager for the
    connection. Every call raises `RobotError`, `NotReady` where it is out of order.
    """

    @property
    def identity(self) -> str:
        """Model and firmware, as the controller says them."""
        ...

    @property
    def simulated(self) -> bool:
        """Whether the controller says of itself that it is a stand-in."""
        ...

    def connect(self) -> str:
        """Open the connection, set the limits, and return the identity."""
        ...

    def disconnect(self) -> None:
        """Switch off what is on, and close the connection; never hides an earlier error."""
        ...

    def powered(self) -> AbstractContextManager[Self]:
        """Switch the motors on; leaving, by whatever way, stops and switches them off."""
        ...

    def home(self) -> Counts:
        """Find the home switches; return the joint positions (counts, (2,)) set there."""
        ...

    def move_to(self, counts: Counts, speed_counts_per_s: float) -> Counts:
        """Move both joints from point to point, and wait until they stand there.

        Args:
            counts: Counts, absolute target of each joint; shape (2,).
            speed_counts_per_s: Counts a second, largest of either joint.

        Returns:
            Counts, target as it was sent; shape (2,).
        """
        ...

    def load(self, segments: Segments, torque: "TorqueTable | None" = None) -> Segments:
        """Load a motion; return what was really sent.

        Args:
            segments: The motion.
            torque: Joint torques over time that the controller adds to those of its position
                loops, from the start of motion on; None for none.
        """
        ...

    @property
    def loaded_torque(self) -> "TorqueTable | None":
        """The torques that the loaded motion takes, as the controller holds them; None for none."""
        ...

    def arm(self) -> None:
        """Prepare capture, trigger and start; refuse where the arm is not at the start."""
        ...

    def start(self) -> None:
        """Let the controller start the motion and return at once."""
        ...

    def wait(self) -> None:
        """Wait until the motion has ended, and verify that it ended as it should."""
        ...

    def capture(self) -> Capture:
        """Read what was recorded of the last whole motion."""
        ...

    def check_home(self) -> None:
        """Go back to the home switches, and refuse to go on if they are not where they were."""
        ...

    def positions(self) -> Counts:
        """Read the joint positions: counts, shape (2,)."""
        ...

    def stop(self) -> Counts:
        """Decelerate to a stand, motors on; return where (counts, shape (2,))."""
        ...

    def abort(self) -> None:
        """Stop at once and switch the motors off; raise where this is not confirmed."""
        ...

    def __enter__(self) -> Self: ...
    def __exit__(self, *exception: object) -> None: ...
