"""Numerical derivatives, and presses recomputed by brute force."""

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from sautereau.rig.units import GRAVITY

# Coefficients of the central difference of eighth order, for offsets 1 to 4.
FIRST = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
SECOND = (8 / 5, -1 / 5, 8 / 315, -1 / 560)
RATE = 1e5  # Hz, sampling rate of the brute-force checks


def derivatives(function, x, step):
    """Return f' and f'' by central differences of eighth order."""
    ahead = [function(x + k * step) for k in range(1, 5)]
    behind = [function(x - k * step) for k in range(1, 5)]
    first = sum(c * (a - b) for c, a, b in zip(FIRST, ahead, behind, strict=True))
    here = function(x)
    second = sum(c * (a - here + (b - here)) for c, a, b in zip(SECOND, ahead, behind, strict=True))
    return first / step, second / step**2


def close(actual, expected, tolerance):
    """Assert that arrays agree, relative to the largest value."""
    scale = np.abs(expected).max()
    assert np.abs(actual - expected).max() <= tolerance * max(scale, 1e-300)


def spline(segments, period):
    """Return the cubic through segments' integers, by scipy; counts."""
    times = np.concatenate([[0], np.cumsum(segments.samples)]) * period
    positions = segments.start + np.vstack([[0, 0], np.cumsum(segments.steps, axis=0)])
    return CubicHermiteSpline(times, positions, np.vstack([[0, 0], segments.velocities]))


def _place(arm, q):
    """Return elbow and fingertip."""
    elbow = np.stack([np.cos(q[..., 0]), np.sin(q[..., 0])]) * arm.upper_length
    total = q[..., 0] + q[..., 1]
    elbow += np.array([arm.base_x, arm.base_z]).reshape(2, *[1] * total.ndim)
    return elbow, elbow + np.stack([np.cos(total), np.sin(total)]) * arm.lower_length


def _angle_under(rig, x, z):
    """Return the angle of a key in contact with a fingertip: R cos(a - f) = H."""
    height = rig.key.surface_height + rig.arm.fingertip_radius
    return np.arctan2(-x, z) - np.arccos(np.minimum(height / np.hypot(x, z), 1.0))


def _rise(key, angle):
    return key.jack_arm * np.tan(angle) + key.jack_surface_height * (1 / np.cos(angle) - 1)


def true_cruise_error(rig, plan):
    """Compare the jack's speed, by differences along the joints' velocity, with the plan's."""
    start, end, press = plan.cruise.start, plan.cruise.end, rig.press
    curve = spline(plan.segments, rig.controller.sample_period)
    t = np.linspace(start, end, int((end - start) * RATE) + 2)
    turn, step = 2 * np.pi / rig.arm.counts_per_revolution, 1e-6
    rises = []
    for side in (-1, 1):
        _, (x, z) = _place(rig.arm, (curve(t) + side * step * curve(t, 1)) * turn)
        rises.append(_rise(rig.key, _angle_under(rig, x, z)))
    planned = np.full_like(t, press.jack_speed)
    if press.gesture is not None:
        played = CubicSpline(press.gesture.time, press.gesture.rise, bc_type="clamped")
        planned = played(np.clip(t - press.settle, 0, press.gesture.time[-1]), 1)
    return np.abs((rises[1] - rises[0]) / (2 * step) - planned).max() / np.abs(planned).max()


def _torques(arm, q, v, a, x_force, z_force):
    """Newton and Euler, rod by rod: I alpha + r x m (a - g) about each joint."""
    total, alpha, omega = q.sum(-1), a.sum(-1), v.sum(-1)
    c1, s1, c2, s2 = np.cos(q[:, 0]), np.sin(q[:, 0]), np.cos(total), np.sin(total)
    l1, l2, m1, m2 = arm.upper_length, arm.lower_length, arm.upper_mass, arm.lower_mass
    elbow_x = l1 * (-s1 * a[:, 0] - c1 * v[:, 0] ** 2)
    elbow_z = l1 * (c1 * a[:, 0] - s1 * v[:, 0] ** 2)
    push_x = m2 * (elbow_x + l2 / 2 * (-s2 * alpha - c2 * omega**2))
    push_z = m2 * (elbow_z + l2 / 2 * (c2 * alpha - s2 * omega**2) + GRAVITY)
    about_elbow = m2 * l2**2 / 12 * alpha + l2 / 2 * (c2 * push_z - s2 * push_x)
    about_elbow -= l2 * (c2 * z_force - s2 * x_force)
    upper = m1 * l1**2 / 3 * a[:, 0] + m1 * GRAVITY * l1 / 2 * c1
    about_base = upper + about_elbow + l1 * (c1 * (push_z - z_force) - s1 * (push_x - x_force))
    rotor = np.array(arm.rotor_inertias) * np.array(arm.gear_ratios) ** 2
    return np.abs(np.stack([about_base, about_elbow], -1) + rotor * a).max(axis=0)


