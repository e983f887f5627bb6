"""The jack's law of motion in a press: a constant speed, or a recorded gesture.

A law has piecewise constant jerk and leads from rest to rest.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sautereau.rig.schema import Gesture, Press
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.motion import Floats, Motion

Phase = tuple[float, float]  # Duration [s] and constant jerk [m/s^3]

STILL = 1e-9  # m, least range of a gesture


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

    def phase(self, time: Floats) -> NDArray[np.intp]:
        """Return the index of the phase at times [s], the first or the last outside the law."""
        index = np.searchsorted(self.times, time, side="right") - 1
        return np.clip(index, 0, len(self.jerks) - 1)

    def at(self, time: Floats) -> Motion:
        """Return rise [m], speed and acceleration at times [s]; at rest outside the law."""
        inside = np.clip(time, 0.0, self.times[-1])
        index = self.phase(inside)
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
    return (x + v * t + a * t**2 / 2 + jerk * t**3 / 6, v + a * t + jerk * t**2 / 2, a + jerk * t)


@dataclass(frozen=True)
class PressLaw:
    """The law of a complete press, and the starts of its parts; times in s from the start."""

    law: JerkLaw
    start: float
    """End of the rest on the key."""
    cruise_start: float
    """For a gesture: its start."""
    cruise_end: float
    """For a gesture: its end."""
    bottom: float
    """End of the stroke: the jack is at its full rise."""
    return_start: float
    steady: bool = True
    """Whether the cruise has constant speed; False for a gesture."""


def press_law(press: Press) -> PressLaw:
    """Return the jack's law: rest, run-up, exact cruise, run-down, hold, return to rest.

    A gesture takes the place of everything between the two rests.

    Raises:
        TrajectoryError: Run-up and run-down leave no room for a cruise, or the gesture does not
            move.
    """
    if press.gesture is not None:
        return _gesture_law(press, press.gesture)
    speed, rise = press.jack_speed, press.jack_rise
    up = ramp(speed, *press.run_up)
    down = ramp(speed, press.run_down_acceleration, press.run_down_jerk)
    run_up, run_down = length(up), length(down)
    cruise = rise / speed - (run_up + run_down) / 2
    if cruise <= 0:
        raise TrajectoryError(
            f"press.jack_speed: at {speed:.4g} m/s the run-up takes"
            f" {run_up * speed / 2 * 1e3:.3g} mm and the run-down"
            f" {run_down * speed / 2 * 1e3:.3g} mm of the rise of {rise * 1e3:.4g} mm,"
            " which leaves no cruise; lower jack_speed, or raise run_up_acceleration,"
            " run_up_jerk, run_down_acceleration or run_down_jerk"
        )
    stroke = jerk_law([(press.settle, 0.0), *up, (cruise, 0.0), *falling(down)])
    return PressLaw(
        law=chained([stroke, _rest(press.bottom_hold), _return(press, rise)]),
        start=press.settle,
        cruise_start=press.settle + run_up,
        cruise_end=press.settle + run_up + cruise,
        bottom=stroke.duration,
        return_start=stroke.duration + press.bottom_hold,
    )


def approach_law(press: Press) -> JerkLaw:
    """Return the law of the approach [m], from the hover height down to contact."""
    limits = press.approach_speed, press.return_acceleration, press.run_down_jerk
    return jerk_law(rest_to_rest(press.hover, *limits))


def _gesture_law(press: Press, gesture: Gesture) -> PressLaw:
    """Replay a recorded gesture: the cubic spline through its samples, at rest at its ends."""
    if max(gesture.rise) - min(gesture.rise) < STILL:
        raise TrajectoryError(
            f"press.gesture: it moves the jack by less than {STILL * 1e9:.3g} nm;"
            " check the column and the unit of the file"
        )
    time, rise = np.array(gesture.time), np.array(gesture.rise)
    played = spline_law(time - time[0], rise - rise[0])
    end = float(played.states[-1, 0])
    parts = [_rest(press.settle), played, _rest(press.bottom_hold)]
    if end:
        back = _return(press, abs(end))
        parts.append(back if end > 0 else reversed_law(back))
    bottom = press.settle + played.duration
    return PressLaw(
        law=chained(parts),
        start=press.settle,
        cruise_start=press.settle,
        cruise_end=bottom,
        bottom=bottom,
        return_start=bottom + press.bottom_hold,
        steady=False,
    )


def _rest(duration: float) -> JerkLaw:
    return jerk_law([(duration, 0.0)])


def _return(press: Press, rise: float) -> JerkLaw:
    limits = press.return_speed, press.return_acceleration, press.run_down_jerk
    return reversed_law(jerk_law(rest_to_rest(rise, *limits)))
