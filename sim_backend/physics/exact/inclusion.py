"""One scalar inclusion for the key decides impacts, modes and nonsmooth steps; compiled.

The unknown x is the key's velocity after an impact or a nonsmooth step of length h, or its
acceleration. A jack k in contact with the key pushes back with

    P_k(x) = max(0, m s x + p_k + f_k Sgn x),    Phi(x) = I x - q + t Sgn x + sum s_k P_k(x),

where s is the slope of the key under it: m (s x - v) is its change of momentum, zero as long as it
is faster than the key. Phi rises, piecewise linearly, with a jump at 0 by dry friction. Without a
finger 0 is in Phi(x); a finger that would move the key by x_f pushes with F = Phi(x) >= 0, which
takes c F from it: x = x_f - c F, with c = 0 if it is ideal. The rail holds x >= 0. With friction of
the fingertip, c and the moment of a push or a pad depend on the sign of x, which is that without
it; if the one with it differs, the least that leaves x = 0 acts.
"""

import math

from sautereau.sim_backend.physics import structures as ix
from sautereau.sim_backend.physics.exact.compile import compiled, entry, expanded, inlined
from sautereau.sim_backend.physics.exact.fingertip import heading, locate_tip, rub
from sautereau.sim_backend.physics.exact.forces import (
    accelerate,
    felt_push,
    key_moment,
    spring_state,
    static_load,
    surface,
)

DEEP = 1e-6  # rad, largest overlap of fingertip and key


@inlined
def in_contact(kept, h, gap, apart):
    """Return whether surfaces meet within a time h, or for accelerations stay in contact.

    Args:
        kept: As of `solve`, as the next.
        h: s.
        gap: m or rad, between them.
        apart: m/s or rad/s, of the gap.
    """
    return gap + kept * h * apart <= ix.CLOSE and (kept > 0.0 or abs(apart) <= ix.SLOW)


@expanded
def pose(press, kept, h):
    """Set the jacks' terms of the inclusion; return q and t of the key. See `solve`."""
    key, x, v = press.key, press.x, press.v
    angle, omega = x[0], v[0]
    for k in range(len(press.jacks)):
        jack, speed = press.jacks[k], v[k + 1]
        rise, slope, curvature = surface(jack.arm, key.height, angle)
        gap, apart = x[k + 1] - rise, speed - slope * omega
        jack.slope, jack.dry = slope, h * jack.friction
        jack.push = h * static_load(press, k) - kept * jack.mass * speed
        jack.closed = in_contact(kept, h, gap, apart)
        if not kept:
            jack.push += jack.mass * curvature * omega * omega
            if speed != 0.0:
                jack.push, jack.dry = jack.push + math.copysign(jack.friction, speed), 0.0
    moment, dry = kept * key.inertia * omega + h * key_moment(press, angle, omega), h * key.dry
    if not kept and omega != 0.0:
        moment, dry = moment - math.copysign(key.dry, omega), 0.0
    return moment, dry


@inlined
def jack_push(jack, x, side):
    """Return P_k(x); the side is the sign of x, or that of a limit at 0."""
    if not jack.closed:
        return 0.0
    return max(0.0, jack.mass * jack.slope * x + jack.push + side * jack.dry)


@inlined
def unbalanced(press, q, t, x, side):
    """Return Phi(x)."""
    total = press.key.inertia * x - q + side * t
    for k in range(len(press.jacks)):
        jack = press.jacks[k]
        total += jack.slope * jack_push(jack, x, side)
    return total


@inlined
def sign(x):
    """Return the sign of a number, 0 for 0."""
    return 1.0 if x > 0.0 else -1.0 if x < 0.0 else 0.0


@inlined
def root(press, q, t, by, pull, target):
    """Return x with 0 in by Phi(x) + pull (x - target): between the ends of its linear pieces."""
    below = by * unbalanced(press, q, t, 0.0, -1.0) - pull * target
    above = by * unbalanced(press, q, t, 0.0, 1.0) - pull * target
    if below <= 0.0 <= above:
        return 0.0
    side = 1.0 if above < 0.0 else -1.0
    low, high = (0.0, math.inf) if side > 0 else (-math.inf, 0.0)
    for k in range(len(press.jacks)):
        jack = press.jacks[k]
        if not jack.closed:
            continue
        end = -(jack.push + side * jack.dry) / (jack.mass * jack.slope)
        if low < end < high:
            if by * unbalanced(press, q, t, end, side) + pull * (end - target) <= 0.0:
                low = end
            else:
                high = end
    # Within a linear piece, two values give the root.
    near = low if low > -math.inf else high
    far = high if near == low else low
    if math.isinf(far):
        far = near + side * (1.0 + abs(near))
    first = by * unbalanced(press, q, t, near, side) + pull * (near - target)
    last = by * unbalanced(press, q, t, far, side) + pull * (far - target)
    found = near - first * (far - near) / (last - first) if last != first else near
    return min(max(found, low), high)


@compiled
def sought(press, q, t, h, target, near):
    """Return the unknown off the rail; the target is that of a key that follows the finger."""
    q, c = q + h * press.finger.moment, press.finger.compliance
    x = root(press, q, t, 1.0, 0.0, 0.0)
    if near and x < target:
        x = root(press, q, t, c, 1.0, target) if c > 0.0 else target
    return x


