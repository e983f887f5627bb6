"""Time stepping of finger, key, jacks and strings: kick, drift, kick, with exact string modes.

Each step kicks all velocities by half the accelerations at the present positions, drifts the
positions (string modes by their exact damped rotation), and kicks again: second order. Forces that
depend on velocities take them as extrapolated from the previous step's accelerations.
"""

import numpy as np

from .compiled import compiled, entry, inlined
from .strings import drift_strings, kick_strings, pluck

GRAVITY = 9.81
REGISTER_SPEED = 1e-4  # m/s, within which the register's friction is smooth


@entry
def run(
    dt, steps, settle, body, choirs, s, plan, plan_speed, plan_acceleration, start, key, jacks, out,
    events,
):  # fmt: skip
    """Step the bench; fill ``out`` and ``events``; leave the strings' state in ``s``.

    Args:
        dt: s.
        steps: Number of recorded steps, as long as the plan.
        settle: Number of steps before them, with strong damping, to reach static equilibrium.
        body, choirs, s: Parameters, and the strings at rest.
        plan, plan_speed, plan_acceleration: Downward motion of the arm; shape (steps,).
        start: Preload (N; negative for a gap of as many mm), 1 if the arm follows its plan exactly.
        key, jacks: Zeros, for what is computed in a step; shapes (5, coordinates) and (4, choirs).
        out: Laser velocity (m/s, downwards), transducer force (N), stored energy without the
            strings' (J), work of the arm (J), energy lost (J), then rise (m), speed (m/s) and
            plectrum load (N) of each jack; shape (5 + 3 choirs, steps).
        events: Rows of choir, kind, time s, load N.

    Returns:
        Number of events.
    """
    count = choirs.jack.shape[0]
    p, v, acc, fast, force = key[0], key[1], key[2], key[3], key[4]
    y, vy, ay, vy_fast = jacks[0], jacks[1], jacks[2], jacks[3]
    k_t, c_t, m_t = body.transducer
    kp, ki, kd, grain, period, lag = body.servo_gains
    preload, gap = max(start[0], 0.0), max(-start[0], 0.0) * 1e-3
    prescribed = start[1] == 1.0
    xa, va, aa, xt, vt, at = -gap, 0.0, 0.0, -gap, 0.0, 0.0
    servo, torque, summed, error_before, bias, shift = preload, preload, 0.0, 0.0, 0.0, 0.0
    found = np.int64(0)  # a literal 0 would compile `pluck` once more
    work, lost, power_before, loss_before = 0.0, 0.0, 0.0, 0.0
    ease, follow = np.exp(-400.0 * dt), 1 - np.exp(-dt / lag)
    for i in range(-settle, steps):
        # Half a kick and the drift; `fast` and its like are the velocities expected at the end.
        _drift(dt, p, v, acc, fast)
        vt += dt / 2 * at
        xt += dt * vt
        vt_fast = vt + dt / 2 * at
        if i >= 0 and prescribed:
            xa, va = plan[i] + shift, plan_speed[i]
            va_fast = va
        elif i < 0 and gap > 0:
            va = va_fast = 0.0
        else:
            va += dt / 2 * aa
            xa += dt * va
            va_fast = va + dt / 2 * aa
        _drift(dt, y, vy, ay, vy_fast)
        drift_strings(dt, y, choirs, s)
        # Drive: its lag, and once in a controller sample the servo.
        torque += (servo - torque) * follow
        if i >= 0 and i % body.servo_every == 0:
            seen = np.round(xa / grain) * grain
            error = plan[i] + shift - seen
            summed += error * period
            servo = bias + kp * error + ki * summed + body.fed_mass * plan_acceleration[i]
            servo += kd * (error - error_before) / period
            error_before = error
        # Forces at the new positions.
        inner = k_t * (xa - xt) + c_t * (va_fast - vt_fast)
        pad, loss, energy = key_forces(body, p, fast, xt, vt_fast, force)
        loss += c_t * (va_fast - vt_fast) ** 2
        energy += 0.5 * k_t * (xa - xt) ** 2
        for c in range(count):
            tongue = 0.0
            if i >= 0:
                above = y[c] - choirs.jack[c, 6]
                found, tongue = pluck(i, dt, c, above, choirs, s, events, found)
            foot, gone, stored = _stand_on_key(
                choirs.jack[c], choirs.at_jack[c], body.rotation, p, fast, y[c], vy_fast[c], force
            )
            push = foot - s.push[c] + tongue
            ay[c], rubbed, lifted = _jack_acceleration(
                choirs.jack[c], choirs.damper[c], y[c], vy_fast[c], push
            )
            loss += gone + rubbed - tongue * vy_fast[c]
            energy += stored + lifted
        # Second half of the kick.
        _accelerate(acc, force, body.inverse_mass)
        _kick(dt, v, acc)
        at = (inner - pad) / m_t
        vt += dt / 2 * at
        aa = (torque - inner) / body.arm_mass
        if not prescribed or i < 0:
            va += dt / 2 * aa
        _kick(dt, vy, ay)
        kick_strings(dt, choirs, s)
        if i < 0:
            calm = ease if i < -1 else 0.0
            va, vt = va * calm, vt * calm
            _calm(v, calm)
            _calm(vy, calm)
            if i == -1:
                servo = torque = bias = inner
                aa, shift = 0.0, xa - plan[0]
            continue
        power = va * (inner if prescribed else torque)
        work += dt / 2 * (power + power_before)
        lost += dt / 2 * (loss + loss_before)
        power_before, loss_before = power, loss
        energy += 0.5 * m_t * vt**2 + (0.0 if prescribed else 0.5 * body.arm_mass * va**2)
        energy += _kinetic_energy(v, vy, body.mass, choirs.jack)
        out[0, i] = -_dot(body.at_laser, v)
        out[1, i], out[2, i], out[3, i], out[4, i] = inner, energy, work, lost
        _note_jacks(out[5:, i], y, vy, s.push)
    return found


