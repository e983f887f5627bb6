"""Setpoints of an axis, the filter that smooths them, and their course within a sample."""

import math
from dataclasses import dataclass

from sautereau.sim_backend.devices.emulators import Cubic


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
    start = zero + before.position * scale
    return (start, v0, 3 * step - 2 * v0 - v1, v0 + v1 - 2 * step)