@compiled
def solve(press, kept, h, direction):
    """Solve the inclusion; return the unknown, and set touch and reaction of the finger.

    Args:
        press: Its modes of felt, strings and dampers are set.
        kept: 1.0 if x is a velocity, 0.0 if it is an acceleration.
        h: s, for which forces act: 0 for an impact, 1 for an acceleration.
        direction: Of an ideal finger that is about to move the key from rest, else 0.
    """
    finger, angle, omega = press.finger, press.x[0], press.v[0]
    q, t = pose(press, kept, h)
    q -= h * finger.moment
    side, target = 0.0 if kept else sign(omega), kept * finger.speed + h * finger.acceleration
    near = in_contact(kept, h, angle - finger.angle, omega - finger.speed)
    rub(press, side, 1.0)
    x = sought(press, q, t, h, target, near)
    if in_contact(kept, h, angle, omega):  # the rail
        x = max(x, 0.0)
    if finger.friction != 0.0 and side == 0.0 and x != 0.0:
        side, bare = sign(x), finger.compliance
        rub(press, side, 1.0)
        x = side * max(side * sought(press, q, t, h, target, near), 0.0)
        if x == 0.0 and near and bare < math.inf:
            needed = target / unbalanced(press, q + h * finger.moment, t, 0.0, side)
            rub(press, side, (bare - needed) / (bare - finger.compliance))
    finger.touch, finger.reaction = near and (x < target or (x == target and direction >= 0)), 0.0
    if finger.touch and finger.compliance > 0.0:
        finger.reaction = (target - x) / finger.compliance
    elif finger.touch:
        finger.reaction = max(0.0, unbalanced(press, q + h * finger.moment, t, x, sign(x)))
    return x


@entry
def resolve(press, h):
    """Apply plastic impacts, of the impulses that no surface forbids; return a status.

    With h > 0 this is a nonsmooth step (Moreau): the forces act for that time, and the
    contacts that close within it are part of the impact. It is of first order. What the finger's
    impulse exceeds its present force counts as a blow.
    """
    finger, x, v = press.finger, press.x, press.v
    status = part_surfaces(press)
    if status != ix.FINE:
        return status
    set_forces(press)
    steady = h * finger.reaction
    omega = solve(press, 1.0, h, 0.0)
    taken = finger.reaction
    if taken > press.key.inertia * ix.SLOW:
        finger.impulse += (taken - steady) / finger.lever
    for k in range(len(press.jacks)):
        jack, at = press.jacks[k], k + 1
        if jack_push(jack, omega, sign(omega)) > 0.0:
            v[at] = jack.slope * omega
        elif h > 0.0:
            free = v[at] - h * static_load(press, k) / jack.mass
            slow = jack.dry / jack.mass
            v[at] = free - min(max(free, -slow), slow)
    for j in range(len(x) - 1 - len(press.jacks)):
        moved = finger.free[j] - finger.by[j] * finger.moment
        v[len(x) - 2 + j] += h * moved - finger.by[j] * taken
    v[0] = omega
    for i in range(len(x)):
        x[i] += h * v[i]
    return ix.FINE


@expanded
def part_surfaces(press):
    """Move the key out of the fingertip and the rail, the jacks out of the key; return a status."""
    key, finger, x = press.key, press.finger, press.x
    locate_tip(press, press.run.time)
    if not math.isfinite(x[0] + press.v[0]):
        return ix.LOST
    if math.isnan(finger.angle):
        return ix.AT_PIN
    if -x[0] > DEEP:  # below its rail, where only an error of the forces takes it
        return ix.LOST
    if finger.angle - x[0] > DEEP:
        return ix.JUMPED
    if finger.friction != 0.0 and finger.kind == ix.SERVO and finger.angle >= x[0]:
        for side in (1.0, -1.0):
            rub(press, side, 1.0)
            if finger.lever <= 0.0 or finger.compliance < 0.0:
                return ix.JAMMED
    x[0] = max(x[0], finger.angle, 0.0)
    for k in range(len(press.jacks)):
        rise, _, _ = surface(press.jacks[k].arm, key.height, x[0])
        x[k + 1] = max(x[k + 1], rise)
    return ix.FINE


@inlined
def set_forces(press):
    """Set the modes of felt and dampers, and the rises between which no string changes."""
    key, angle = press.key, press.x[0]
    key.felt = spring_state(angle - key.dip, felt_push(key, angle, press.v[0]))
    for k in range(len(press.jacks)):
        jack = press.jacks[k]
        jack.low, jack.high = jack.range[jack.string, 0], jack.range[jack.string, 1]
        jack.damped = press.x[k + 1] < jack.lift
        if jack.damped:
            jack.high = min(jack.high, jack.lift)
        else:
            jack.low = max(jack.low, jack.lift)


@entry
def select(press):
    """Select the mode that follows after all impacts, by the accelerations."""
    key, finger, v = press.key, press.finger, press.v
    set_forces(press)
    for i in range(1 + len(press.jacks)):
        if abs(v[i]) <= ix.SLOW:
            v[i] = 0.0
    direction = heading(press) if v[0] == 0.0 else 0.0
    locate_tip(press, press.run.time)
    finger.pad = spring_state(finger.overlap, finger.push)
    turn = solve(press, 0.0, 1.0, direction)
    key.slip = sign(v[0]) if v[0] != 0.0 else sign(turn)
    if v[0] == 0.0 and finger.touch and direction != 0:
        key.slip = direction
    side = key.slip if key.slip != 0.0 else 1.0
    for k in range(len(press.jacks)):
        jack = press.jacks[k]
        push = jack.mass * jack.slope * turn + jack.push + side * jack.dry
        jack.stands, jack.sign = jack.closed and push >= 0.0, sign(v[k + 1])
        load = static_load(press, k)
        if jack.sign == 0 and abs(load) > jack.friction:
            jack.sign = -sign(load)
    accelerate(press, press.run.time)