@inlined
def _drift(dt, p, v, acc, fast):
    """Kick by half a step and drift; ``fast`` is the velocity expected at the end."""
    for j in range(len(p)):
        half = v[j] + dt / 2 * acc[j]
        p[j] += dt * half
        v[j], fast[j] = half, half + dt / 2 * acc[j]


@inlined
def _calm(v, fraction):
    for j in range(len(v)):
        v[j] *= fraction


@inlined
def _kick(dt, v, acc):
    """Kick by half a step."""
    for j in range(len(v)):
        v[j] += dt / 2 * acc[j]


@inlined
def _accelerate(acc, force, inverse_mass):
    """Write the key's acceleration under the forces at its new position."""
    for j in range(len(acc)):
        acc[j] = 0.0
        for k in range(len(acc)):
            acc[j] += inverse_mass[j, k] * force[k]


@inlined
def _dot(a, b):
    total = 0.0
    for j in range(len(a)):
        total += a[j] * b[j]
    return total


@inlined
def _note_jacks(column, y, vy, push):
    """Write height, speed and load of each jack into a column of the results."""
    for c in range(len(y)):
        column[3 * c], column[3 * c + 1], column[3 * c + 2] = y[c], vy[c], push[c]


@inlined
def _kinetic_energy(v, vy, mass, jack):
    """Return the kinetic energy of key and jacks, J."""
    twice = 0.0
    for j in range(len(v)):
        for k in range(len(v)):
            twice += v[j] * mass[j, k] * v[k]
    for c in range(len(vy)):
        twice += jack[c, 2] * vy[c] ** 2
    return twice / 2


