"""Time stepping of finger, key, jacks and strings: kick, drift, kick, with exact string modes.

Each step kicks all velocities by half the accelerations at the present positions, drifts the
positions (string modes by their exact damped rotation), and kicks again (Strang splitting, second
order). Contact and release are located inside the step by the linear course of the gap and of the
string's position on the plectrum.
"""

from typing import NamedTuple

import numpy as np

from .compiled import compiled
from .elastica import solve_contact

BELOW, HELD, ABOVE, PASSING = 0, 1, 2, 3
"""The plectrum stands below the string, holds it, stands above it, or passes it downwards."""


class Body(NamedTuple):
    """Finger and key. Finger quantities are positive downwards, those of the key upwards."""

    arm_mass: float
    servo_every: int
    servo_gains: np.ndarray
    """Kp (N/m), Ki (N/m/s), Kd (N s/m), encoder step (m), period (s), lag of the drive (s)."""
    transducer: np.ndarray
    """Stiffness N/m, damping N s/m, mass of the tip kg."""
    pad: np.ndarray
    """Stiffness N/m^n, exponent n, damping N s/m from 0.5 N on and in proportion to the
    force below, friction, height above pin m."""
    inverse_mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    rotation: int
    gravity: float
    """N m, static moment that lowers the front."""
    pivot: np.ndarray
    """Coulomb moment N m, viscous N m s/rad."""
    at_press: np.ndarray
    at_rail: np.ndarray
    at_laser: np.ndarray
    rail: np.ndarray
    """Stiffness N/m, damping N s/m."""
    felt: np.ndarray
    """Stiffness N/m, damping N s/m, dip m."""


class Choirs(NamedTuple):
    """Jacks, plectra and strings; first axis: the choir."""

    at_jack: np.ndarray
    """Displacement of the key under the jack per coordinate; shape (choirs, n)."""
    jack: np.ndarray
    """Arm m, surface height m, mass kg, foot stiffness N/m, foot damping N s/m, register
    friction N, clearance m."""
    plectrum: np.ndarray
    """EI N m^2, length m, wire's distance from the clamp at rest m, offset m, friction."""
    shapes: np.ndarray
    """Polynomials of the elastica; shape (choirs, 3, degree + 1)."""
    string: np.ndarray
    """Residual compliance m/N of the omitted modes, 1 for a quasi-static string."""
    modes: np.ndarray
    """Shape at the plectrum, inverse modal mass 1/kg; shape (choirs, modes, 2)."""
    propagators: np.ndarray
    """Of position and velocity over one step, without and with damper felt;
    shape (choirs, 2, modes, 4)."""
    static_height: np.ndarray
    static_load: np.ndarray
    damper: np.ndarray
    """Stiffness N/m, rise at which the felt leaves the string m."""
    tongue: np.ndarray
    """Force N while the tongue passes, travel m."""


@compiled
def _smooth_sign(velocity, scale):
    return np.tanh(velocity / scale)


