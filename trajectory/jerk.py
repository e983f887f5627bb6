"""Motions from rest to rest with piecewise constant jerk."""

import math
from dataclasses import dataclass

import numpy as np

from sautereau.trajectory.motion import Floats, Motion

Phase = tuple[float, float]
"""Duration [s] and constant jerk [m/s^3]."""


@dataclass(frozen=True)
class JerkLaw:
    """A motion from rest with piecewise constant jerk; see `jerk_law` and `spline_law`."""

    times: Floats
    """s, start of each phase and end of the last; shape (n + 1,)."""
    states: Floats
    """Rise [m], speed [m/s], acceleration [m/s^2] at those times; shape (n + 1, 3)."""
    jerks: Floats
    """m/s^3, of each phase; shape (n,)."""

    @property
    def duration(self) -> float:
        """Length of the motion [s]."""
        return float(self.times[-1])

    def at(self, time: Floats) -> Motion:
        """Return rise [m], speed and acceleration at times [s]; at rest outside the law."""
        inside = np.clip(time, 0.0, self.times[-1])
        index = np.searchsorted(self.times, inside, side="right") - 1
        index = np.clip(index, 0, len(self.jerks) - 1)
        return Motion(
            *_advance(self.states[index].T, self.jerks[index], inside - self.times[index])
        )


def jerk_law(phases: list[Phase]) -> JerkLaw:
    """Return the law of consecutive phases, from rest at zero."""
    times, states = [0.0], [(0.0, 0.0, 0.0)]
    for duration, jerk in phases:
        states.append(_advance(states[-1], jerk, duration))
        times.append(times[-1] + duration)
    return JerkLaw(np.array(times), np.array(states), np.array([jerk for _, jerk in phases]))


def spline_law(time: Floats, rise: Floats) -> JerkLaw:
    """Return the cubic spline through rises [m] at times [s], at rest at its ends."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(time, rise, bc_type="clamped")
    states = np.stack([spline(time, order) for order in range(3)], -1)
    return JerkLaw(time, states, 6 * spline.c[0])


def chained(laws: list[JerkLaw]) -> JerkLaw:
    """Return laws in sequence; each continues from the final position of the previous one."""
    times, states, jerks = [np.zeros(1)], [], []
    end = np.zeros((1, 3))
    for law in laws:
        times.append(law.times[1:] + times[-1][-1])
        moved = law.states + np.array([end[0, 0], 0.0, 0.0])
        states.append(moved[:-1])
        end = moved[-1:]
        jerks.append(law.jerks)
    return JerkLaw(np.concatenate(times), np.concatenate([*states, end]), np.concatenate(jerks))


def reversed_law(law: JerkLaw) -> JerkLaw:
    """Return a law with its sign reversed: a rise becomes a fall."""
    return JerkLaw(law.times, -law.states, -law.jerks)


def rest_to_rest(distance: float, speed: float, acceleration: float, jerk: float) -> list[Phase]:
    """Return the phases of the fastest stroke of two equal ramps within the limits.

    Without a cruise the stroke reaches the speed v that solves v T(v) = distance.
    """
    edge = acceleration**2 / jerk
    reached = distance ** (2 / 3) * (jerk / 4) ** (1 / 3)
    if reached > edge:
        reached = (math.sqrt(edge**2 + 4 * acceleration * distance) - edge) / 2
    reached = min(speed, reached)
    ramp_up = ramp(reached, acceleration, jerk)
    cruise = max(distance / reached - length(ramp_up), 0.0)
    return [*ramp_up, (cruise, 0.0), *falling(ramp_up)]


def ramp(speed: float, acceleration: float, jerk: float) -> list[Phase]:
    """Return the phases of the fastest jerk-limited change of speed from rest."""
    if speed > acceleration**2 / jerk:
        edge = acceleration / jerk
        return [(edge, jerk), (speed / acceleration - edge, 0.0), (edge, -jerk)]
    edge = math.sqrt(speed / jerk)
    return [(edge, jerk), (edge, -jerk)]


def falling(phases: list[Phase]) -> list[Phase]:
    """Return the phases that reverse a change of speed."""
    return [(duration, -jerk) for duration, jerk in phases]


def length(phases: list[Phase]) -> float:
    """Return the duration of phases [s]."""
    return sum(duration for duration, _ in phases)


def _advance(state, jerk, t):
    """Return rise, speed and acceleration after a time t [s] at constant jerk."""
    x, v, a = state
    return (
        x + v * t + a * t**2 / 2 + jerk * t**3 / 6,
        v + a * t + jerk * t**2 / 2,
        a + jerk * t,
    )