@inlined
def _stand_on_key(jack, at_jack, rotation, p, fast, y, y_fast, force):
    """Add the force of a jack's foot to those on the key.

    Returns:
        Force of the key on the foot N; power lost W; energy stored J.
    """
    arm, height, _, stiffness, damping, _, _ = jack
    turn = p[rotation]
    surface = arm * turn**3 / 3 + height * turn**2 / 2
    lever = arm * turn**2 + height * turn
    rising = lever * fast[rotation]
    for j in range(len(p)):
        surface += at_jack[j] * p[j]
        rising += at_jack[j] * fast[j]
    foot, lost, stored = one_sided(surface - y, rising - y_fast, stiffness, damping)
    for j in range(len(p)):
        force[j] -= foot * at_jack[j]
    force[rotation] -= foot * lever
    return foot, lost, stored


@inlined
def _jack_acceleration(jack, damper, y, y_fast, push):
    """Return a jack's acceleration under an upward force, and what friction and damper add.

    Returns:
        Acceleration m/s^2; power lost in the register W; energy of weight and damper J.
    """
    _, _, mass, _, _, rub, _ = jack
    felt, _, pressed = one_sided(damper[1] - y, 0.0, damper[0], 0.0)
    rubbed = rub * smooth_sign(y_fast, REGISTER_SPEED)
    return (push - rubbed + felt) / mass - GRAVITY, rubbed * y_fast, pressed + mass * GRAVITY * y


@compiled
def smooth_sign(velocity, scale):
    """Return the direction of a Coulomb force, smooth within ``scale``."""
    return np.tanh(velocity / scale)


@compiled
def one_sided(depth, speed, stiffness, damping):
    """Return force, power lost and energy stored of a spring with damper that can only push."""
    if depth <= 0:
        return 0.0, 0.0, 0.0
    force = max(stiffness * depth + damping * speed, 0.0)
    return force, (force - stiffness * depth) * speed, 0.5 * stiffness * depth**2


@compiled
def key_forces(body, p, v, tip, tip_speed, force):
    """Write the generalised forces on the key, without those of the jacks.

    Args:
        body: Parameters.
        p, v: Coordinates of the key and their velocities; shape (n,).
        tip, tip_speed: m and m/s, of the fingertip, downwards.
        force: Result; shape (n,).

    Returns:
        Force of the pad N; power lost W; energy stored J.
    """
    n = len(p)
    a = body.rotation
    down = down_speed = rail = rail_speed = 0.0
    for j in range(n):
        down -= body.at_press[j] * p[j]
        down_speed -= body.at_press[j] * v[j]
        rail -= body.at_rail[j] * p[j]
        rail_speed -= body.at_rail[j] * v[j]
    pad = loss = energy = 0.0
    if tip > down:
        stiffness, exponent, damping = body.pad[0], body.pad[1], body.pad[2]
        spring = stiffness * (tip - down) ** exponent
        pad = max(spring + min(spring / 0.5, 1.0) * damping * (tip_speed - down_speed), 0.0)
        loss += (pad - spring) * (tip_speed - down_speed)
        energy += spring * (tip - down) / (exponent + 1)
    at_rail, lost, stored = one_sided(rail, rail_speed, body.rail[0], body.rail[1])
    loss, energy = loss + lost, energy + stored
    felt, lost, stored = one_sided(down - body.felt[2], down_speed, body.felt[0], body.felt[1])
    loss, energy = loss + lost, energy + stored
    for j in range(n):
        total = (felt - pad) * body.at_press[j] + at_rail * body.at_rail[j]
        for k in range(n):
            total -= body.stiffness[j, k] * p[k] + body.damping[j, k] * v[k]
            loss += v[j] * body.damping[j, k] * v[k]
            energy += 0.5 * p[j] * body.stiffness[j, k] * p[k]
        force[j] = total
    moment = body.pivot[0] * smooth_sign(v[a], 1e-3) + body.pivot[1] * v[a]
    moment += body.pad[3] * pad * body.pad[4] * smooth_sign(v[a], 1e-3)
    force[a] += body.gravity - moment
    return pad, loss + moment * v[a], energy - body.gravity * p[a]
