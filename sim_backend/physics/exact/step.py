"""Steps of any even order within a mode, and the time at which the mode ends; compiled.

The modified midpoint rule with 2, 4, 6, ... substeps has an error in even powers of the substep.
Extrapolation to zero (Gragg, Bulirsch and Stoer; Hairer, Norsett and Wanner, Solving ODEs I, II.9)
removes one of them per row.
"""

import math

from sautereau.sim_backend.physics import structures as ix
from sautereau.sim_backend.physics.exact.compile import compiled, expanded, inlined
from sautereau.sim_backend.physics.exact.forces import accelerate, felt_push, surface

ANGLE, RISE, RATE, SPEED, FORCE = 1e-15, 1e-16, 1e-13, 1e-14, 1e-12
"""rad, m, rad/s, m/s and fraction of the weights: by which a guard is violated at an event."""
TRIALS, SAME = 100, 1e-16
"""Most iterations of a location, and the relative difference of times that counts as zero."""


@compiled
def try_step(press, step):
    """Set the state a step [s] after the saved one, within the mode; return its relative error."""
    run, work, size = press.run, press.work, len(press.x)
    state, start, old, table = work[0:3], work[3:6], work[6:8], work[8:16]
    rows, error = run.order // 2, 0.0
    for j in range(rows):
        parts = 2 * (j + 1)
        h = step / parts
        for i in range(size):
            for c in range(2):  # positions, then speeds
                old[c, i], state[c, i] = start[c, i], start[c, i] + h * start[c + 1, i]
        for m in range(1, parts):
            accelerate(press, run.time + m * h)
            for i in range(size):
                for c in range(2):
                    following = old[c, i] + 2 * h * state[c + 1, i]
                    old[c, i], state[c, i] = state[c, i], following
        for i in range(size):
            extrapolate(state, table, j, i)
            if j == rows - 1 and j > 0:
                speed, first = state[1, i], start[1, i]
                # Reference speeds are at least 1e-3 rad/s or m/s.
                scale = max(abs(speed), abs(first), step * abs(start[2, i]), 1e-3)
                error = max(error, abs(speed - table[2 * j - 1, i]) / scale)
    accelerate(press, run.time + step)
    return error


@expanded
def extrapolate(state, table, j, i):
    """Extrapolate a coordinate, whose row of the table replaces the one before from the left."""
    for c in range(2):
        for k in range(j + 1):
            before = table[2 * k + c, i]
            table[2 * k + c, i] = state[c, i]
            if k < j:
                ratio = (j + 1) / (j - k)
                state[c, i] += (state[c, i] - before) / (ratio * ratio - 1)


@inlined
def hold_tip(press):
    """Move a servo's fingertip onto a key at rest, whose angle stays."""
    finger, n = press.finger, len(press.jacks) + 1
    if finger.touch and press.key.slip == 0 and finger.compliance > 0.0:
        for j in range(2):
            by = finger.by[j] / finger.compliance
            press.x[n + j] -= by * (finger.angle - press.x[0])
            press.v[n + j] -= by * finger.speed
        accelerate(press, press.run.time)


@inlined
def guard(press):
    """Return the least guard of the mode, negative where the mode has ended.

    Every guard is an inequality that holds in the mode, over its natural scale and with its
    tolerance added.
    """
    key, finger, angle, omega = press.key, press.finger, press.x[0], press.v[0]
    least, weights = ix.LARGEST_ANGLE - angle, abs(key.gravity_moment) + key.dry
    for k in range(len(press.jacks)):
        weight = 10.0 * press.jacks[k].mass + press.jacks[k].friction
        weights += weight * press.jacks[k].arm
        least = min(least, jack_guard(press, k, weight))
    if key.slip != 0:
        least = min(least, (key.slip * omega + RATE) * 10.0)
        if key.slip < 0:
            least = min(least, (angle + ANGLE) * 1e2)
    elif finger.compliance > 0.0:
        least = min(least, key.up / weights + FORCE)
        if angle > ix.CLOSE:  # not on the rail
            least = min(least, key.down / weights + FORCE)
    if finger.touch:
        if key.slip != 0 or finger.compliance > 0.0:
            least = min(least, finger.reaction / weights + FORCE)
    elif finger.kind != ix.PUSH:
        least = min(least, (angle - finger.angle + ANGLE) * 1e2)
    if finger.pad_stiffness > 0.0:
        push = finger.push / weights
        least = min(least, spring_guard(finger.pad, finger.overlap * 1e3, push, RISE * 1e3))
    push = felt_push(key, angle, omega) / weights
    return min(least, spring_guard(key.felt, (angle - key.dip) * 1e2, push, ANGLE * 1e2))


@expanded
def jack_guard(press, k, weight):
    """Return the least guard of a jack, its string and its damper; its force is over a weight."""
    key, jack, rise = press.key, press.jacks[k], press.x[k + 1]
    least = min((rise - jack.low + RISE) * 1e3, (jack.high - rise + RISE) * 1e3)
    if not jack.stands:
        over, _, _ = surface(jack.arm, key.height, press.x[0])
        least = min(least, (rise - over + RISE) * 1e3)
        if jack.sign != 0:
            least = min(least, (jack.sign * press.v[k + 1] + SPEED) * 1e2)
    elif key.slip != 0:
        least = min(least, jack.load / weight + FORCE)
    return least


@inlined
def spring_guard(state, overlap, push, tolerance):
    """Return the least guard of felt or pad, whose overlap has a tolerance."""
    if state == ix.OFF:
        return tolerance - overlap
    return min(overlap + tolerance, (push if state == ix.PRESSED else -push) + FORCE)


@compiled
def locate(press, step, at_low):
    """Return the time [s] into a step at which the mode ends, with the state there.

    The step violates a guard. Between a time at which none is violated and one at which one is,
    by inverse quadratic interpolation or bisection (Chandrupatla, 1997).

    Args:
        press: At the end of the step.
        step: s.
        at_low: Least guard at the start.
    """
    low, high, other, at_other = 0.0, step, 0.0, math.inf
    at_high, middle = guard(press), step
    part = min(max(at_low / (at_low - at_high), 0.05), 0.95)
    for _ in range(TRIALS):
        if at_high > -0.1 * FORCE or high - low <= SAME * (press.run.time + high):
            break
        middle = low + part * (high - low)
        try_step(press, middle)
        found = guard(press)
        if not found >= 0.0:
            other, at_other, high, at_high = high, at_high, middle, found
        else:
            other, at_other, low, at_low = low, at_low, middle, found
        part = 0.5
        # The end that was found last comes first in the formula.
        a, fa, b, fb = high, at_high, low, at_low
        if found >= 0.0:
            a, fa, b, fb = low, at_low, high, at_high
        if at_other < math.inf and at_other != fb and other != b:
            xi, phi = (a - b) / (other - b), (fa - fb) / (at_other - fb)
            if phi * phi < xi and (1 - phi) * (1 - phi) < 1 - xi:
                t = fa / (fb - fa) * at_other / (fb - at_other)
                t += (other - a) / (b - a) * fa / (at_other - fa) * fb / (at_other - fb)
                part = min(max(t if found >= 0.0 else 1 - t, 1e-9), 1 - 1e-9)
    if middle != high:
        try_step(press, high)
    return high
