"""Forces on finger and key: pad, rail, front felt, friction, and the key's own elasticity."""

import numpy as np

from .compiled import compiled


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
