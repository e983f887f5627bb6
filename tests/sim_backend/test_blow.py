"""The blow of a finger that hits the key: its force over time is the momentum that it transfers."""

import numpy as np
import pytest

from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.physics.world import new_world
from sautereau.trajectory.arm import fingertip_place
from sautereau.trajectory.press import plan_press
from tests.sim_backend.scenes import BARE, RIG, scene_of

PLAN = plan_press(RIG)
HOVER, PLACED = (counts * RIG.arm.radians_per_count for counts in (PLAN.hover, PLAN.segments.start))
BEFORE, SAMPLES = 5, 35  # Samples of the controller before the blow, and all


def random_hit(seed):
    """Return a bench, its finger and the fingertip's speed above the key [m/s]."""
    random = np.random.default_rng(seed)
    inertia, mass = (value * 10 ** random.uniform(-1, 1) for value in (7e-4, 6e-3))
    weight = mass * GRAVITY * RIG.key.jack_arm * random.uniform(-1, 0.9)
    values = {"key.inertia": inertia, "jack.mass": mass, "key.gravity_moment": weight}
    rig = RIG.replaced(values)
    return rig, ("ideal", "paper")[seed % 2], random.uniform(0.02, 0.3)


def played(engine, rig, finger, speed, step=20e-6):
    """Let the fingertip hit and move the key; return the world, its rows and the reaches [m]."""
    ends = fingertip_place(rig.arm, np.array([HOVER, PLACED]))
    period = rig.controller.sample_period
    turn = (PLACED - HOVER) / np.linalg.norm(ends[1] - ends[0]) * speed * period
    above, reaches = PLACED - BEFORE * turn, []
    world = new_world(rig, scene_of(finger, engine=engine, step=step, **BARE), tuple(above))
    turn /= rig.arm.radians_per_count

    def reference(fractions, start):
        return np.outer(start + fractions, turn), np.tile(turn, (len(fractions), 1))

    parts = []
    for i in range(SAMPLES):
        parts.append(world.advance(lambda fractions, i=i: reference(fractions, i), True))
        x, z = fingertip_place(rig.arm, np.array(world.finger.joints()))
        angle = parts[-1].angle[-1]
        reaches.append(-(x * np.cos(angle) + z * np.sin(angle)))
    rows = {name: np.concatenate([getattr(p, name) for p in parts]) for name in vars(parts[0])}
    times = period * np.arange(1.0, SAMPLES + 1)
    return world, rows, np.interp(rows["time"], times, reaches)


def transferred(rig, rows):
    """Return the key's and the jack's moments of momentum, and what gravity took of it [N m s].

    With the jack's force on the key m (v' + g), in parts: int s v' dt = s v - int v ds.
    """
    time, angle, rise = rows["time"], rows["angle"], rows["rise"]
    height, mass = rig.key.jack_surface_height, rig.jack.mass
    slope = (rig.key.jack_arm + height * np.sin(angle)) / np.cos(angle) ** 2
    dt, moved = np.diff(time), angle[1:] > 0
    on = (dt > 0) & moved
    speed = np.diff(rise)[on] / dt[on]
    middle = (slope[1:] + slope[:-1])[on] / 2
    weight = rig.key.gravity_moment - mass * GRAVITY * middle
    bent = np.sum(mass * speed * np.diff(slope)[on])
    momentum = rig.key.inertia * rows["angular_velocity"][-1] + mass * slope[-1] * speed[-1]
    return momentum - bent - np.sum(weight * dt[on])


@pytest.mark.parametrize("seed", range(12))
def test_the_force_over_time_is_the_momentum_transferred(seed):
    """Of random keys, jacks and speeds: finger, key and jack meet once or several times."""
    rig, finger, speed = random_hit(seed)
    _, rows, reach = played("exact", rig, finger, speed)
    moving = rows["angle"] > 0
    assert moving[-1]
    assert np.diff(moving).sum() == 1  # no blow of the rail
    given = np.trapezoid((rows["finger_force"] + rows["blow"]) * reach, rows["time"])
    assert np.trapezoid(rows["blow"] * reach, rows["time"]) > 0.05 * given
    assert given == pytest.approx(transferred(rig, rows), rel=1e-4)


@pytest.mark.parametrize("steps", [2, 10, 100])
def test_the_impulse_does_not_depend_on_the_step_but_its_force_does(steps):
    step = RIG.controller.sample_period / steps
    rig, finger, speed = random_hit(1)
    _, rows, _ = played("exact", rig, finger, speed, step)
    _, fine, _ = played("exact", rig, finger, speed, 5e-6)
    impulse = np.trapezoid(fine["blow"], fine["time"])
    assert np.trapezoid(rows["blow"], rows["time"]) == pytest.approx(impulse, rel=1e-6)
    on = rows["blow"] > 0
    first = rows["time"][on][0]
    struck = fine["time"][fine["blow"] > 0][0]
    assert -6e-6 < first - struck <= step
    assert rows["blow"].max() <= impulse / step * (1 + 1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_the_rigid_bodies_transfer_the_same_momentum(seed):
    """They share no line of the impact: pymunk's solver finds it."""
    rig, finger, speed = random_hit(seed)
    found = []
    for engine in ("exact", "rigid"):
        _, rows, _ = played(engine, rig, finger, speed)
        given = rows["blow"], rows["finger_force"] + rows["blow"]
        found.append([np.trapezoid(force, rows["time"]) for force in given])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-3)
