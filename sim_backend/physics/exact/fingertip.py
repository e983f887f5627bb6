"""The fingertip over the key: kinematics, the servo's arm and its position loops; compiled."""

import math

from sautereau.sim_backend.physics.exact import structures as ix
from sautereau.sim_backend.physics.exact.compile import compiled, entry, inlined

AHEAD = 1e-6
"""Dimensionless, fraction of a controller sample after which an ideal finger's direction counts."""


@inlined
def locate_tip(press, time):
    """Set the motion of a key under the fingertip: z cos a - x sin a = hf + r.

    With the joints q, a' = A q' and a'' = A q'' + bias. For a servo q'' = free - by F, where F is
    the moment on the key; for an ideal finger q is the reference, whatever the force. The angle is
    NaN if the fingertip is so close to the pin that no angle gives a contact. With a pad the key
    has its own angle, and the pad's moment is set.
    """
    arm, finger = press.arm, press.finger
    if finger.kind == ix.PUSH:
        finger.angle = -math.inf
        return
    if finger.kind == ix.SERVO:
        n = len(press.jacks)
        q1, q2, d1, d2 = press.x[n + 1], press.x[n + 2], press.v[n + 1], press.v[n + 2]
        s1 = s2 = 0.0
    else:
        q1, d1, s1 = joint(finger, 0, time)
        q2, d2, s2 = joint(finger, 1, time)
    q12, d12 = q1 + q2, d1 + d2
    ux, uz = arm.upper * math.cos(q1), arm.upper * math.sin(q1)
    lx, lz = arm.lower * math.cos(q12), arm.lower * math.sin(q12)
    x, z = arm.base_x + ux + lx, arm.base_z + uz + lz
    squared = x * x + z * z - arm.height * arm.height
    if arm.pad_stiffness > 0.0:
        angle = press.x[0]
    elif squared > 0:
        angle = math.atan2(-x, z) - math.atan2(math.sqrt(squared), arm.height)
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
    bias = (inward - 2 * omega * along - omega * omega * arm.height) / reach
    finger.angle, finger.speed, finger.lever = angle, omega, -reach
    if finger.kind == ix.SERVO:
        move_arm(press, q1, q2, d1, d2, slope1, slope2)
        s1, s2 = finger.free[0], finger.free[1]
        finger.compliance = slope1 * finger.by[0] + slope2 * finger.by[1]
    finger.acceleration = slope1 * s1 + slope2 * s2 + bias
    if arm.pad_stiffness > 0.0:
        finger.overlap = arm.height - z * cosine + x * sine
        squeeze(press)


@compiled
def squeeze(press):
    """Set the moment of the pad, which a rigid fingertip's contact never joins."""
    arm, finger = press.arm, press.finger
    closing = finger.lever * (finger.speed - press.v[0])
    finger.push = arm.pad_stiffness * finger.overlap + arm.pad_damping * closing
    finger.push *= finger.lever
    finger.moment = max(0.0, finger.push) if finger.overlap > 0.0 else 0.0
    finger.angle, finger.compliance = -math.inf, math.inf
    for j in range(2):
        finger.free[j] -= finger.by[j] * finger.moment


@compiled
def move_arm(press, q1, q2, d1, d2, slope1, slope2):
    """Set the joints' accelerations under the motors, and those per moment on the key."""
    arm, finger = press.arm, press.finger
    coupling, twist = arm.coupling * math.cos(q2), arm.coupling * math.sin(q2)
    m11 = arm.inertia1 + arm.inertia2 + 2 * coupling
    m12, m22 = arm.inertia2 + coupling, arm.inertia2 + arm.rotor2
    if arm.locked[0] or arm.locked[1]:
        m12 = 0.0
    right1, right2 = arm_weight(arm, q1, q2)
    right1 = arm.torque[0] - right1 + twist * (2 * d1 + d2) * d2
    right2 = arm.torque[1] - right2 - twist * d1 * d1
    if arm.locked[0]:
        right1 = slope1 = 0.0
    if arm.locked[1]:
        right2 = slope2 = 0.0
    size = m11 * m22 - m12 * m12
    finger.free[0] = (right1 * m22 - right2 * m12) / size
    finger.free[1] = (right2 * m11 - right1 * m12) / size
    finger.by[0] = (slope1 * m22 - slope2 * m12) / size
    finger.by[1] = (slope2 * m11 - slope1 * m12) / size


@inlined
def arm_weight(arm, q1, q2):
    """Return the torques [N m] that balance the links' weight."""
    second = arm.weight2 * math.cos(q1 + q2)
    return arm.weight1 * math.cos(q1) + second, second


@inlined
def joint(finger, j, time):
    """Return angle, velocity and acceleration of a joint's reference at a time [s]."""
    u = (time - finger.start) / finger.period
    c1, c2, c3 = finger.cubics[j, 1], finger.cubics[j, 2], finger.cubics[j, 3]
    angle = finger.cubics[j, 0] + u * (c1 + u * (c2 + u * c3))
    speed = (c1 + u * (2 * c2 + u * 3 * c3)) / finger.period
    return angle, speed, (2 * c2 + 6 * c3 * u) / (finger.period * finger.period)


@compiled
def heading(press, time):
    """Return the sign of an ideal finger's velocity just after a time [s]; 0 at rest."""
    finger = press.finger
    if finger.kind == ix.SERVO or finger.still:
        return 0.0
    locate_tip(press, time + AHEAD * finger.period)
    sign = 1.0 if finger.speed >= 0.0 else -1.0
    locate_tip(press, time)
    return sign


@entry
def engage(press):
    """Take over an arm at rest: the integrators start at the torques of its weight."""
    arm, n = press.arm, len(press.jacks)
    arm.integral[0], arm.integral[1] = arm_weight(arm, press.x[n + 1], press.x[n + 2])
    for j in range(2):
        arm.lag[j], arm.locked[j] = 0.0, 0


@compiled
def close_loops(press):
    """Set the motors' torques for a controller sample, from its reference and the encoders.

    With the following error e, read in integer counts, k e + c de/dt + J acceleration + integral,
    limited; the integral k e dt / T grows only while the limit is not reached.
    """
    arm, finger, n = press.arm, press.finger, len(press.jacks)
    for j in range(2):
        p0, p2, p3 = finger.cubics[j, 0], finger.cubics[j, 2], finger.cubics[j, 3]
        counts = round((press.x[n + 1 + j] - arm.start[j]) / arm.radians)
        lag = p0 - arm.start[j] - counts * arm.radians
        change, arm.lag[j] = lag - arm.lag[j], lag
        acceleration = (2 * p2 + 3 * p3) / (finger.period * finger.period)
        torque = arm.stiffness[j] * lag + arm.damping[j] * change / finger.period
        torque += arm.feedforward[j] * acceleration + arm.integral[j] + arm.offset[j]
        if abs(torque) < arm.limit[j]:  # no integrator wind-up while the amplifier saturates
            arm.integral[j] += arm.stiffness[j] * lag * finger.period / arm.integral_time
        arm.torque[j] = min(max(torque, -arm.limit[j]), arm.limit[j])
