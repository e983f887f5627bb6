"""A coordinate of the key beside its angle, in the leap-frog scheme."""

from collections.abc import Callable


class Coordinate:
    """A coordinate whose speed is that half a step ahead of it; at rest at 0 unless it is advanced.

    Angles are in rad, lengths in mm, times in ms.
    """

    fixed = True
    """Whether no body moves in it."""

    def __init__(self):
        self.value = self.next = self.node = 0.0
        """At the start and at the end of a step; and its rate at the end."""
        self.speed = self.acceleration = 0.0

    def drift(self, step: float) -> None:
        """Compute the end of a step."""
        self.next = self.value + self.speed * step
        self.node = self.speed + self.acceleration * step / 2

    def correct_and_drift(self, back: float, drift: float) -> None:
        """Undo the surplus of the last impulse and compute the state after a drift."""
        self.speed -= self.acceleration * back
        self.drift(drift)

    def at(self, time: float, ahead: float) -> float:
        """Return it after a time; `ahead` is that by half of which the speed is advanced."""
        speed = self.speed - self.acceleration * ahead / 2
        return self.value + (speed + self.acceleration * time / 2) * time

    def advance(self, speed: float, grown: Callable[[float], float]) -> float:
        """Take the step and its new speed; return the mean of both speeds.

        Args:
            speed: After the step.
            grown: Acceleration by the growth of the speed.
        """
        before, self.speed = self.speed, speed
        self.value, self.acceleration = self.next, grown(speed - before)
        return (before + speed) / 2