@compiled
def run(
    dt,
    steps,
    settle,
    body,
    choirs,
    plan,
    plan_speed,
    plan_acceleration,
    prescribed,
    preload,
    out,
    events,
):
    """Step the bench; fill ``out`` and ``events``; return the number of events and the energies.

    Args:
        dt: s.
        steps: Number of recorded steps, as long as the plan.
        settle: Number of steps before them, with strong damping, to reach static equilibrium.
        body, choirs: Parameters.
        plan, plan_speed, plan_acceleration: Downward motion of the arm; shape (steps,).
        prescribed: Whether the arm follows the plan exactly.
        preload: N, of the finger on the resting key; negative for a gap of as many mm.
        out: Laser velocity (m/s, downwards), transducer force (N), stored energy (J), then rise
            (m), speed (m/s) and plectrum load (N) of each jack; shape (3 + 3 choirs, steps).
        events: Rows of choir, kind (0 contact, 1 release, 2 contact lost), time s, load N.

    Returns:
        Number of events; work of the arm J; energy lost in dampers and friction J; energy at
        the start and, without the strings', at the end J; positions and velocities of the modes.
    """
    n = body.inverse_mass.shape[0]
    count = choirs.jack.shape[0]
    modes = choirs.modes.shape[1]
    p, v, half, force = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    y, vy, ay = np.zeros(count), np.zeros(count), np.zeros(count)
    q = np.zeros((count, 2, modes))
    u = np.zeros((count, 2, modes))
    load = np.zeros((count, 2))
    push = np.zeros(count)
    state = np.zeros(count, np.int64)
    w, place, gap = np.zeros(count), np.zeros(count), np.ones(count)
    touched = np.zeros(count, np.bool_)
    k_t, c_t, m_t = body.transducer
    kp, ki, kd, grain, period, lag = body.servo_gains
    xa, va, xt, vt = min(preload, 0.0) * 1e-3, 0.0, min(preload, 0.0) * 1e-3, 0.0
    acceleration_a, acceleration_t, summed, before, bias = 0.0, 0.0, 0.0, 0.0, 0.0
    servo, torque, shift = max(preload, 0.0), 0.0, 0.0
    gap_before = max(-preload, 0.0) * 1e-3
    found, work, lost, first = 0, 0.0, 0.0, 0.0
    energy = 0.0
    ease = np.exp(-400.0 * dt)
    a = body.rotation
    acc = np.zeros(n)
    for i in range(-settle, steps):
        now = max(i, 0)
        # Half a kick and the drift.
        for j in range(n):
            half[j] = v[j] + dt / 2 * acc[j]
            p[j] += dt * half[j]
        va_half = va + dt / 2 * acceleration_a
        if prescribed and i >= 0:
            va_half = plan_speed[now]
            xa = plan[now] + shift
        elif i < 0 and gap_before > 0:
            va_half = 0.0
        else:
            xa += dt * va_half
        vt_half = vt + dt / 2 * acceleration_t
        xt += dt * vt_half
        for c in range(count):
            vy[c] += dt / 2 * ay[c]
            y[c] += dt * vy[c]
            if choirs.string[c, 1] == 0.0 and touched[c]:
                felt = 1 if y[c] < choirs.damper[c, 1] and choirs.damper[c, 0] > 0 else 0
                for d in range(2):
                    for k in range(modes):
                        kick = dt / 2 * load[c, d] * choirs.modes[c, k, 0] * choirs.modes[c, k, 1]
                        old, fast = q[c, d, k], u[c, d, k] + kick
                        row = choirs.propagators[c, felt, k]
                        q[c, d, k] = row[0] * old + row[1] * fast
                        u[c, d, k] = row[2] * old + row[3] * fast
        # Servo, once in a controller sample.
        if not prescribed and i >= 0 and i % body.servo_every == 0:
            seen = np.round(xa / grain) * grain
            error = plan[now] + shift - seen
            summed += error * period
            rate = (seen - before) / period
            before = seen
            servo = bias + kp * error + ki * summed + kd * (plan_speed[now] - rate)
            servo += body.arm_mass * plan_acceleration[now]
        # Forces at the new positions.
        loss = 0.0
        energy = 0.5 * k_t * (xa - xt) ** 2
        inner = k_t * (xa - xt) + c_t * (va_half - vt_half)
        loss += c_t * (va_half - vt_half) ** 2
        down, down_speed = 0.0, 0.0
        rail, rail_speed, spin = 0.0, 0.0, half[a]
        for j in range(n):
            down -= body.at_press[j] * p[j]
            down_speed -= body.at_press[j] * half[j]
            rail -= body.at_rail[j] * p[j]
            rail_speed -= body.at_rail[j] * half[j]
        pressed = xt - down
        tip = 0.0
        if pressed > 0:
            spring = body.pad[0] * pressed ** body.pad[1]
            share = min(spring / 0.5, 1.0)
            tip = max(spring + share * body.pad[2] * (vt_half - down_speed), 0.0)
            loss += (tip - spring) * (vt_half - down_speed)
            energy += body.pad[0] * pressed ** (body.pad[1] + 1) / (body.pad[1] + 1)
        rail_force = 0.0
        if rail > 0:
            rail_force = max(body.rail[0] * rail + body.rail[1] * rail_speed, 0.0)
            loss += (rail_force - body.rail[0] * rail) * rail_speed
            energy += 0.5 * body.rail[0] * rail**2
        felt_force = 0.0
        deep = down - body.felt[2]
        if deep > 0:
            felt_force = max(body.felt[0] * deep + body.felt[1] * down_speed, 0.0)
            loss += (felt_force - body.felt[0] * deep) * down_speed
            energy += 0.5 * body.felt[0] * deep**2
        for j in range(n):
            total = (felt_force - tip) * body.at_press[j] + rail_force * body.at_rail[j]
            for k in range(n):
                total -= body.stiffness[j, k] * p[k] + body.damping[j, k] * half[k]
                loss += half[j] * body.damping[j, k] * half[k]
                energy += 0.5 * p[j] * body.stiffness[j, k] * p[k]
            force[j] = total
        moment = body.pivot[0] * _smooth_sign(spin, 1e-3) + body.pivot[1] * spin
        moment += body.pad[3] * tip * body.pad[4] * _smooth_sign(spin, 1e-3)
        loss += moment * spin
        energy -= body.gravity * p[a]
        force[a] += body.gravity - moment
        for c in range(count):
            arm, height, mass, k_c, c_c, rub, clearance = choirs.jack[c]
            surface = arm * p[a] ** 3 / 3 + height * p[a] ** 2 / 2
            lever = arm * p[a] ** 2 + height * p[a]
            surface_speed = lever * half[a]
            for j in range(n):
                surface += choirs.at_jack[c, j] * p[j]
                surface_speed += choirs.at_jack[c, j] * half[j]
            foot, pressed = 0.0, surface - y[c]
            if pressed > 0:
                foot = max(k_c * pressed + c_c * (surface_speed - vy[c]), 0.0)
                loss += (foot - k_c * pressed) * (surface_speed - vy[c])
                energy += 0.5 * k_c * pressed**2
            for j in range(n):
                force[j] -= foot * choirs.at_jack[c, j]
            force[a] -= foot * lever
            # Plectrum and string.
            stiff, length, x0, offset, friction = choirs.plectrum[c]
            h = y[c] - clearance
            old_load, old_gap = push[c], gap[c]
            push[c] = 0.0
            if choirs.string[c, 1] == 1.0:
                gap[c] = -h
            else:
                xs = x0 + choirs.string[c, 0] * load[c, 0]
                zs = offset - h + choirs.string[c, 0] * load[c, 1]
                for k in range(modes if touched[c] else 0):
                    xs += q[c, 0, k] * choirs.modes[c, k, 0]
                    zs += q[c, 1, k] * choirs.modes[c, k, 0]
                gap[c] = zs - offset
            load[c, 0] = load[c, 1] = 0.0
            tongue = 0.0
            if state[c] == BELOW or state[c] == HELD:
                if gap[c] <= 0:
                    if state[c] == BELOW and i >= 0:
                        state[c] = HELD
                        touched[c] = True
                        at = old_gap / (old_gap - gap[c]) if old_gap > 0 else 1.0
                        if found < events.shape[0]:
                            events[found, 0], events[found, 1] = c, 0
                            events[found, 2], events[found, 3] = (i - 1 + at) * dt, 0.0
                        found += 1
                        place[c] = 0.0
                    if choirs.string[c, 1] == 1.0:
                        top = choirs.static_height[c, -1]
                        away, was = h - top, -old_gap - top
                        push[c] = np.interp(h, choirs.static_height[c], choirs.static_load[c])
                    else:
                        w[c], s, theta = solve_contact(choirs.shapes[c], xs, zs, offset, w[c])
                        normal = stiff * w[c] / s**2
                        sine, cosine = np.sin(theta), np.cos(theta)
                        load[c, 0] = normal * (sine - friction * cosine)
                        load[c, 1] = normal * (cosine + friction * sine)
                        push[c] = load[c, 1]
                        away, was = s - length, place[c] - length
                        place[c] = s
                    if away >= 0:
                        at = was / (was - away) if was < 0 else 0.0
                        if found < events.shape[0]:
                            events[found, 0], events[found, 1] = c, 1
                            events[found, 2] = (i - 1 + at) * dt
                            events[found, 3] = old_load + at * (push[c] - old_load)
                        found += 1
                        state[c] = ABOVE
                        push[c] = load[c, 0] = load[c, 1] = 0.0
                        w[c] = 0.0
                elif state[c] == HELD:
                    state[c] = BELOW
                    w[c] = 0.0
                    if found < events.shape[0]:
                        events[found, 0], events[found, 1] = c, 2
                        events[found, 2], events[found, 3] = i * dt, 0.0
                    found += 1
            elif h < 0:
                state[c] = PASSING
                tongue = choirs.tongue[c, 0] * min(-h / 20e-6, 1.0)
                if -h > choirs.tongue[c, 1]:
                    state[c] = BELOW
                    gap[c] = max(gap[c], 1e-12)
            else:
                state[c] = ABOVE
            felt = max(choirs.damper[c, 0] * (choirs.damper[c, 1] - y[c]), 0.0)
            energy += 0.5 * felt**2 / choirs.damper[c, 0] if choirs.damper[c, 0] > 0 else 0.0
            rubbed = rub * _smooth_sign(vy[c], 1e-4)
            loss += rubbed * vy[c]
            energy += mass * 9.81 * y[c]
            ay[c] = (foot - push[c] - rubbed + tongue + felt) / mass - 9.81
        # Second half of the kick.
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += body.inverse_mass[j, k] * force[k]
            acc[j] = total
            v[j] = half[j] + dt / 2 * total
        acceleration_t = (inner - tip) / m_t
        vt = vt_half + dt / 2 * acceleration_t
        torque = torque + (servo - torque) * dt / lag if i >= 0 else servo
        acceleration_a = (torque - inner) / body.arm_mass
        va = va_half + dt / 2 * acceleration_a
        for c in range(count):
            vy[c] += dt / 2 * ay[c]
            if choirs.string[c, 1] == 0.0:
                for d in range(2):
                    if load[c, d] != 0.0:
                        for k in range(modes):
                            u[c, d, k] += (
                                dt / 2 * load[c, d] * choirs.modes[c, k, 0] * choirs.modes[c, k, 1]
                            )
        if i < 0:
            va *= ease
            vt *= ease
            for j in range(n):
                v[j] *= ease
            for c in range(count):
                vy[c] *= ease
            if i == -1:
                bias, torque, acceleration_a, shift, before = inner, inner, 0.0, xa - plan[0], xa
                va = vt = 0.0
                for j in range(n):
                    v[j] = 0.0
                for c in range(count):
                    vy[c] = 0.0
            continue
        if i == 0:
            first = energy
        drive = inner if prescribed else torque
        work += dt * drive * va_half
        lost += dt * loss
        seen = 0.0
        for j in range(n):
            seen -= body.at_laser[j] * v[j]
        out[0, i], out[1, i] = seen, inner
        out[2, i] = energy
        for c in range(count):
            out[3 + 3 * c, i], out[4 + 3 * c, i], out[5 + 3 * c, i] = y[c], vy[c], push[c]
    # Kinetic energy, and the strings', at the end.
    energy += 0.5 * m_t * vt**2
    if not prescribed:
        energy += 0.5 * body.arm_mass * va**2
    mass = np.linalg.inv(body.inverse_mass)
    for j in range(n):
        for k in range(n):
            energy += 0.5 * v[j] * mass[j, k] * v[k]
    for c in range(count):
        energy += 0.5 * choirs.jack[c, 2] * vy[c] ** 2
    return found, work, lost, first, energy, q, u
