"""Time stepping of finger, key, jacks and strings: kick, drift, kick, with exact string modes.

Each step kicks all velocities by half the accelerations at the present positions, drifts the
positions (string modes by their exact damped rotation), and kicks again: second order. Forces that
depend on velocities take them as extrapolated from the previous step's accelerations.
"""

import numpy as np

from .compiled import compiled
from .forces import key_forces, one_sided, smooth_sign
from .strings import drift_string, kick_string, pluck

GRAVITY = 9.81
REGISTER_SPEED = 1e-4
"""m/s, within which the register's friction is smooth."""


@compiled
def run(
    dt, steps, settle, body, choirs, s, plan, plan_speed, plan_acceleration, start, out, events
):
    """Step the bench; fill ``out`` and ``events``; leave the strings' state in ``s``.

    Args:
        dt: s.
        steps: Number of recorded steps, as long as the plan.
        settle: Number of steps before them, with strong damping, to reach static equilibrium.
        body, choirs, s: Parameters, and the strings at rest.
        plan, plan_speed, plan_acceleration: Downward motion of the arm; shape (steps,).
        start: Preload (N; negative for a gap of as many mm), 1 if the arm follows its plan exactly.
        out: Laser velocity (m/s, downwards), transducer force (N), stored energy without the
            strings' (J), work of the arm (J), energy lost (J), then rise (m), speed (m/s) and
            plectrum load (N) of each jack; shape (5 + 3 choirs, steps).
        events: Rows of choir, kind, time s, load N.

    Returns:
        Number of events.
    """
    n = body.inverse_mass.shape[0]
    count = choirs.jack.shape[0]
    mass = np.linalg.inv(body.inverse_mass)
    p, v, acc, fast, force = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    y, vy, ay = np.zeros(count), np.zeros(count), np.zeros(count)
    k_t, c_t, m_t = body.transducer
    kp, ki, kd, grain, period, lag = body.servo_gains
    preload, gap = max(start[0], 0.0), max(-start[0], 0.0) * 1e-3
    prescribed = start[1] == 1.0
    xa, va, aa, xt, vt, at = -gap, 0.0, 0.0, -gap, 0.0, 0.0
    servo, torque, summed, error_before, bias, shift = preload, preload, 0.0, 0.0, 0.0, 0.0
    found, work, lost, power_before, loss_before = 0, 0.0, 0.0, 0.0, 0.0
    ease, follow = np.exp(-400.0 * dt), 1 - np.exp(-dt / lag)
    for i in range(-settle, steps):
        # Half a kick and the drift; `fast` and its like are the velocities expected at the end.
        _drift_key(dt, p, v, acc, fast)
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
        _drift_choirs(dt, y, vy, ay, choirs, s)
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
            y_fast = vy[c] + dt / 2 * ay[c]
            foot, gone, stored = _stand_on_key(
                choirs.jack[c], choirs.at_jack[c], body.rotation, p, fast, y[c], y_fast, force
            )
            push = foot - s.push[c] + tongue
            ay[c], rubbed, lifted = _jack_acceleration(
                choirs.jack[c], choirs.damper[c], y[c], y_fast, push
            )
            loss += gone + rubbed - tongue * y_fast
            energy += stored + lifted
        # Second half of the kick.
        _kick_key(dt, v, acc, force, body.inverse_mass)
        at = (inner - pad) / m_t
        vt += dt / 2 * at
        aa = (torque - inner) / body.arm_mass
        if not prescribed or i < 0:
            va += dt / 2 * aa
        _kick_choirs(dt, vy, ay, choirs, s)
        if i < 0:
            calm = ease if i < -1 else 0.0
            va, vt = va * calm, vt * calm
            v *= calm
            vy *= calm
            if i == -1:
                servo = torque = bias = inner
                aa, shift = 0.0, xa - plan[0]
            continue
        power = va * (inner if prescribed else torque)
        work += dt / 2 * (power + power_before)
        lost += dt / 2 * (loss + loss_before)
        power_before, loss_before = power, loss
        energy += 0.5 * m_t * vt**2 + (0.0 if prescribed else 0.5 * body.arm_mass * va**2)
        energy += _kinetic_energy(v, vy, mass, choirs.jack)
        for j in range(n):
            out[0, i] -= body.at_laser[j] * v[j]
        out[1, i], out[2, i], out[3, i], out[4, i] = inner, energy, work, lost
        for c in range(count):
            row = 5 + 3 * c
            out[row, i], out[row + 1, i], out[row + 2, i] = y[c], vy[c], s.push[c]
    return found


@compiled
def _drift_key(dt, p, v, acc, fast):
    """Kick the key by half a step and drift it; ``fast`` is the velocity expected at the end."""
    for j in range(len(p)):
        half = v[j] + dt / 2 * acc[j]
        p[j] += dt * half
        v[j], fast[j] = half, half + dt / 2 * acc[j]


@compiled
def _kick_key(dt, v, acc, force, inverse_mass):
    """Kick the key by half a step of the forces at its new position."""
    for j in range(len(v)):
        acc[j] = 0.0
        for k in range(len(v)):
            acc[j] += inverse_mass[j, k] * force[k]
        v[j] += dt / 2 * acc[j]


@compiled
def _drift_choirs(dt, y, vy, ay, choirs, s):
    """Kick the jacks by half a step and drift them, and the strings that they have touched."""
    for c in range(len(y)):
        vy[c] += dt / 2 * ay[c]
        y[c] += dt * vy[c]
        if choirs.string[c, 1] == 0.0 and s.touched[c]:
            felt = 1 if choirs.damper[c, 0] > 0 and y[c] < choirs.damper[c, 1] else 0
            drift_string(dt, c, felt, choirs, s)


@compiled
def _kick_choirs(dt, vy, ay, choirs, s):
    """Kick the jacks and their strings by half a step."""
    for c in range(len(vy)):
        vy[c] += dt / 2 * ay[c]
        kick_string(dt, c, choirs, s)


@compiled
def _kinetic_energy(v, vy, mass, jack):
    """Return the kinetic energy of key and jacks, J."""
    twice = 0.0
    for j in range(len(v)):
        for k in range(len(v)):
            twice += v[j] * mass[j, k] * v[k]
    for c in range(len(vy)):
        twice += jack[c, 2] * vy[c] ** 2
    return twice / 2


@compiled
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


@compiled
def _jack_acceleration(jack, damper, y, y_fast, push):
    """Return a jack's acceleration under an upward force, and what friction and damper add.

    Returns:
        Acceleration m/s^2; power lost in the register W; energy of weight and damper J.
    """
    _, _, mass, _, _, rub, _ = jack
    felt, _, pressed = one_sided(damper[1] - y, 0.0, damper[0], 0.0)
    rubbed = rub * smooth_sign(y_fast, REGISTER_SPEED)
    return (push - rubbed + felt) / mass - GRAVITY, rubbed * y_fast, pressed + mass * GRAVITY * y