def _inertia_about_the_pin(rig):
    jacks = [(rig.key.jack_arm, rig.jack), *((c.jack_arm, c.jack) for c in rig.more_choirs)]
    return rig.key.inertia + sum(jack.mass * arm**2 for arm, jack in jacks)


def _accelerations(rig, q, v, a, x, z):
    """Return the key's angular acceleration [rad/s^2], by differences along parabolas."""
    step, around = 1e-4, []
    for side in (-1, 1):
        _, (x1, z1) = _place(rig.arm, q + side * step * v + step**2 / 2 * a)
        around.append(_angle_under(rig, x1, z1))
    return (around[0] - 2 * _angle_under(rig, x, z) + around[1]) / step**2


def _depth(rig, x, z):
    angle, key = np.maximum(_angle_under(rig, x, z), 0.0), rig.key
    front = -key.press_arm * np.sin(angle) + key.surface_height * np.cos(angle)
    return float((key.surface_height - front).max())


def brute(rig, plan, expected=None):
    """Return the least or largest value of each check, by its name, from the integers alone."""
    arm, key, period = rig.arm, rig.key, rig.controller.sample_period
    parts = []
    for segments in (plan.approach, plan.segments, plan.retreat):
        curve = spline(segments, period)
        ends = np.unique(np.concatenate([curve.x[:-1], curve.x[1:] * (1 - 1e-13)]))
        t = np.union1d(np.arange(0, curve.x[-1], 1 / RATE), ends)
        count = 2 * np.pi / arm.counts_per_revolution
        parts.append([curve(t, order) * count for order in range(4)])
    pressing = np.repeat([False, True, False], [len(part[0]) for part in parts])
    q, v, a, j = (np.concatenate(each) for each in zip(*parts, strict=True))
    (_, elbow), (x, z) = _place(arm, q)
    angle = np.maximum(_angle_under(rig, x, z), 0.0)
    along = (-x * np.cos(angle) - z * np.sin(angle))[pressing]
    force = np.zeros(len(q))
    if expected is not None:
        force = _inertia_about_the_pin(rig) * _accelerations(rig, q, v, a, x, z) / key.press_arm
        force = force + np.interp(_rise(key, angle), expected.rise, expected.force)
        force = np.where(pressing, np.maximum(force, 0.0), 0.0)
    torque = _torques(arm, q, v, a, -force * np.sin(angle), force * np.cos(angle))
    away = np.hypot(x - arm.base_x, z - arm.base_z)
    reach = min(
        arm.upper_length + arm.lower_length - away.max(),
        away.min() - abs(arm.upper_length - arm.lower_length),
    )
    link = np.stack([np.cos(q.sum(-1)), np.sin(q.sum(-1))])
    inward = np.stack([np.sin(angle), -np.cos(angle)])
    across = link[0] * inward[1] - link[1] * inward[0]
    lean = np.abs(np.arctan2(across, (link * inward).sum(axis=0)))[pressing]
    bend = q[:, 1] * (-1 if arm.elbow == "up" else 1)
    # A stop: each joint decelerates independently, from up to 3,000 points of the motion.
    some = slice(None, None, max(1, len(q) // 3000))
    start, speed = q[some], v[some]
    t = np.linspace(0, np.abs(speed).max() / arm.acceleration_limit, 33)[:, None, None]
    t = np.minimum(t, np.abs(speed) / arm.acceleration_limit)
    stop = start + speed * t - np.sign(speed) * arm.acceleration_limit * t**2 / 2
    _, (stop_x, stop_z) = _place(arm, stop)
    spare = min((stop - arm.lower_limits).min(), (arm.upper_limits - stop).min())
    found = {
        "reach": reach,
        "singularity": min(bend.min(), np.pi - bend.max()),
        "contact on the key": min(along.min(), key.front_arm - along.max()),
        "clearance of the hovering fingertip": min(z[0], z[-1]) - arm.fingertip_radius,
        "tilt of the finger": lean.max(),
        "clearance of the elbow": elbow.min(),
        "depth of the key": _depth(rig, x, z),
        "depth of the key after a stop": _depth(rig, stop_x, stop_z),
        "joint margin after a stop": spare,
        "cruise speed error": true_cruise_error(rig, plan),
        "segments, with the end": 1 + max(map(len, (plan.approach, plan.segments, plan.retreat))),
    }
    for n in (0, 1):
        found[f"joint {n + 1} lower limit"] = q[:, n].min()
        found[f"joint {n + 1} upper limit"] = q[:, n].max()
        found[f"joint {n + 1} speed"] = np.abs(v[:, n]).max()
        found[f"joint {n + 1} acceleration"] = np.abs(a[:, n]).max()
        found[f"joint {n + 1} jerk"] = np.abs(j[:, n]).max()
        found[f"joint {n + 1} torque"] = torque[n]
        for place, angles in (("home", arm.home_angles), ("rest above the key", q[0])):
            weight = _torques(arm, np.array([angles]), *np.zeros((2, 1, 2)), 0.0, 0.0)
            found[f"joint {n + 1} torque, at {place}"] = weight[n]
    return found
