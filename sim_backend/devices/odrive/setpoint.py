"""The setpoints of an axis: by the filter, by the trapezoidal planner, and within a sample."""

import math
from dataclasses import dataclass

from sautereau.sim_backend.devices.emulators import Cubic, hermite


@dataclass(frozen=True)
class Setpoint:
    """Position and velocity that an axis should have."""

    position: float
    velocity: float


def filtered(
    now: Setpoint, goal: Setpoint, bandwidth: float, elapsed: float
) -> tuple[Setpoint, bool]:
    """Follow a constant input by the critically damped filter of second order.

    x'' = b^2 (u - x) + 2 b (w - x'), solved exactly.

    Args:
        now: The setpoint.
        goal: The input, u and w.
        bandwidth: b [1/s].
        elapsed: s.

    Returns:
        The setpoint after that time, and whether it has reached its limit.
    """
    rest = goal.position + 2 * goal.velocity / bandwidth
    away = now.position - rest
    drive = now.velocity + bandwidth * away
    fall = math.exp(-bandwidth * elapsed)
    position = rest + (away + drive * elapsed) * fall
    velocity = (now.velocity - bandwidth * drive * elapsed) * fall
    if abs(position - rest) < 1e-9 and abs(velocity) < 1e-7:
        return Setpoint(rest, 0.0), True
    return Setpoint(position, velocity), False


def between(before: Setpoint, after: Setpoint, scale: float, zero: float, period: float) -> Cubic:
    """Return the cubic from one setpoint to that a sample later, in encoder counts.

    Args:
        before: At the sample's start.
        after: At its end.
        scale: Encoder counts per unit of the setpoints.
        zero: Encoder counts at position 0.
        period: s, of the sample.
    """
    step = (after.position - before.position) * scale
    v0, v1 = before.velocity * scale * period, after.velocity * scale * period
    return hermite(zero + before.position * scale, step, v0, v1)


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
