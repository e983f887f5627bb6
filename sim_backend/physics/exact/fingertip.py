"""The fingertip over the key: kinematics, the servo's arm and its position loops; compiled."""

import math

from sautereau.sim_backend.physics import structures as ix
from sautereau.sim_backend.physics.exact.compile import compiled, inlined


@inlined
def locate_tip(press, time):
    """Set the motion of a key under the fingertip: z cos a - x sin a = hf + r.

    With the joints q, a' = A q' and a'' = A q'' + bias. For a servo q'' = free - by F, where F is
    the moment on the key; for an ideal finger q is the reference, whatever the force. The angle is
    NaN if the fingertip is so close to the pin that no angle gives a contact. With a pad the key
    has its own angle, and the pad's moment is set. The friction is that of the mode.
    """
    finger = press.finger
    if finger.kind == ix.PUSH:
        finger.angle = -math.inf
        rub(press, press.key.slip, 1.0)
        return
    if finger.kind == ix.SERVO:
        n = len(press.jacks)
        q1, q2, d1, d2 = press.x[n + 1], press.x[n + 2], press.v[n + 1], press.v[n + 2]
        s1 = s2 = 0.0
    else:
        q1, d1, s1 = joint(press, 0, time)
        q2, d2, s2 = joint(press, 1, time)
    q12, d12 = q1 + q2, d1 + d2
    ux, uz = finger.upper * math.cos(q1), finger.upper * math.sin(q1)
    lx, lz = finger.lower * math.cos(q12), finger.lower * math.sin(q12)
    x, z = finger.base_x + ux + lx, finger.base_z + uz + lz
    squared = x * x + z * z - finger.height * finger.height
    if finger.pad_stiffness > 0.0:
        angle = press.x[0]
    elif squared > 0:
        angle = math.atan2(-x, z) - math.atan2(math.sqrt(squared), finger.height)
    else:
        finger.angle = math.nan
        return
    sine, cosine = math.sin(angle), math.cos(angle)
    reach = x * cosine + z * sine
    # Columns of the fingertip's Jacobian: (-uz - lz, ux + lx) and (-lz, lx).
    slope1 = ((uz + lz) * sine + (ux + lx) * cosine) / reach
    slope2 = (lz * sine + lx * cosine) / reach
    omega = slope1 * d1 + slope2 * d2
    along = (ux * d1 + lx * d12) * sine - (uz * d1 + lz * d12) * cosine
    inward = ux * d1 * d1 + lx * d12 * d12
    inward = inward * sine - (uz * d1 * d1 + lz * d12 * d12) * cosine
    bias = (inward - 2 * omega * along - omega * omega * finger.height) / reach
    finger.angle, finger.speed, finger.reach = angle, omega, -reach
    if finger.kind == ix.SERVO:
        slide2 = lx * sine - lz * cosine + finger.height - finger.surface
        slide1 = ux * sine - uz * cosine + slide2
        finger.turn[0], finger.turn[1] = slope1, slope2
        move_arm(press, q1, q2, d1, d2, slide1, slide2)
        s1, s2 = finger.free[0], finger.free[1]
    finger.acceleration = slope1 * s1 + slope2 * s2 + bias
    if finger.pad_stiffness > 0.0:  # a moment, which a rigid fingertip's contact never joins
        finger.overlap = finger.height - z * cosine + x * sine
        closing = finger.reach * (omega - press.v[0])
        push = finger.pad_stiffness * finger.overlap + finger.pad_damping * closing
        finger.push = push * finger.reach
        finger.force = max(0.0, push) if finger.overlap > 0.0 else 0.0
        finger.angle, finger.compliance = -math.inf, math.inf
    rub(press, press.key.slip, 1.0)


@inlined
def rub(press, side, part):
    """Set what a force does with the friction of a key that turns to a side, or a part of it."""
    finger, share, along = press.finger, side * press.finger.friction, 0.0
    finger.lever = finger.reach
    if share != 0.0:  # along the key, over the moment on it
        along = part * share / (finger.reach + share * finger.surface)
        finger.lever /= 1 - along * finger.surface
    finger.moment = finger.force * finger.lever
    if finger.kind == ix.SERVO:
        for j in range(2):
            finger.by[j] = finger.bare[j] - along * finger.aside[j]
        if finger.pad_stiffness == 0.0:
            finger.compliance = finger.turn[0] * finger.by[0] + finger.turn[1] * finger.by[1]


@compiled
def move_arm(press, q1, q2, d1, d2, slide1, slide2):
    """Set the joints' accelerations under the motors, and by moments; `slide` is along the key."""
    finger = press.finger
    slope1, slope2 = finger.turn[0], finger.turn[1]
    coupling, twist = finger.coupling * math.cos(q2), finger.coupling * math.sin(q2)
    m11 = finger.inertia1 + finger.inertia2 + 2 * coupling
    m12, m22 = finger.inertia2 + coupling, finger.inertia2 + finger.rotor2
    if finger.locked[0] or finger.locked[1]:
        m12 = 0.0
    weight = finger.weight2 * math.cos(q1 + q2)
    right1 = finger.torque[0] - finger.weight1 * math.cos(q1) - weight + twist * (2 * d1 + d2) * d2
    right2 = finger.torque[1] - weight - twist * d1 * d1
    if finger.locked[0]:
        right1 = slope1 = slide1 = 0.0
    if finger.locked[1]:
        right2 = slope2 = slide2 = 0.0
    size = m11 * m22 - m12 * m12
    finger.free[0] = (right1 * m22 - right2 * m12) / size
    finger.free[1] = (right2 * m11 - right1 * m12) / size
    finger.bare[0] = (slope1 * m22 - slope2 * m12) / size
    finger.bare[1] = (slope2 * m11 - slope1 * m12) / size
    if finger.friction != 0.0:
        slide1, slide2 = slide1 + slope1 * finger.surface, slide2 + slope2 * finger.surface
        finger.aside[0] = (slide1 * m22 - slide2 * m12) / size
        finger.aside[1] = (slide2 * m11 - slide1 * m12) / size


@inlined
def joint(press, j, time):
    """Return angle, velocity and acceleration of a joint's reference at a time [s]."""
    cubics, period = press.finger.cubics, press.run.period
    u = (time - press.run.start) / period
    c1, c2, c3 = cubics[j, 1], cubics[j, 2], cubics[j, 3]
    angle = cubics[j, 0] + u * (c1 + u * (c2 + u * c3))
    speed = (c1 + u * (2 * c2 + u * 3 * c3)) / period
    return angle, speed, (2 * c2 + 6 * c3 * u) / (period * period)


@compiled
def heading(press):
    """Return the sign of an ideal finger's velocity from now on; 0 at rest."""
    finger, run = press.finger, press.run
    if finger.kind != ix.IDEAL or finger.still:
        return 0.0
    locate_tip(press, run.time + 1e-6 * run.period)  # Of an ideal finger
    sign = 1.0 if finger.speed >= 0.0 else -1.0
    locate_tip(press, run.time)
    return sign
