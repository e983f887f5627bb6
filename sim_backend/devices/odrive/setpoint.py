"""The planner of an ODrive's moves; any unit of length, s."""

import math

from sautereau.sim_backend.devices.setpoint import Setpoint


class Trapezoid:
    """A move from a setpoint to a goal, by the firmware's trapezoidal planner.

    Args:
        start: The setpoint at the start.
        goal: Position at the end, at rest.
        speed: Largest speed, positive.
        acceleration: Positive.
        deceleration: Positive.
    """

    def __init__(
        self, start: Setpoint, goal: float, speed: float, acceleration: float, deceleration: float
    ):
        first, way = start.velocity, goal - start.position
        stopping = first * abs(first) / (2 * deceleration)
        sign = math.copysign(1.0, way - stopping)
        top, falling_rate = sign * speed, sign * deceleration
        rate = sign * (acceleration if sign * first <= speed else -acceleration)
        rising, falling = (top - first) / rate, top / falling_rate
        cruise = (way - (rising * (top + first) + falling * top) / 2) / top
        if cruise < 0:  # it does not reach its speed
            squared = (2 * way + first**2 / rate) / (1 / rate + 1 / falling_rate)
            top, cruise = sign * math.sqrt(max(0.0, squared)), 0.0
            rising, falling = max(0.0, (top - first) / rate), top / falling_rate
        self._start, self._goal = start, goal
        self._acceleration, self._deceleration = rate, -falling_rate
        self._top, self._rising, self._cruise = top, rising, cruise
        self.duration = rising + cruise + falling
        """s."""

    def at(self, elapsed: float) -> Setpoint:
        """Return the setpoint ``elapsed`` s after the start."""
        if elapsed >= self.duration:
            return Setpoint(self._goal, 0.0)
        start, rising = self._start, self._rising
        if elapsed < rising:
            return Setpoint(
                start.position + elapsed * (start.velocity + self._acceleration * elapsed / 2),
                start.velocity + self._acceleration * elapsed,
            )
        if elapsed < rising + self._cruise:
            risen = start.position + rising * (start.velocity + self._top) / 2
            return Setpoint(risen + self._top * (elapsed - rising), self._top)
        left = self.duration - elapsed
        return Setpoint(self._goal + self._deceleration * left**2 / 2, -self._deceleration * left)
