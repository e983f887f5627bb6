"""Forces and accelerations of a press in its present mode; compiled."""

import math

from sautereau.sim_backend.physics.exact import structures as ix
from sautereau.sim_backend.physics.exact.compile import inlined
from sautereau.sim_backend.physics.exact.fingertip import locate_tip


@inlined
def surface(arm, height, angle):
    """Return the key's rise [m] under a jack, b tan a + hb (1/cos a - 1), and its derivatives."""
    half = math.sin(angle / 2)
    sine, versine = 2 * half * math.cos(angle / 2), 2 * half * half
    secant = 1 / (1 - versine)
    rise = (arm * sine + height * versine) * secant
    slope = (arm + height * sine) * secant * secant
    curvature = (2 * arm * sine + height * (1 + sine * sine)) * secant * secant * secant
    return rise, slope, curvature


@inlined
def string_force(press, k, rise):
    """Return the force [N] of a string on its jack, downwards."""
    jack, choir = press.jacks[k], press.choirs[k]
    if choir.string == ix.HELD:
        return pluck_force(press.cells, jack, choir, rise - jack.clearance)
    if choir.string == ix.PASSING:
        return -(jack.tongue_force + jack.tongue_stiffness * (jack.clearance - rise))
    return 0.0


@inlined
def pluck_force(cells, jack, choir, height):
    """Return S(h) [N]; beyond its piece the law continues linearly, for trial steps."""
    first, last = jack.first[choir.piece], jack.first[choir.piece + 1] - 1
    within = min(max(height, jack.border[choir.piece]), jack.border[choir.piece + 1])
    cell = min(max(choir.cell, first), last)
    while cell < last and within >= cells[cell + 1, 0]:
        cell += 1
    while cell > first and within < cells[cell, 0]:
        cell -= 1
    choir.cell = cell
    u = within - cells[cell, 0]
    c1, c2, c3 = cells[cell, 2], cells[cell, 3], cells[cell, 4]
    force = cells[cell, 1] + u * (c1 + u * (c2 + u * c3))
    if within != height:
        force += (height - within) * (c1 + u * (2 * c2 + u * 3 * c3))
    return force


@inlined
def static_load(press, k, rise):
    """Return the sum of weight, string and damper of a jack [N], downwards."""
    jack = press.jacks[k]
    load = jack.mass * press.key.gravity + string_force(press, k, rise)
    if press.choirs[k].damped:
        load -= jack.damper * (jack.lift - rise)
    return load


@inlined
def felt_push(key, angle, omega):
    """Return the moment of the felt's spring and damper [N m]; negative if it would pull."""
    return key.felt_stiffness * (angle - key.dip) + key.felt_damping * omega


@inlined
def key_moment(press, angle, omega):
    """Return the moment on the key without dry friction, jacks and fingertip [N m]."""
    key = press.key
    moment = press.finger.moment + key.gravity_moment - key.viscous * omega
    if press.mode.felt == ix.PRESSED:
        moment -= felt_push(key, angle, omega)
    return moment


@inlined
def accelerate(press, time):
    """Set the accelerations, the moment of the finger, and the loads of the jacks on the key.

    The coordinates that depend on others in this mode are set: of a key on the finger, and of
    jacks that stand on the key.
    """
    key, finger, mode, x, v, a = press.key, press.finger, press.mode, press.x, press.v, press.a
    if finger.kind != ix.PUSH:
        locate_tip(press, time)
    if mode.slip == 0:
        v[0] = 0.0
    elif mode.touch:
        x[0], v[0] = finger.angle, finger.speed
    angle, omega, inertia = x[0], v[0], key.inertia
    moment = key_moment(press, angle, omega)
    least, most = moment - key.dry, moment + key.dry
    moment -= mode.slip * key.dry
    for k in range(len(press.jacks)):
        jack, choir, at = press.jacks[k], press.choirs[k], k + 1
        if choir.stands:
            rise, slope, curvature = surface(jack.arm, key.height, angle)
            x[at], v[at], a[at] = rise, slope * omega, curvature * omega * omega
            static = static_load(press, k, rise)
            load = jack.mass * a[at] + static + mode.slip * jack.friction
            choir.load, choir.slope = load, slope
            inertia += jack.mass * slope * slope
            moment -= slope * load
            least -= slope * (static + jack.friction)
            most -= slope * max(static - jack.friction, 0.0)
        elif choir.sign == 0:
            v[at] = a[at] = 0.0
        else:
            load = static_load(press, k, x[at]) + choir.sign * jack.friction
            a[at] = -load / jack.mass
    mode.moment = a[0] = 0.0
    if mode.slip == 0:
        if mode.touch and finger.compliance > 0.0:
            mode.moment = finger.acceleration / finger.compliance
        elif mode.touch:  # friction carries as much as it can, the finger the remainder
            mode.moment = max(0.0, -most)
        mode.up, mode.down = -(least + mode.moment), most + mode.moment
    elif mode.touch:
        pushed = inertia * finger.acceleration - moment
        mode.moment = pushed / (1 + finger.compliance * inertia)
        a[0] = finger.acceleration - finger.compliance * mode.moment
    else:
        a[0] = moment / inertia
    for k in range(len(press.jacks)):
        choir = press.choirs[k]
        if choir.stands:
            choir.load += press.jacks[k].mass * choir.slope * a[0]
            a[k + 1] += choir.slope * a[0]
    for j in range(len(x) - 1 - len(press.jacks)):
        a[len(x) - 2 + j] = finger.free[j] - finger.by[j] * mode.moment
