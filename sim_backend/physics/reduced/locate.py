"""Where within a step of the reduced engine something ends; compiled."""

from sautereau.sim_backend.physics.reduced.compile import compiled
from sautereau.sim_backend.physics.reduced.forces import (
    felt_push,
    fingertip,
    foot,
)
from sautereau.sim_backend.physics.reduced.state import (
    AFTER,
    ANGLE_END,
    ARM,
    BEFORE,
    BROKEN,
    DIP,
    FELT,
    FINGER_END,
    HANGS,
    HEIGHT,
    HIGH,
    IDEAL,
    JACK,
    LOAD,
    LOW,
    MASS,
    OFF,
    OTHER,
    PRESSED,
    RISE_END,
    SLIP,
    SPEED_END,
    SPIN_END,
    STANDS,
    TOUCH,
)
from sautereau.sim_backend.physics.reduced.step import (
    try_step,
)

TURNED = 1.2
"""rad, at which a key has left its place; the jacks' closed form ends at pi / 2."""
OVER_ANGLE, OVER_SPIN, OVER_FORCE = 1e-15, 1e-12, 1e-12
"""rad, rad/s and of the weights: how far beyond its end a step may end."""
OVER_RISE, OVER_SPEED = 1e-16, 1e-13
"""m and m/s, of jacks."""
ROUNDED = 2e-17
"""m, by which a jack that has just left the key may be in it."""
TRIALS, SAME = 80, 1e-16
"""Steps in which an end is looked for, and the share of the time that is none."""


@compiled
def locate(bench, cells, state, kinds, marks, leg, time, step):
    """Return the part of a step [s] after which the first thing ends, and try that step.

    It is the earliest root of what is broken at the step's end, enclosed and found by inverse
    quadratic interpolation, and overstepped by no more than its tolerance.
    """
    low, high, other, latest = 0.0, step, -1.0, 0.0
    conditions = marks.shape[1]
    for j in range(conditions):
        marks[BROKEN, j] = marks[AFTER, j]
    try_step(bench, cells, state, kinds, leg, time, 0.0)
    hold(bench, state, kinds, leg, time, marks)
    for j in range(conditions):
        marks[BEFORE, j] = max(marks[AFTER, j], 0.0)
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
        if hold(bench, state, kinds, leg, time + part, marks):
            other, low = low, part
            for j in range(conditions):
                marks[OTHER, j], marks[BEFORE, j] = marks[BEFORE, j], marks[AFTER, j]
        else:
            other, high = high, part
            for j in range(conditions):
                marks[OTHER, j], marks[BROKEN, j] = marks[BROKEN, j], marks[AFTER, j]
    if latest != high:
        try_step(bench, cells, state, kinds, leg, time, high)
        hold(bench, state, kinds, leg, time + high, marks)
    return high


@compiled
def crossing(marks, j, low, high, other, beyond):
    """Return where a condition is as little below zero as is wanted, between low and high."""
    a, b, c = marks[BEFORE, j] + beyond, marks[BROKEN, j] + beyond, marks[OTHER, j] + beyond
    if not a > b:
        return high
    if a <= 2 * beyond:  # what begins at zero may well grow before it falls
        return (low + high) / 2
    if other >= 0.0 and c != a and c != b:
        guess = low * b * c / ((a - b) * (a - c)) + high * a * c / ((b - a) * (b - c))
        guess += other * a * b / ((c - a) * (c - b))
        if low < guess < high:
            return guess
    return min(low + (high - low) * a / (a - b), high)


@compiled
def hold(bench, state, kinds, leg, time, marks):
    """Note all that must be positive at the end of a step, and return whether it is."""
    angle, spin = state[0, ANGLE_END], state[0, SPIN_END]
    slip, felt = kinds[0, SLIP], kinds[0, FELT]
    marks[AFTER, 0] = slip * spin if slip != 0 else 1.0
    marks[AFTER, 1] = angle if slip < 0 else 1.0
    marks[AFTER, 2] = TURNED - angle
    marks[AFTER, 3] = 1.0
    if kinds[0, TOUCH]:
        marks[AFTER, 3] = state[0, FINGER_END] if slip != 0 else 1.0
    elif leg[IDEAL] > 0:
        under, _, _, _ = fingertip(leg, time)
        marks[AFTER, 3] = angle - under
    marks[AFTER, 4], marks[AFTER, 5] = bench[0, DIP] - angle, 1.0
    if felt != OFF:
        force = felt_push(bench, angle, spin)
        marks[AFTER, 4], marks[AFTER, 5] = -marks[AFTER, 4], force if felt == PRESSED else -force
    good = True
    for j in range(6):
        good = good and not marks[AFTER, j] < 0.0
    for k in range(1, len(bench)):
        at = 2 + 4 * k
        rise, speed, kind = state[k, RISE_END], state[k, SPEED_END], kinds[k, JACK]
        marks[AFTER, at + 1] = 1.0
        if kind == STANDS:
            marks[AFTER, at] = state[k, LOAD] if slip != 0 else 1.0
        else:
            under, _, _ = foot(bench[k, ARM], bench[0, HEIGHT], angle)
            marks[AFTER, at] = rise - under + ROUNDED
            if kind != HANGS:
                marks[AFTER, at + 1] = kind * speed
        marks[AFTER, at + 2] = rise - state[k, LOW]
        marks[AFTER, at + 3] = state[k, HIGH] - rise
        for j in range(at, at + 4):
            good = good and not marks[AFTER, j] < 0.0
    return good


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
