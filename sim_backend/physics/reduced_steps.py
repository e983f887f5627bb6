"""Steps of the reduced engine: Runge-Kutta's of order 4 while nothing changes; compiled.

All that a mode of motion needs is a number that must stay positive. A step at whose end one
is negative is taken again and ends where the first of them vanishes.
"""

import math

from sim_backend.physics.reduced_compile import compiled
from sim_backend.physics.reduced_forces import (
    felt_push,
    fingertip,
    foot,
    jack_acceleration,
    key_motion,
)
from sim_backend.physics.reduced_state import (
    ACCELERATION,
    ACCELERATION_END,
    AFTER,
    ANGLE,
    ANGLE_END,
    ARM,
    BEFORE,
    BROKEN,
    CHATTERS,
    DIP,
    FALLS,
    FELT,
    FINE,
    FINGER_END,
    HANGS,
    HEIGHT,
    HIGH,
    IDEAL,
    JACK,
    LOAD,
    LOST,
    LOW,
    MASS,
    OFF,
    OTHER,
    PRESSED,
    PUSH,
    RISE,
    RISE_END,
    RISES,
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
from sim_backend.physics.reduced_switch import switch

RESOLVED, RATED, LEAST = 3e-6, 1e-3, 1e-13
"""1 and s, share of a speed that the fourth order may bring to a step of so long; it goes with
the step's fourth power, not below the last. What has more of it is divided."""
SLOWEST = 1e-3
"""rad/s and m/s, speed of which shares count at least."""
SHORTEST = 1e-8
"""s, of a step that is divided."""
SWITCHES = 400
"""Changes within one stretch of time that are no motion any more."""
TURNED = 1.2
"""rad, at which a key has left its place; the jacks' closed form ends at pi / 2."""
OVER_ANGLE, OVER_SPIN, OVER_FORCE = 1e-15, 1e-12, 1e-12
"""rad, rad/s and of the weights: how far beyond its end a step may end."""
OVER_RISE, OVER_SPEED = 1e-16, 1e-13
"""m and m/s, of jacks."""
TRIALS, SAME = 80, 1e-16
"""Steps in which an end is looked for, and the share of the time that is none."""


@compiled
def advance(bench, cells, state, kinds, marks, events, leg, time, end):
    """Advance a state within a leg from a time to another [s]; return how that went."""
    size = end - time
    allowed = max(RESOLVED * (size / RATED) ** 4, LEAST)
    switches = 0
    while time < end:
        if at_rest(kinds, leg):
            return FINE
        step = min(size, end - time)
        error = try_step(bench, cells, state, kinds, leg, time, step) / allowed
        if error > 1.0 and step > SHORTEST:
            size = max(step * max(0.8 * error**-0.25, 0.1), SHORTEST)
            continue
        if hold(bench, state, kinds, leg, time + step, marks, AFTER):
            take(state)
            time = end if step == end - time else time + step
            size = step * min(2.0, 0.8 * max(error, 1e-3) ** -0.25)
            if not math.isfinite(state[0, ANGLE] + state[0, SPIN]):
                return LOST
            continue
        time += locate(bench, cells, state, kinds, marks, leg, time, step)
        take(state)
        status = switch(bench, cells, state, kinds, marks, events, leg, time)
        if status != FINE:
            return status
        size = end - time
        switches += 1
        if switches > SWITCHES:
            return CHATTERS
    return FINE


@compiled
def at_rest(kinds, leg):
    """Return whether nothing moves until the leg ends."""
    if kinds[0, SLIP] != 0 or (leg[IDEAL] > 0 and kinds[0, TOUCH] == 0):
        return False
    for k in range(1, len(kinds)):
        if kinds[k, JACK] == FALLS or kinds[k, JACK] == RISES:
            return False
    return True


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
def hold(bench, state, kinds, leg, time, marks, row):
    """Note all that must be positive at the end of a step, and return whether it is."""
    angle, spin = state[0, ANGLE_END], state[0, SPIN_END]
    slip, felt = kinds[0, SLIP], kinds[0, FELT]
    marks[row, 0] = slip * spin if slip != 0 else 1.0
    marks[row, 1] = angle if slip < 0 else 1.0
    marks[row, 2] = TURNED - angle
    marks[row, 3] = 1.0
    if kinds[0, TOUCH]:
        marks[row, 3] = state[0, FINGER_END] if slip != 0 else 1.0
    elif leg[IDEAL] > 0:
        under, _, _, _ = fingertip(leg, time)
        marks[row, 3] = angle - under
    marks[row, 4], marks[row, 5] = bench[0, DIP] - angle, 1.0
    if felt != OFF:
        force = felt_push(bench, angle, spin)
        marks[row, 4], marks[row, 5] = -marks[row, 4], force if felt == PRESSED else -force
    good = True
    for j in range(6):
        good = good and not marks[row, j] < 0.0
    for k in range(1, len(bench)):
        at = 2 + 4 * k
        rise, speed, kind = state[k, RISE_END], state[k, SPEED_END], kinds[k, JACK]
        marks[row, at + 1] = 1.0
        if kind == STANDS:
            marks[row, at] = state[k, LOAD] if slip != 0 else 1.0
        else:
            under, _, _ = foot(bench[k, ARM], bench[0, HEIGHT], angle)
            marks[row, at] = rise - under
            if kind != HANGS:
                marks[row, at + 1] = kind * speed
        marks[row, at + 2] = rise - state[k, LOW]
        marks[row, at + 3] = state[k, HIGH] - rise
        for j in range(at, at + 4):
            good = good and not marks[row, j] < 0.0
    return good


@compiled
def take(state):
    """Go to the end of the step that was tried."""
    for j in range(4):
        state[0, j] = state[0, ANGLE_END + j]
    for k in range(1, len(state)):
        state[k, RISE], state[k, SPEED] = state[k, RISE_END], state[k, SPEED_END]
        state[k, ACCELERATION] = state[k, ACCELERATION_END]


@compiled
def locate(bench, cells, state, kinds, marks, leg, time, step):
    """Return the part of a step [s] after which the first thing ends, and try that step.

    It is the earliest root of what is broken at the step's end, enclosed and found by inverse
    quadratic interpolation, and overstepped by no more than its tolerance.
    """
    low, high, other, latest = 0.0, step, -1.0, 0.0
    marks[BROKEN, :] = marks[AFTER]
    try_step(bench, cells, state, kinds, leg, time, 0.0)
    hold(bench, state, kinds, leg, time, marks, BEFORE)
    conditions = marks.shape[1]
    for j in range(conditions):
        marks[BEFORE, j] = max(marks[BEFORE, j], 0.0)
    for trial in range(TRIALS):
        part, worst = high, 0.0
        for j in range(conditions):
            if marks[BROKEN, j] < 0.0:
                allowed = tolerance(bench, kinds, j)
                worst = max(worst, -marks[BROKEN, j] / allowed)
                part = min(part, crossing(marks, j, low, high, other, allowed / 2))
        if worst <= 1.0 or high - low <= SAME * (time + high):
            break
        if trial > TRIALS // 4 and trial % 2 == 0:
            part = (low + high) / 2
        latest = part
        try_step(bench, cells, state, kinds, leg, time, part)
        if hold(bench, state, kinds, leg, time + part, marks, AFTER):
            other, low = low, part
            for j in range(conditions):
                marks[OTHER, j], marks[BEFORE, j] = marks[BEFORE, j], marks[AFTER, j]
        else:
            other, high = high, part
            for j in range(conditions):
                marks[OTHER, j], marks[BROKEN, j] = marks[BROKEN, j], marks[AFTER, j]
    if latest != high:
        try_step(bench, cells, state, kinds, leg, time, high)
        hold(bench, state, kinds, leg, time + high, marks, AFTER)
    return high


@compiled
def crossing(marks, j, low, high, other, beyond):
    """Return where a condition is as little below zero as is wanted, between low and high."""
    a, b, c = marks[BEFORE, j] + beyond, marks[BROKEN, j] + beyond, marks[OTHER, j] + beyond
    if not a > b:
        return high
    if other >= 0.0 and c != a and c != b:
        guess = low * b * c / ((a - b) * (a - c)) + high * a * c / ((b - a) * (b - c))
        guess += other * a * b / ((c - a) * (c - b))
        if low < guess < high:
            return guess
    return min(low + (high - low) * a / (a - b), high)


@compiled
def tolerance(bench, kinds, j):
    """Return how far a number may be beyond zero where its step ends."""
    if j == 0:
        return OVER_SPIN
    if j < 3 or j == 4:
        return OVER_ANGLE
    weight = 0.0
    for k in range(1, len(bench)):
        weight += bench[k, MASS] * 10.0 * bench[k, ARM]
    if j == 5:
        return OVER_FORCE * weight
    if j == 3:
        return OVER_FORCE * weight if kinds[0, TOUCH] else OVER_ANGLE
    k, part = (j - 2) // 4, (j - 2) % 4
    if part == 0 and kinds[k, JACK] == STANDS:
        return OVER_FORCE * bench[k, MASS] * 10.0
    return OVER_SPEED if part == 1 else OVER_RISE
