"""Forces and accelerations of a press in its present mode; compiled."""

from sautereau.sim_backend.physics import laws
from sautereau.sim_backend.physics import structures as ix
from sautereau.sim_backend.physics.exact.compile import compiled, expanded, inlined
from sautereau.sim_backend.physics.exact.fingertip import locate_tip, rub

surface = inlined(laws.surface)


@inlined
def string_force(press, k):
    """Return the force [N] of a string on its jack, downwards."""
    jack, rise = press.jacks[k], press.x[k + 1]
    if jack.string == ix.STUCK or jack.string == ix.SLIDING:
        return pluck_force(press.cells, jack, rise)
    if jack.string == ix.PASSING:
        return -(jack.tongue_force + jack.tongue_stiffness * (jack.clearance - rise))
    return 0.0


@inlined
def pluck_force(cells, jack, rise):
    """Return S(h) [N]; beyond its state's rises the law continues linearly, for trial steps."""
    first, last = jack.first[jack.string - ix.STUCK], jack.first[jack.string] - 1
    within = min(max(rise, jack.range[jack.string, 0]), jack.range[jack.string, 1])
    height, cell = within - jack.clearance, min(max(jack.cell, first), last)
    while cell < last and height >= cells[cell + 1, 0]:
        cell += 1
    while cell > first and height < cells[cell, 0]:
        cell -= 1
    jack.cell = cell
    u = height - cells[cell, 0]
    c1, c2, c3 = cells[cell, 2], cells[cell, 3], cells[cell, 4]
    force = cells[cell, 1] + u * (c1 + u * (c2 + u * c3))
    if within != rise:
        force += (rise - within) * (c1 + u * (2 * c2 + u * 3 * c3))
    return force


@inlined
def static_load(press, k):
    """Return the sum of weight, string and damper of a jack [N], downwards."""
    jack = press.jacks[k]
    load = jack.mass * press.key.gravity + string_force(press, k)
    if jack.damped:
        load -= jack.damper * (jack.lift - press.x[k + 1])
    return load


@inlined
def felt_push(key, angle, omega):
    """Return the moment of the felt's spring and damper [N m]; negative if it would pull."""
    return key.felt_stiffness * (angle - key.dip) + key.felt_damping * omega


@inlined
def spring_state(overlap, push):
    """Return the state of felt or pad, which can only push."""
    if not overlap > 0.0:
        return ix.OFF
    return ix.PRESSED if push >= 0.0 else ix.SLACK


@inlined
def key_moment(press, angle, omega):
    """Return the moment on the key without dry friction, jacks and rigid fingertip [N m]."""
    key = press.key
    moment = press.finger.moment + key.gravity_moment - key.viscous * omega
    if key.felt == ix.PRESSED:
        moment -= felt_push(key, angle, omega)
    return moment


@inlined
def accelerate(press, time):
    """Set the accelerations, the moment of the finger, and the loads of the jacks on the key.

    The coordinates that depend on others in this mode are set: of a key on the finger, and of
    jacks that stand on the key.
    """
    key, finger, x, v, a = press.key, press.finger, press.x, press.v, press.a
    locate_tip(press, time)
    if key.slip == 0:
        v[0] = 0.0
    elif finger.touch:
        x[0], v[0] = finger.angle, finger.speed
    moment = key_moment(press, x[0], v[0])
    inertia, load, least, most = load_jacks(press)
    finger.reaction = a[0] = 0.0
    if key.slip == 0:
        hold_key(press, moment - key.dry - most, moment + key.dry - least)
    else:
        inertia, moment = inertia + key.inertia, moment - key.slip * key.dry - load
        if finger.touch:
            pushed = inertia * finger.acceleration - moment
            finger.reaction = pushed / (1 + finger.compliance * inertia)
            a[0] = finger.acceleration - finger.compliance * finger.reaction
        else:
            a[0] = moment / inertia
    for k in range(len(press.jacks)):
        jack = press.jacks[k]
        if jack.stands:
            jack.load += jack.mass * jack.slope * a[0]
            a[k + 1] += jack.slope * a[0]
    for j in range(len(x) - 1 - len(press.jacks)):
        a[len(x) - 2 + j] = finger.free[j] - finger.by[j] * (finger.reaction + finger.moment)


@expanded
def load_jacks(press):
    """Set the jacks' motion and forces, of those on the key as if that did not accelerate.

    Returns:
        Of the jacks on the key: their inertia about the pin [kg m^2], their moment on it [N m], and
        the least and most moment on a key that friction holds.
    """
    key, x, v, a = press.key, press.x, press.v, press.a
    inertia = moment = least = most = 0.0
    for k in range(len(press.jacks)):
        jack, at = press.jacks[k], k + 1
        if jack.stands:
            rise, slope, curvature = surface(jack.arm, key.height, x[0])
            x[at], v[at], a[at] = rise, slope * v[0], curvature * v[0] * v[0]
            static = static_load(press, k)
            jack.load = jack.mass * a[at] + static + key.slip * jack.friction
            jack.slope = slope
            inertia += jack.mass * slope * slope
            moment += slope * jack.load
            least += slope * max(static - jack.friction, 0.0)
            most += slope * (static + jack.friction)
        elif jack.sign == 0:
            v[at] = a[at] = 0.0
        else:
            load = static_load(press, k) + jack.sign * jack.friction
            a[at] = -load / jack.mass
    return inertia, moment, least, most


@expanded
def hold_key(press, least, most):
    """Set the finger's moment on a key at rest, and the margins by which friction holds it.

    Args:
        press: The key does not accelerate.
        least: N m, of all forces but the finger's, with friction against a rise.
        most: N m, likewise against a fall.
    """
    key, finger = press.key, press.finger
    if finger.touch and finger.compliance > 0.0:
        finger.reaction = finger.acceleration / finger.compliance
    elif finger.touch:  # friction carries as much as it can, the finger the remainder
        finger.reaction = max(0.0, -most)
    key.up, key.down = -(least + finger.reaction), most + finger.reaction
    if finger.friction != 0.0:
        hold_by_friction(press)


@compiled
def hold_by_friction(press):
    """Set the least friction of the fingertip with which the key stays at rest, and its margins."""
    key, finger = press.key, press.finger
    bare, part = finger.reaction + finger.moment, 0.0
    if bare <= 0.0 or (finger.touch and finger.compliance == 0.0):
        return
    side, margin = 1.0 if key.up < key.down else -1.0, min(key.up, key.down)
    rub(press, side, 1.0)
    pushed = finger.acceleration / finger.compliance if finger.touch else finger.moment
    held = margin - side * (pushed - bare)
    if margin < 0.0 < held and (side > 0 or press.x[0] > ix.CLOSE):  # not on the rail
        # The moment's reciprocal is linear in the friction.
        part = (1 / bare - 1 / (bare + side * margin)) / (1 / bare - 1 / pushed)
    if side > 0:
        key.up = max(margin, held)
    else:
        key.down = max(margin, held)
    rub(press, side, part)
    if finger.touch:
        finger.reaction = finger.acceleration / finger.compliance
