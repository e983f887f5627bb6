"""Geometry and forces of the reduced engine, one press at a time; compiled."""

import math

from sautereau.rig.section import GRAVITY
from sautereau.sim_backend.physics.reduced.compile import compiled, inlined
from sautereau.sim_backend.physics.reduced.state import (
    ARM,
    BORDER,
    CELL,
    CLEARANCE,
    CUBICS,
    DAMPED,
    DAMPER,
    DIP,
    DRY,
    FELT,
    FELT_DAMPING,
    FELT_STIFFNESS,
    FIRST,
    FRICTION,
    HANGS,
    HEAVINESS,
    HEIGHT,
    HELD,
    INERTIA,
    JACK,
    LIFT,
    LINKAGE,
    LOAD,
    MASS,
    PASSING,
    PERIOD,
    PRESSED,
    RISE_END,
    SLIP,
    SLOPE,
    SPEED_END,
    STANDS,
    START,
    STRETCH,
    STRING,
    TONGUE_FORCE,
    TONGUE_STIFFNESS,
    TOUCH,
    VISCOUS,
)


@inlined
def foot(arm, height, angle):
    """Return the key's rise [m] under a jack and its slopes by the angle [m/rad, m/rad^2]."""
    half = math.sin(angle / 2)
    sine, versine = 2 * half * math.cos(angle / 2), 2 * half * half
    secant = 1 / (1 - versine)
    rise = (arm * sine + height * versine) * secant
    slope = (arm + height * sine) * secant**2
    curve = (2 * arm * sine + height * (1 + sine * sine)) * secant**3
    return rise, slope, curve


@compiled
def fingertip(leg, time):
    """Return the key under an ideal finger: angle, speed, acceleration, and the force's arm [m].

    The angle is no number where the fingertip is so near the pin that no key touches it.
    """
    period = leg[PERIOD]
    u = (time - leg[START]) / period
    q1, d1, s1 = joint(leg, CUBICS, u, period)
    q2, d2, s2 = joint(leg, CUBICS + 4, u, period)
    q2, d2, s2 = q1 + q2, d1 + d2, s1 + s2
    upper, lower, height = leg[LINKAGE + 2], leg[LINKAGE + 3], leg[LINKAGE + 4]
    ux, uz = upper * math.cos(q1), upper * math.sin(q1)
    lx, lz = lower * math.cos(q2), lower * math.sin(q2)
    x, z = leg[LINKAGE] + ux + lx, leg[LINKAGE + 1] + uz + lz
    squared = x * x + z * z - height * height
    if not squared > 0:
        return math.nan, math.nan, math.nan, math.nan
    angle = math.atan2(-x, z) - math.atan2(math.sqrt(squared), height)
    sine, cosine = math.sin(angle), math.cos(angle)
    reach = x * cosine + z * sine
    vx, vz = -uz * d1 - lz * d2, ux * d1 + lx * d2
    ax = -ux * d1 * d1 - uz * s1 - lx * d2 * d2 - lz * s2
    az = -uz * d1 * d1 + ux * s1 - lz * d2 * d2 + lx * s2
    spin = (vz * cosine - vx * sine) / reach
    along = vx * cosine + vz * sine
    acceleration = (az * cosine - ax * sine - 2 * spin * along - spin * spin * height) / reach
    return angle, spin, acceleration, -reach


@compiled
def joint(leg, at, u, period):
    """Return angle, speed and acceleration of a joint by its cubic, which begins in a place."""
    c1, c2, c3 = leg[at + 1], leg[at + 2], leg[at + 3]
    angle = leg[at] + u * (c1 + u * (c2 + u * c3))
    speed = (c1 + u * (2 * c2 + u * 3 * c3)) / period
    return angle, speed, (2 * c2 + 6 * c3 * u) / (period * period)


