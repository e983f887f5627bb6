"""The jack's law of motion: jerk-limited run-up and run-down around an exact cruise."""

import math
from dataclasses import dataclass

import numpy as np

from rig.schema import Press
from trajectory.errors import TrajectoryError
from trajectory.motion import Floats, Motion

Phase = tuple[float, float]
"""Duration [s] and constant jerk [m/s^3]."""


@dataclass(frozen=True)
class JerkLaw:
    """A motion from rest made of phases of constant jerk; build it with `jerk_law`."""

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
        """Return rise [m], speed and acceleration at times [s]; outside, the jack rests."""
        inside = np.clip(time, 0.0, self.times[-1])
        index = np.searchsorted(self.times, inside, side="right") - 1
        index = np.clip(index, 0, len(self.jerks) - 1)
        return Motion(
            *_advance(self.states[index].T, self.jerks[index], inside - self.times[index])
        )


def jerk_law(phases: list[Phase]) -> JerkLaw:
    """Chain phases of constant jerk from rest at zero."""
    times, states = [0.0], [(0.0, 0.0, 0.0)]
    for duration, jerk in phases:
        states.append(_advance(states[-1], jerk, duration))
        times.append(times[-1] + duration)
    return JerkLaw(np.array(times), np.array(states), np.array([jerk for _, jerk in phases]))


@dataclass(frozen=True)
class PressLaw:
    """The law of a whole press, and when its parts begin; times in s from the start."""

    law: JerkLaw
    cruise_start: float
    cruise_end: float
    bottom: float
    """End of the press: the jack stands at its full rise."""
    return_start: float

    @property
    def extrapolated_start(self) -> float:
        """s, when a jack always at cruise speed would have left its rest."""
        return self.cruise_start / 2


def press_law(press: Press) -> PressLaw:
    """Return the jack's law: run-up, exact cruise, run-down, hold, return to rest.

    Raises:
        TrajectoryError: Run-up and run-down leave no room for a cruise.
    """
    speed, rise = press.jack_speed, press.jack_rise
    up = _ramp(speed, press.run_up_acceleration, press.run_up_jerk)
    down = _ramp(speed, press.run_down_acceleration, press.run_down_jerk)
    run_up, run_down = _length(up), _length(down)
    cruise = rise / speed - (run_up + run_down) / 2
    if cruise <= 0:
        raise TrajectoryError(
            f"press.jack_speed: at {speed:.4g} m/s the run-up takes"
            f" {run_up * speed / 2 * 1e3:.3g} mm and the run-down"
            f" {run_down * speed / 2 * 1e3:.3g} mm of the rise of {rise * 1e3:.4g} mm,"
            " which leaves no cruise; lower jack_speed, or raise run_up_acceleration,"
            " run_up_jerk, run_down_acceleration or run_down_jerk"
        )
    back = _ramp(*_return_limits(press))
    cruise_back = rise / _return_limits(press)[0] - _length(back)
    phases = [*up, (cruise, 0.0), *_falling(down), (press.bottom_hold, 0.0)]
    phases += [*_falling(back), (max(cruise_back, 0.0), 0.0), *back]
    law = jerk_law(phases)
    bottom = run_up + cruise + run_down
    return PressLaw(law, run_up, run_up + cruise, bottom, bottom + press.bottom_hold)


def _return_limits(press: Press) -> tuple[float, float, float]:
    """Return the speed that the way back reaches, with its acceleration and jerk.

    A stroke of two equal ramps without cruise reaches the speed v of v T(v) = rise.
    """
    a, jerk, rise = press.return_acceleration, press.run_down_jerk, press.jack_rise
    reached = (rise**2 * jerk / 4) ** (1 / 3)
    if reached > a**2 / jerk:
        reached = (math.sqrt((a**2 / jerk) ** 2 + 4 * a * rise) - a**2 / jerk) / 2
    return min(press.return_speed, reached), a, jerk


def _ramp(speed: float, acceleration: float, jerk: float) -> list[Phase]:
    """Return the phases of the quickest jerk-limited change of speed from rest."""
    if speed > acceleration**2 / jerk:
        edge = acceleration / jerk
        return [(edge, jerk), (speed / acceleration - edge, 0.0), (edge, -jerk)]
    edge = math.sqrt(speed / jerk)
    return [(edge, jerk), (edge, -jerk)]


def _falling(phases: list[Phase]) -> list[Phase]:
    return [(duration, -jerk) for duration, jerk in phases]


def _length(phases: list[Phase]) -> float:
    return sum(duration for duration, _ in phases)


def _advance(state, jerk, t):
    """Return rise, speed and acceleration after a time t [s] at constant jerk."""
    x, v, a = state
    return (
        x + v * t + a * t**2 / 2 + jerk * t**3 / 6,
        v + a * t + jerk * t**2 / 2,
        a + jerk * t,
    )
