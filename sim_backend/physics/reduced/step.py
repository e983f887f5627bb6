"""Runge-Kutta steps of order 4 within one mode; compiled."""

from sautereau.sim_backend.physics.reduced import state as ix
from sautereau.sim_backend.physics.reduced.compile import compiled
from sautereau.sim_backend.physics.reduced.forces import (
    fingertip,
    jack_acceleration,
    key_motion,
)

SLOWEST = 1e-3
"""rad/s and m/s, least reference speed of a relative error."""


@compiled
def try_step(bench, cells, state, modes, segment, time, step):
    """Compute a trial step; return its relative error estimate.

    Simpson's rule over the accelerations is of order 3, and differs from the step only by the
    last two of them.
    """
    error = 0.0
    push = segment[ix.PUSH]
    angle, omega, first = (
        state[0, ix.ANGLE],
        state[0, ix.ANGULAR_VELOCITY],
        state[0, ix.ANGULAR_ACCELERATION],
    )
    if modes[0, ix.TOUCH]:
        angle, omega, prescribed, _ = fingertip(segment, time + step)
        last, finger = key_motion(bench, cells, state, modes, push, angle, omega, prescribed)
    elif modes[0, ix.SLIP] == 0:
        last, finger = key_motion(bench, cells, state, modes, push, angle, 0.0, 0.0)
    else:
        half = step / 2
        omega2 = omega + half * first
        second, _ = key_motion(bench, cells, state, modes, push, angle + half * omega, omega2, 0.0)
        omega3 = omega + half * second
        third, _ = key_motion(bench, cells, state, modes, push, angle + half * omega2, omega3, 0.0)
        omega4 = omega + step * third
        fourth, _ = key_motion(bench, cells, state, modes, push, angle + step * omega3, omega4, 0.0)
        angle += step / 6 * (omega + 2 * omega2 + 2 * omega3 + omega4)
        end = omega + step / 6 * (first + 2 * second + 2 * third + fourth)
        last, finger = key_motion(bench, cells, state, modes, push, angle, end, 0.0)
        error = step_error(step, omega, end, first, fourth, last)
        omega = end
    state[0, ix.ANGLE_END], state[0, ix.ANGULAR_VELOCITY_END] = angle, omega
    state[0, ix.ANGULAR_ACCELERATION_END], state[0, ix.FINGER_END] = last, finger
    for k in range(1, len(bench)):
        if modes[k, ix.JACK] != ix.STANDS:
            error = max(error, try_jack(bench, cells, state, modes, k, step))
    return error


@compiled
def try_jack(bench, cells, state, modes, k, step):
    """Compute a trial step of a jack off the key; see `try_step`."""
    rise, speed, first = state[k, ix.RISE], state[k, ix.SPEED], state[k, ix.ACCELERATION]
    if modes[k, ix.JACK] == ix.HANGS:
        state[k, ix.RISE_END], state[k, ix.SPEED_END], state[k, ix.ACCELERATION_END] = (
            rise,
            0.0,
            0.0,
        )
        return 0.0
    half = step / 2
    speed2 = speed + half * first
    second = jack_acceleration(bench, cells, modes, k, rise + half * speed)
    speed3 = speed + half * second
    third = jack_acceleration(bench, cells, modes, k, rise + half * speed2)
    speed4 = speed + step * third
    fourth = jack_acceleration(bench, cells, modes, k, rise + step * speed3)
    rise += step / 6 * (speed + 2 * speed2 + 2 * speed3 + speed4)
    end = speed + step / 6 * (first + 2 * second + 2 * third + fourth)
    last = jack_acceleration(bench, cells, modes, k, rise)
    state[k, ix.RISE_END], state[k, ix.SPEED_END], state[k, ix.ACCELERATION_END] = rise, end, last
    return step_error(step, speed, end, first, fourth, last)


@compiled
def step_error(step, speed, end, first, fourth, last):
    """Return the error estimate of a speed, relative to the largest speed of the step."""
    largest = max(abs(speed), abs(end), step * max(abs(first), abs(last)), SLOWEST)
    return step / 6 * abs(last - fourth) / largest


@compiled
def accept_step(state):
    """Accept the trial step."""
    for j in range(4):
        state[0, j] = state[0, ix.ANGLE_END + j]
    for k in range(1, len(state)):
        state[k, ix.RISE], state[k, ix.SPEED] = state[k, ix.RISE_END], state[k, ix.SPEED_END]
        state[k, ix.ACCELERATION] = state[k, ix.ACCELERATION_END]
