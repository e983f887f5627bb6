"""The jack's law of motion in a press: a constant speed, or a recorded gesture."""

from dataclasses import dataclass

import numpy as np

from sautereau.rig.schema import Gesture, Press
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.jerk import (
    JerkLaw,
    chained,
    falling,
    jerk_law,
    length,
    ramp,
    rest_to_rest,
    reversed_law,
    spline_law,
)

STILL = 1e-9
"""m, least range of a gesture."""


@dataclass(frozen=True)
class PressLaw:
    """The law of a complete press, and the starts of its parts; times in s from the start."""

    law: JerkLaw
    start: float
    """End of the rest on the key."""
    cruise_start: float
    """Of a gesture, its start."""
    cruise_end: float
    """Of a gesture, its end."""
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
    up = ramp(speed, press.run_up_acceleration, press.run_up_jerk)
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
