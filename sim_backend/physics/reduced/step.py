"""Steps of the reduced engine: Runge-Kutta's of order 4 while nothing changes; compiled."""

from sautereau.sim_backend.physics.reduced.compile import compiled
from sautereau.sim_backend.physics.reduced.forces import (
    fingertip,
    jack_acceleration,
    key_motion,
)
from sautereau.sim_backend.physics.reduced.state import (
    ACCELERATION,
    ACCELERATION_END,
    ANGLE,
    ANGLE_END,
    FINGER_END,
    HANGS,
    JACK,
    PUSH,
    RISE,
    RISE_END,
    SLIP,
    SPEED,
    SPEED_END,
    SPIN,
    SPIN_END,
    STANDS,
    TOUCH,
    TURN,
    TURN_END,
)

SLOWEST = 1e-3
"""rad/s and m/s, speed of which shares count at least."""


@compiled
def try_step(bench, cells, state, kinds, leg, time, step):
    """Step to the end of the state; return what order 4 brings to the speeds, over the largest.

    Simpson's rule over the accelerations is of order 3, and differs from the step by the last
    two of them alone.
    """
    error = 0.0
    push = leg[PUSH]
    angle, spin, first = state[0, ANGLE], state[0, SPIN], state[0, TURN]
    if kinds[0, TOUCH]:
        angle, spin, led, _ = fingertip(leg, time + step)
        last, finger = key_motion(bench, cells, state, kinds, push, angle, spin, led)
    elif kinds[0, SLIP] == 0:
        last, finger = key_motion(bench, cells, state, kinds, push, angle, 0.0, 0.0)
    else:
        half = step / 2
        spin2 = spin + half * first
        second, _ = key_motion(bench, cells, state, kinds, push, angle + half * spin, spin2, 0.0)
        spin3 = spin + half * second
        third, _ = key_motion(bench, cells, state, kinds, push, angle + half * spin2, spin3, 0.0)
        spin4 = spin + step * third
        fourth, _ = key_motion(bench, cells, state, kinds, push, angle + step * spin3, spin4, 0.0)
        angle += step / 6 * (spin + 2 * spin2 + 2 * spin3 + spin4)
        end = spin + step / 6 * (first + 2 * second + 2 * third + fourth)
        last, finger = key_motion(bench, cells, state, kinds, push, angle, end, 0.0)
        error = unresolved(step, spin, end, first, fourth, last)
        spin = end
    state[0, ANGLE_END], state[0, SPIN_END] = angle, spin
    state[0, TURN_END], state[0, FINGER_END] = last, finger
    for k in range(1, len(bench)):
        if kinds[k, JACK] != STANDS:
            error = max(error, try_jack(bench, cells, state, kinds, k, step))
    return error


@compiled
def try_jack(bench, cells, state, kinds, k, step):
    """Step a jack off the key; return as `try_step` does."""
    rise, speed, first = state[k, RISE], state[k, SPEED], state[k, ACCELERATION]
    if kinds[k, JACK] == HANGS:
        state[k, RISE_END], state[k, SPEED_END], state[k, ACCELERATION_END] = rise, 0.0, 0.0
        return 0.0
    half = step / 2
    speed2 = speed + half * first
    second = jack_acceleration(bench, cells, kinds, k, rise + half * speed)
    speed3 = speed + half * second
    third = jack_acceleration(bench, cells, kinds, k, rise + half * speed2)
    speed4 = speed + step * third
    fourth = jack_acceleration(bench, cells, kinds, k, rise + step * speed3)
    rise += step / 6 * (speed + 2 * speed2 + 2 * speed3 + speed4)
    end = speed + step / 6 * (first + 2 * second + 2 * third + fourth)
    last = jack_acceleration(bench, cells, kinds, k, rise)
    state[k, RISE_END], state[k, SPEED_END], state[k, ACCELERATION_END] = rise, end, last
    return unresolved(step, speed, end, first, fourth, last)


@compiled
def unresolved(step, speed, end, first, fourth, last):
    """Return what order 4 brings to a speed, over the largest speed of the step."""
    largest = max(abs(speed), abs(end), step * max(abs(first), abs(last)), SLOWEST)
    return step / 6 * abs(last - fourth) / largest


@compiled
def take(state):
    """Go to the end of the step that was tried."""
    for j in range(4):
        state[0, j] = state[0, ANGLE_END + j]
    for k in range(1, len(state)):
        state[k, RISE], state[k, SPEED] = state[k, RISE_END], state[k, SPEED_END]
        state[k, ACCELERATION] = state[k, ACCELERATION_END]