@compiled
def string_force(bench, cells, kinds, k, rise):
    """Return the force [N] of a string on its jack, downwards."""
    kind = kinds[k, STRING]
    if kind == HELD:
        return pluck_force(bench, cells, kinds, k, rise - bench[k, CLEARANCE])
    if kind == PASSING:
        drop = bench[k, CLEARANCE] - rise
        return -(bench[k, TONGUE_FORCE] + bench[k, TONGUE_STIFFNESS] * drop)
    return 0.0


@compiled
def pluck_force(bench, cells, kinds, k, height):
    """Return S(h) [N]; beyond its stretch the law goes on straight, for steps that are tried."""
    stretch = kinds[k, STRETCH]
    first, last = int(bench[k, FIRST + stretch]), int(bench[k, FIRST + stretch + 1]) - 1
    low, high = bench[k, BORDER + stretch], bench[k, BORDER + stretch + 1]
    within = min(max(height, low), high)
    cell = min(max(kinds[k, CELL], first), last)
    while cell < last and within >= cells[cell + 1, 0]:
        cell += 1
    while cell > first and within < cells[cell, 0]:
        cell -= 1
    kinds[k, CELL] = cell
    u = within - cells[cell, 0]
    c1, c2, c3 = cells[cell, 2], cells[cell, 3], cells[cell, 4]
    force = cells[cell, 1] + u * (c1 + u * (c2 + u * c3))
    if within != height:
        force += (height - within) * (c1 + u * (2 * c2 + u * 3 * c3))
    return force


@compiled
def burden(bench, cells, kinds, k, rise):
    """Return weight, string and damper of a jack together [N], downwards."""
    load = bench[k, MASS] * GRAVITY + string_force(bench, cells, kinds, k, rise)
    if kinds[k, DAMPED]:
        load -= bench[k, DAMPER] * (bench[k, LIFT] - rise)
    return load


@compiled
def felt_push(bench, angle, spin):
    """Return what the felt's spring and damper give [N m], pushing or not."""
    return bench[0, FELT_STIFFNESS] * (angle - bench[0, DIP]) + bench[0, FELT_DAMPING] * spin


@inlined
def key_motion(bench, cells, state, kinds, push, angle, spin, led):
    """Return the key's acceleration and the moment [N m] of an ideal finger that leads it.

    What follows for the jacks on it, their place and load, is noted in the end of the step.

    Args:
        bench: The press.
        state: Its mode counts.
        push: N m, of a push.
        angle: rad.
        spin: rad/s.
        led: rad/s^2, acceleration with which an ideal finger leads it, where one does.
    """
    slip = kinds[0, SLIP]
    inertia = bench[0, INERTIA]
    moment = push + bench[0, HEAVINESS] - bench[0, VISCOUS] * spin - slip * bench[0, DRY]
    if kinds[0, FELT] == PRESSED:
        moment -= felt_push(bench, angle, spin)
    for k in range(1, len(bench)):
        if kinds[k, JACK] == STANDS:
            rise, slope, curve = foot(bench[k, ARM], bench[0, HEIGHT], angle)
            mass = bench[k, MASS]
            load = mass * curve * spin * spin + slip * bench[k, FRICTION]
            load += burden(bench, cells, kinds, k, rise)
            inertia += mass * slope * slope
            moment -= slope * load
            state[k, RISE_END], state[k, SPEED_END] = rise, slope * spin
            state[k, LOAD], state[k, SLOPE] = load, slope
    acceleration = moment / inertia if slip != 0 else 0.0
    finger = 0.0
    if kinds[0, TOUCH]:
        acceleration = led
        finger = inertia * led - moment
    for k in range(1, len(bench)):
        if kinds[k, JACK] == STANDS:
            state[k, LOAD] += bench[k, MASS] * state[k, SLOPE] * acceleration
    return acceleration, finger


@compiled
def jack_acceleration(bench, cells, kinds, k, rise):
    """Return the acceleration [m/s^2] of a jack off the key."""
    kind = kinds[k, JACK]
    if kind == HANGS:
        return 0.0
    pull = burden(bench, cells, kinds, k, rise) + kind * bench[k, FRICTION]
    return -pull / bench[k, MASS]
