"""What presses the key in a world, as others see it; and the finger of a scene without an arm."""

import math
from collections.abc import Callable
from typing import Protocol

from sautereau.sim_backend.parts import Push
from sautereau.trajectory.motion import Floats

Reference = Callable[[Floats], tuple[Floats, Floats]]
"""Fractions of the sample to counts and counts a sample, each (n, 2)."""


class Finger(Protocol):
    """What presses the key."""

    def joints(self) -> tuple[float, float]:
        """Return the joint angles [rad]."""
        ...

    def torques(self) -> tuple[float, float]:
        """Return the motors' torques [N m]."""
        ...

    @property
    def settled(self) -> bool:
        """Whether the arm stands where it was told to."""
        ...


class Driven(Finger, Protocol):
    """A finger as the rigid bodies' engine moves it; mm, g and ms."""

    moment: float
    """N mm, that it puts on the key without touching it."""
    stops: float
    """ms, into the controller sample, when that moment ends; inf for not in this one."""

    def begin(self, reference: Reference, powered: bool, time: float) -> bool:
        """Start a controller sample at a time [s]; return whether forces jump at its start."""
        ...

    def act(self, elapsed: float, angle: float, ahead: float, step: float, share: float) -> None:
        """Act on the bodies at the end of a step.

        Args:
            elapsed: ms, into the controller sample.
            angle: rad, of the key.
            ahead: ms, to the end of the next step.
            step: ms, that the engine takes.
            share: 1, of its forces that this step of the engine shall have.
        """
        ...

    def push(self, weight: float) -> float:
        """Return the force [N] on the key in the step just done.

        Args:
            weight: ms, for which the forces acted in it.
        """
        ...

    def closes(self, angle: float, step: float) -> bool:
        """Return whether a finger that is apart meets a key, at an angle [rad] after a step."""
        ...

    def gap(self, angle: float, time: float, ahead: float) -> float:
        """Return the gap [mm] to the key.

        Args:
            angle: rad, of the key then.
            time: ms, from the present place.
            ahead: ms, for half of which the last kick brought the speed forward.
        """
        ...

    def land(self, time: float) -> None:
        """Touch the key from a time [s] on."""
        ...

    def glide(self, back: float, drift: float) -> None:
        """Take back what the last kick gave too much, and find where a drift leads.

        Args:
            back: ms, by which the last forces acted too long.
            drift: ms.
        """
        ...

    def place(self, step: float) -> None:
        """Put bodies so that a step [ms] of the engine leads to where they shall be."""
        ...

    def rest(self, angle: float) -> tuple[float, float]:
        """End a controller sample with the key at an angle [rad].

        Returns:
            The angle at which the key touches the fingertip, or the angle itself; and the
            largest error [mm] of a joint or a contact.
        """
        ...


class StandingFinger:
    """A finger that does exactly what it is told to, by no motors."""

    def __init__(self, joints: tuple[float, float]):
        self._joints = joints

    def joints(self) -> tuple[float, float]:
        """Return the joint angles [rad]."""
        return self._joints

    def torques(self) -> tuple[float, float]:
        """Return zero: there are no motors."""
        return 0.0, 0.0

    @property
    def settled(self) -> bool:
        """True: it is always where it was told to be."""
        return True


class PlacelessFinger(StandingFinger):
    """A finger of which the engine moves no body, so that none can meet the key."""

    moment = 0.0
    stops = math.inf

    def closes(self, angle: float, step: float) -> bool:
        """Return False: there is no body that would meet the key."""
        return False

    def gap(self, angle: float, time: float, ahead: float) -> float:
        """Return infinity, for the same reason."""
        return math.inf

    def land(self, time: float) -> None:
        """Do nothing: it never comes to that."""

    def glide(self, back: float, drift: float) -> None:
        """Do nothing: there is no place."""

    def place(self, step: float) -> None:
        """Do nothing: there is no place."""


class PushFinger(PlacelessFinger):
    """A force on the key from the first instant on; the arm is not there, and stands still."""

    def __init__(self, push: Push, press_arm: float, start: tuple[float, float], period: float):
        super().__init__(start)
        self._push, self._period = push, period
        self._arm = press_arm

    def begin(self, reference: Reference, powered: bool, time: float) -> bool:
        """Start a controller sample; see `Driven`."""
        before, left = self.moment, self._push.duration - time
        on = powered and left > 1e-9 * self._period
        self.moment = self._push.force * self._arm * 1e3 if on else 0.0
        within = on and left < self._period * (1 - 1e-9)
        self.stops = left * 1e3 if within else math.inf
        return self.moment != before

    def act(self, elapsed: float, angle: float, ahead: float, step: float, share: float) -> None:
        """Do nothing: there is no body."""

    def push(self, weight: float) -> float:
        """Return the force [N] on the key."""
        return self.moment / self._arm / 1e3

    def rest(self, angle: float) -> tuple[float, float]:
        """Return the angle: there is no body."""
        return angle, 0.0
