"""A coordinate in the leap-frog scheme."""


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

    def correct(self, back: float) -> None:
        """Undo the part of the last impulse that acted for a time too long."""
        self.speed -= self.acceleration * back

    def at(self, time: float, ahead: float) -> float:
        """Return it after a time; `ahead` is that by half of which the speed is advanced."""
        speed = self.speed - self.acceleration * ahead / 2
        return self.value + (speed + self.acceleration * time / 2) * time

    def advance(self, speed: float, step: float) -> float:
        """End a step with a new speed; return the mean of the old and the new speed."""
        before, self.speed = self.speed, speed
        self.value, self.acceleration = self.next, (speed - before) / step
        return (before + speed) / 2

    def advance_to_event(self, speed: float, drift: float, ahead: float, impact: bool) -> None:
        """End a drift to an event, with the speed of the step after it.

        Half of the impulse is by the forces before the event, extrapolated to it.

        Args:
            speed: Half of the next step ahead.
            drift: Time to the event.
            ahead: Length of the next step.
            impact: Whether the speed jumps at the event.
        """
        grown = 2 * (speed - self.speed) - self.acceleration * drift
        self.value, self.speed = self.next, speed
        self.acceleration = 0.0 if impact else grown / ahead
