"""Steps of any even order within a mode, and the time at which the mode ends; compiled.

The modified midpoint rule with 2, 4, 6, ... substeps has an error in even powers of the substep.
Extrapolation to zero (Gragg, Bulirsch and Stoer; Hairer, Norsett and Wanner, Solving ODEs I, II.9)
removes one of them per row.
"""

import math

from sautereau.sim_backend.physics.base import LARGEST_ANGLE
from sautereau.sim_backend.physics.exact import structures as ix
from sautereau.sim_backend.physics.exact.compile import compiled, inlined
from sautereau.sim_backend.physics.exact.forces import accelerate, felt_push, surface

ANGLE, RISE, RATE, SPEED, FORCE = 1e-15, 1e-16, 1e-13, 1e-14, 1e-12
"""rad, m, rad/s, m/s and fraction of the weights: by which a guard is violated at an event."""
SLOWEST = 1e-3
"""rad/s and m/s, least reference speed of a relative error."""
TRIALS, SAME = 100, 1e-16
"""Most iterations of a location, and the relative difference of times that counts as zero."""


@compiled
def try_step(press, start, time, step, order):
    """Set the state after a step within the mode; return its relative error.

    Args:
        press: Its state is replaced.
        start: Positions, speeds and accelerations at the start; shape (3, n).
        time: s, at the start.
        step: s.
        order: 2, 4, 6 or 8.
    """
    x, v, a, work, size = press.x, press.v, press.a, press.work, len(press.x)
    table_x, table_v = work[3:7], work[7:11]
    error = 0.0
    for j in range(order // 2):
        parts = 2 * (j + 1)
        h = step / parts
        old_x, old_v = work[11], work[12]
        for i in range(size):
            old_x[i], old_v[i] = start[0, i], start[1, i]
            x[i], v[i] = start[0, i] + h * start[1, i], start[1, i] + h * start[2, i]
        for m in range(1, parts):
            accelerate(press, time + m * h)
            for i in range(size):
                next_x, next_v = old_x[i] + 2 * h * v[i], old_v[i] + 2 * h * a[i]
                old_x[i], old_v[i], x[i], v[i] = x[i], v[i], next_x, next_v
        for i in range(size):
            # The row's entries replace those of the row before, from the left.
            for k in range(j + 1):
                before_x, before_v = table_x[k, i], table_v[k, i]
                table_x[k, i], table_v[k, i] = x[i], v[i]
                if k < j:
                    ratio = parts / (parts - 2 * (k + 1))
                    factor = 1 / (ratio * ratio - 1)
                    x[i] += (x[i] - before_x) * factor
                    v[i] += (v[i] - before_v) * factor
            if j == order // 2 - 1 and j > 0:
                scale = max(abs(v[i]), abs(start[1, i]), step * abs(start[2, i]), SLOWEST)
                error = max(error, abs(v[i] - table_v[j - 1, i]) / scale)
    accelerate(press, time + step)
    return error


@inlined
def hold_tip(press, time):
    """Move a servo's fingertip onto a key at rest, whose angle stays."""
    finger, mode, n = press.finger, press.mode, len(press.jacks) + 1
    if mode.touch and mode.slip == 0 and finger.compliance > 0.0:
        for j in range(2):
            by = finger.by[j] / finger.compliance
            press.x[n + j] -= by * (finger.angle - press.x[0])
            press.v[n + j] -= by * finger.speed
        accelerate(press, time)


@inlined
def guard(press):
    """Return the least guard of the mode, negative where the mode has ended.

    Every guard is an inequality that holds in the mode, over its natural scale and with its
    tolerance added.
    """
    key, finger, mode, x, v = press.key, press.finger, press.mode, press.x, press.v
    angle, omega, weights = x[0], v[0], abs(key.gravity_moment) + key.dry
    least = math.inf
    for k in range(len(press.jacks)):
        jack, choir, rise = press.jacks[k], press.choirs[k], x[k + 1]
        weight = 10.0 * jack.mass + jack.friction
        weights += weight * jack.arm
        if not choir.stands:
            over, _, _ = surface(jack.arm, key.height, angle)
            least = min(least, (rise - over + RISE) * 1e3)
            if choir.sign != 0:
                least = min(least, (choir.sign * v[k + 1] + SPEED) * 1e2)
        elif mode.slip != 0:
            least = min(least, choir.load / weight + FORCE)
        least = min(least, (rise - choir.low + RISE) * 1e3, (choir.high - rise + RISE) * 1e3)
    least = min(least, LARGEST_ANGLE - angle)
    if mode.slip != 0:
        least = min(least, (mode.slip * omega + RATE) * 10.0)
        if mode.slip < 0:
            least = min(least, (angle + ANGLE) * 1e2)
    elif finger.compliance > 0.0:
        least = min(least, mode.up / weights + FORCE)
        if angle > ix.CLOSE:  # not on the rail
            least = min(least, mode.down / weights + FORCE)
    if mode.touch:
        if mode.slip != 0 or finger.compliance > 0.0:
            least = min(least, mode.moment / weights + FORCE)
    elif finger.kind != ix.PUSH:
        least = min(least, (angle - finger.angle + ANGLE) * 1e2)
    if press.arm.pad_stiffness > 0.0:
        side = 1.0 if mode.pad == ix.PRESSED else -1.0
        if mode.pad == ix.OFF:
            least = min(least, (RISE - finger.overlap) * 1e3)
        else:
            least = min(least, (finger.overlap + RISE) * 1e3, side * finger.push / weights + FORCE)
    if mode.felt == ix.OFF:
        return min(least, (key.dip - angle + ANGLE) * 1e2)
    push = felt_push(key, angle, omega) * (1.0 if mode.felt == ix.PRESSED else -1.0)
    return min(least, (angle - key.dip + ANGLE) * 1e2, push / weights + FORCE)


@compiled
def locate(press, start, time, step, order, at_low):
    """Return the time [s] into a step at which the mode ends, with the state there.

    The step violates a guard. Between a time at which none is violated and one at which one is,
    by inverse quadratic interpolation or bisection (Chandrupatla, 1997).

    Args:
        press: At the end of the step.
        start: As of `try_step`.
        time: s, at the start.
        step: s.
        order: Of the step.
        at_low: Least guard at the start.
    """
    low, high, other, at_other = 0.0, step, 0.0, math.inf
    at_high, middle = guard(press), step
    part = min(max(at_low / (at_low - at_high), 0.05), 0.95)
    for _ in range(TRIALS):
        if at_high > -0.1 * FORCE or high - low <= SAME * (time + high):
            break
        middle = low + part * (high - low)
        try_step(press, start, time, middle, order)
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
        try_step(press, start, time, high, order)
    return high
