"""The interface of every motion controller, and the data that it takes and returns."""

from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np

from sautereau.rig.capabilities import Capabilities
from sautereau.rig.registry import CONTROLLERS
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Counts, Segments


@dataclass(frozen=True)
class TorqueTable:
    """Torques that are added to those of the position loops."""

    time: Floats
    """s from the start of motion, increasing; shape (n,)."""
    torques: Floats
    """N m, of both joints; shape (n, 2)."""


@dataclass(frozen=True)
class Capture:
    """The record of one motion, on the controller's clock."""

    samples: Counts
    """Controller samples since the motion started, negative before it; shape (n,)."""
    counts: Counts
    """Counts, absolute joint positions; shape (n, 2)."""
    sample_period: float
    """s, of one controller sample."""
    following_errors: Counts | None = None
    """Counts, target minus measured positions; shape (n, 2). None where the controller does not
    record them."""
    torques: Floats | None = None
    """N m, commanded to the amplifiers; shape (n, 2). None as above."""
    trigger_delay: float = 0.0
    """s, from the trigger's edge at the acquisition to the start of the motion; 0 without one."""
    start_std: float = 0.0
    """s, standard uncertainty of the motion's start: of that delay, or of a streamed motion."""

    def __len__(self) -> int:
        return len(self.samples)

    @property
    def times(self) -> Floats:
        """s, since the motion started; shape (n,)."""
        return self.samples.astype(np.float64) * self.sample_period


class Player(Protocol):
    """What a `MotionController` and the `Driver` of a `PoweredArm` have in common."""

    def arm(self) -> None:
        """Prepare capture, trigger and start."""

    def start(self) -> None:
        """Start the motion and return at once."""

    def wait(self) -> None:
        """Wait until the motion has ended, and verify that it ended as it should."""

    def capture(self) -> Capture:
        """Read what was recorded of the last complete motion."""
        ...

    def positions(self) -> Counts:
        """Read the joint positions: counts, shape (2,)."""
        ...

    def abort(self) -> None:
        """Stop at once, switch motors and trigger off, and verify by reading back.

        Raises:
            RobotError: The controller did not confirm that the motors are off.
        """


class MotionController(Player, Protocol):
    """Two joints that play a loaded motion.

    A controller that stores motions plays them by itself: it sets the trigger output, starts
    the motion `Capture.trigger_delay` after that edge and records the encoders, and the host's
    timing does not matter. To one that stores none the host streams the motion, and the times
    of a press are the host's. `capabilities` says which it is.

    Calls of a press: ``connect``, ``powered``, ``home``, ``move_to`` its start, ``load``,
    ``arm``, ``start``, ``wait``, ``capture``. The controller is a context manager for the
    connection. Every call raises `RobotError`, and `NotReady` where it is out of order.
    `sautereau.robot.drivers.powered_arm.PoweredArm` implements it for a small `Driver`.
    """

    @property
    def capabilities(self) -> Capabilities:
        """What it can do; also before it is connected."""
        ...

    @property
    def identity(self) -> str:
        """Model and firmware, as the controller reports them."""
        ...

    @property
    def simulated(self) -> bool:
        """Whether the controller identifies itself as a stand-in."""
        ...

    def connect(self) -> str:
        """Open the connection, switch off, set the limits, and return the identity."""
        ...

    def disconnect(self) -> None:
        """Switch off what is on, and close the connection; never hides an earlier error."""

    def powered(self) -> AbstractContextManager[Self]:
        """Switch the motors on; leaving the block in any way stops them and switches them off."""
        ...

    def home(self) -> Counts:
        """Find home, as `capabilities` says; return its joint positions (counts, (2,))."""
        ...

    def move_to(self, counts: Counts, speed_counts_per_s: float) -> Counts:
        """Move both joints from point to point, and wait until they have settled there.

        Args:
            counts: Counts, absolute target of each joint; shape (2,).
            speed_counts_per_s: Counts per second, largest of either joint; lowered to the next
                that the controller takes.

        Returns:
            Counts, target as it was sent; shape (2,).
        """
        ...

    def load(self, segments: Segments, torque: TorqueTable | None = None) -> Segments:
        """Load a motion; return what was really sent.

        Args:
            torque: Joint torques over time that the controller adds to those of its position
                loops, from the start of motion on; None for none.

        Raises:
            UnsafeRequest: The limits or the `capabilities` forbid it; nothing was sent.
        """
        ...

    def check_home(self) -> None:
        """Check that the home switches are where they were found.

        The arm moves to either side of them, `controller.home_tolerance` away. Without switches
        nothing is checked.

        Raises:
            MotionFault: An encoder has slipped, or a switch has moved; the motors are off.
        """

    def stop(self) -> Counts:
        """Decelerate to a standstill, motors on; return the positions (counts, shape (2,))."""
        ...

    def request_abort(self) -> None:
        """Have the present motion end by an abort, as soon as its controller is asked again.

        Any thread may call it. What waits for the motion raises `MotionFault`, with the motors
        off; without a motion nothing happens before the next one.
        """

    def __enter__(self) -> Self: ...
    def __exit__(self, *exception: object) -> None: ...


def play(controller: MotionController, motion: Segments) -> None:
    """Make a motion; nothing listens to its trigger."""
    controller.load(motion)
    controller.arm()
    controller.start()
    controller.wait()


def motion_controller(rig: Rig) -> MotionController:
    """Return the controller of a rig, not yet connected.

    Raises:
        RigError: No installed package provides `controller.kind`, or importing it failed.
    """
    return CONTROLLERS.get(rig.controller.kind)(rig)
