"""Kinematics and forces of one press in the reduced engine; compiled."""

import math

from sautereau.rig.section import GRAVITY
from sautereau.sim_backend.physics.reduced import state as ix
from sautereau.sim_backend.physics.reduced.compile import compiled, inlined


@inlined
def jack_kinematics(arm, height, angle):
    """Return the key's rise [m] under a jack and its derivatives [m/rad, m/rad^2]."""
    half = math.sin(angle / 2)
    sine, versine = 2 * half * math.cos(angle / 2), 2 * half * half
    secant = 1 / (1 - versine)
    rise = (arm * sine + height * versine) * secant
    slope = (arm + height * sine) * secant**2
    curvature = (2 * arm * sine + height * (1 + sine * sine)) * secant**3
    return rise, slope, curvature


@compiled
def fingertip(segment, time):
    """Return the key under an ideal finger: angle, its two derivatives, and the force's arm [m].

    The angle is NaN if the fingertip is so close to the pin that no angle gives a contact.
    """
    period = segment[ix.PERIOD]
    u = (time - segment[ix.START]) / period
    q1, d1, s1 = joint(segment, ix.CUBICS, u, period)
    q2, d2, s2 = joint(segment, ix.CUBICS + 4, u, period)
    q2, d2, s2 = q1 + q2, d1 + d2, s1 + s2
    upper, lower, height = segment[ix.LINKAGE + 2], segment[ix.LINKAGE + 3], segment[ix.LINKAGE + 4]
    ux, uz = upper * math.cos(q1), upper * math.sin(q1)
    lx, lz = lower * math.cos(q2), lower * math.sin(q2)
    x, z = segment[ix.LINKAGE] + ux + lx, segment[ix.LINKAGE + 1] + uz + lz
    squared = x * x + z * z - height * height
    if not squared > 0:
        return math.nan, math.nan, math.nan, math.nan
    angle = math.atan2(-x, z) - math.atan2(math.sqrt(squared), height)
    sine, cosine = math.sin(angle), math.cos(angle)
    reach = x * cosine + z * sine
    vx, vz = -uz * d1 - lz * d2, ux * d1 + lx * d2
    ax = -ux * d1 * d1 - uz * s1 - lx * d2 * d2 - lz * s2
    az = -uz * d1 * d1 + ux * s1 - lz * d2 * d2 + lx * s2
    omega = (vz * cosine - vx * sine) / reach
    along = vx * cosine + vz * sine
    acceleration = (az * cosine - ax * sine - 2 * omega * along - omega * omega * height) / reach
    return angle, omega, acceleration, -reach


@compiled
def joint(segment, at, u, period):
    """Return angle, velocity and acceleration of a joint by the cubic that starts at index `at`."""
    c1, c2, c3 = segment[at + 1], segment[at + 2], segment[at + 3]
    angle = segment[at] + u * (c1 + u * (c2 + u * c3))
    speed = (c1 + u * (2 * c2 + u * 3 * c3)) / period
    return angle, speed, (2 * c2 + 6 * c3 * u) / (period * period)


@compiled
def string_force(bench, cells, modes, k, rise):
    """Return the force [N] of a string on its jack, downwards."""
    mode = modes[k, ix.STRING]
    if mode == ix.HELD:
        return pluck_force(bench, cells, modes, k, rise - bench[k, ix.CLEARANCE])
    if mode == ix.PASSING:
        drop = bench[k, ix.CLEARANCE] - rise
        return -(bench[k, ix.TONGUE_FORCE] + bench[k, ix.TONGUE_STIFFNESS] * drop)
    return 0.0


@compiled
def pluck_force(bench, cells, modes, k, height):
    """Return S(h) [N]; beyond its piece the law continues linearly, for trial steps."""
    stretch = modes[k, ix.STRETCH]
    first, last = int(bench[k, ix.FIRST + stretch]), int(bench[k, ix.FIRST + stretch + 1]) - 1
    low, high = bench[k, ix.BORDER + stretch], bench[k, ix.BORDER + stretch + 1]
    within = min(max(height, low), high)
    cell = min(max(modes[k, ix.CELL], first), last)
    while cell < last and within >= cells[cell + 1, 0]:
        cell += 1
    while cell > first and within < cells[cell, 0]:
        cell -= 1
    modes[k, ix.CELL] = cell
    u = within - cells[cell, 0]
    c1, c2, c3 = cells[cell, 2], cells[cell, 3], cells[cell, 4]
    force = cells[cell, 1] + u * (c1 + u * (c2 + u * c3))
    if within != height:
        force += (height - within) * (c1 + u * (2 * c2 + u * 3 * c3))
    return force


@compiled
def static_load(bench, cells, modes, k, rise):
    """Return the sum of weight, string and damper of a jack [N], downwards."""
    load = bench[k, ix.MASS] * GRAVITY + string_force(bench, cells, modes, k, rise)
    if modes[k, ix.DAMPED]:
        load -= bench[k, ix.DAMPER] * (bench[k, ix.LIFT] - rise)
    return load


@compiled
def felt_push(bench, angle, omega):
    """Return the moment of the felt's spring and damper [N m]; negative if it would pull."""
    return (
        bench[0, ix.FELT_STIFFNESS] * (angle - bench[0, ix.DIP]) + bench[0, ix.FELT_DAMPING] * omega
    )


@inlined
def key_motion(bench, cells, state, modes, push, angle, omega, prescribed):
    """Return the key's angular acceleration and the moment [N m] of an ideal finger.

    Rise, speed and load of the jacks on the key are stored in the state's end-of-step fields.

    Args:
        bench: Parameters of the press.
        state: Its end-of-step fields are set.
        push: N m, of a push.
        angle: rad.
        omega: rad/s.
        prescribed: rad/s^2, angular acceleration under an ideal finger in contact.
    """
    slip = modes[0, ix.SLIP]
    inertia = bench[0, ix.INERTIA]
    moment = (
        push + bench[0, ix.GRAVITY_MOMENT] - bench[0, ix.VISCOUS] * omega - slip * bench[0, ix.DRY]
    )
    if modes[0, ix.FELT] == ix.PRESSED:
        moment -= felt_push(bench, angle, omega)
    for k in range(1, len(bench)):
        if modes[k, ix.JACK] == ix.STANDS:
            rise, slope, curvature = jack_kinematics(bench[k, ix.ARM], bench[0, ix.HEIGHT], angle)
            mass = bench[k, ix.MASS]
            load = mass * curvature * omega * omega + slip * bench[k, ix.FRICTION]
            load += static_load(bench, cells, modes, k, rise)
            inertia += mass * slope * slope
            moment -= slope * load
            state[k, ix.RISE_END], state[k, ix.SPEED_END] = rise, slope * omega
            state[k, ix.LOAD], state[k, ix.SLOPE] = load, slope
    acceleration = moment / inertia if slip != 0 else 0.0
    finger = 0.0
    if modes[0, ix.TOUCH]:
        acceleration = prescribed
        finger = inertia * prescribed - moment
    for k in range(1, len(bench)):
        if modes[k, ix.JACK] == ix.STANDS:
            state[k, ix.LOAD] += bench[k, ix.MASS] * state[k, ix.SLOPE] * acceleration
    return acceleration, finger


@compiled
def jack_acceleration(bench, cells, modes, k, rise):
    """Return the acceleration [m/s^2] of a jack off the key."""
    mode = modes[k, ix.JACK]
    if mode == ix.HANGS:
        return 0.0
    pull = static_load(bench, cells, modes, k, rise) + mode * bench[k, ix.FRICTION]
    return -pull / bench[k, ix.MASS]
