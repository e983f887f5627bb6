"""Jacks that stand, fly and land, against closed forms."""

import math

import numpy as np
import pytest

from sautereau.rig.section import GRAVITY
from sautereau.sim_backend.physics.drive import drive_of
from sautereau.sim_backend.physics.observation import errors, observe
from sautereau.sim_backend.physics.reference.observe import reference
from sautereau.sim_backend.physics.rigid.assembly import RESOLVED
from sautereau.sim_backend.physics.world import new_world
from sautereau.sim_backend.scene import packaged_scenes
from tests.key_oracle import rise, slope, static_moment
from tests.sim_backend.scenes import RIG, push_of, scene_of

KEY, JACK = RIG.key, RIG.jack


def thrown(force, duration, rest, **changes):
    return scene_of("free-key", push=push_of(force, duration, rest), **changes)


THROWN = thrown(0.8, 15e-3, 150e-3, truth={"key.gravity_moment": "-50 mN m"})
"""A key with a large gravity moment to the back, which falls twice as fast as a jack."""
STEPS = (1e-4, 1e-3)
"""s, with which nothing overlaps however far the jack flies."""


def test_a_jack_above_a_faster_key_flies():
    moved = observe(RIG, THROWN).motions
    gap = moved.rise - rise(KEY, moved.angle)
    assert gap.min() > -1e-9
    air = np.flatnonzero(gap > 1e-5)
    assert len(air) > 200
    first, last = air[0], air[-1]
    assert np.all(np.diff(air) == 1)
    time = moved.time[first : last + 1] - moved.time[first]
    flight = np.polyfit(time, moved.rise[first : last + 1], 2)
    assert 2 * flight[0] == pytest.approx(-GRAVITY, rel=1e-6)
    np.testing.assert_allclose(np.polyval(flight, time), moved.rise[first : last + 1], atol=2e-9)
    # The key alone, until it is on its rail.
    up = (moved.angle > 1e-3) & (gap > 1e-5)
    alone = np.polyfit(moved.time[up], moved.angle[up], 2)
    assert 2 * alone[0] == pytest.approx(-0.050 / KEY.inertia, rel=1e-5)
    assert moved.rise[-1] == pytest.approx(0, abs=1e-12)


def test_landing_conserves_momentum():
    """The felt stops the key; the jack flies on and lands on a key that falls back slowly."""
    truth = {"key.felt_damping": "60 N s/m", "key.gravity_moment": "-8 mN m"}
    moved = observe(RIG, thrown(0.3, 45e-3, 85e-3, truth=truth, felt=True)).motions
    gap = moved.rise - rise(KEY, moved.angle)
    flying = gap > 1e-9
    (landed,) = np.flatnonzero(flying[:-1] & ~flying[1:]) + 1
    assert moved.angle[landed] > 0.01
    before = slice(landed - 8, landed)
    time = moved.time[before] - moved.time[landed]
    jack = np.polyval(np.polyder(np.polyfit(time, moved.rise[before], 2)), 0.0)
    omega = np.polyval(np.polyfit(time, moved.angular_velocity[before], 1), 0.0)
    by_angle = slope(KEY, moved.angle[landed])
    together = KEY.inertia + JACK.mass * by_angle**2
    momentum = KEY.inertia * omega + JACK.mass * by_angle * jack
    assert by_angle * omega - jack > 0.05
    assert moved.angular_velocity[landed] == pytest.approx(momentum / together, rel=1e-3)
    # Afterwards the jack stands on the key.
    after = slice(landed, landed + 50)
    np.testing.assert_allclose(gap[after], 0, atol=1e-9)


def test_a_damper_carries_part_of_the_jack():
    """Below its lift the key needs less force by that amount."""
    damper = JACK.damper
    carried = damper.stiffness * damper.lift
    needed = static_moment(RIG, string=-carried) / KEY.press_arm
    for factor, moves in ((0.999, False), (1.001, True)):
        scene = thrown(needed * factor, 40e-3, 0.0, damper=True)
        moved = observe(RIG, scene).motions
        assert (moved.angle[-1] > 1e-9) == moves


def test_a_stiff_felt_divides_the_step():
    """100 times as stiff: the result is that of fine steps throughout."""
    truth = {"key.felt_stiffness": "2000 kN/m", "key.felt_damping": "0 N s/m"}
    scene = thrown(0.4, 70e-3, 0.0, truth=truth, felt=True, step=2e-4)
    moved = observe(RIG, scene).motions
    fine = observe(RIG, scene.model_copy(update={"step": 5e-6})).motions
    felt = moved.angle > KEY.dip / KEY.press_arm
    omega = math.sqrt(2e6 * KEY.press_arm**2 / KEY.inertia)
    steps = np.diff(moved.time)
    inside = felt[:-1] & felt[1:]
    assert inside.sum() > 10
    assert steps[inside].max() <= RESOLVED / omega * 1.3
    assert np.median(steps[~inside]) > 1.9e-4
    np.testing.assert_allclose(
        moved.angle, np.interp(moved.time, fine.time, fine.angle), rtol=0, atol=5e-6
    )


@pytest.mark.parametrize(
    "name",
    ["pluck", "free-key", "return", "two-choirs", pytest.param("ideal", marks=pytest.mark.slow)],
)
def test_packaged_scenes_agree_with_the_reference(name):
    scene = scene_of(name)
    drive = drive_of(RIG, scene)
    found = errors(observe(RIG, scene, drive), reference(RIG, scene, drive))
    assert found.time < 0.2e-6
    assert found.force < 1e-4


@pytest.mark.parametrize(
    "scene",
    [*map(scene_of, packaged_scenes()), *(THROWN.model_copy(update={"step": s}) for s in STEPS)],
    ids=[*packaged_scenes(), *(f"thrown in steps of {s} s" for s in STEPS)],
)
def test_joints_and_contacts_hold(scene):
    drive = drive_of(RIG, scene)
    world = new_world(RIG, scene, drive.start)
    for i in range(drive.samples):
        world.advance(drive.reference(i), True)
    assert world.worst_gap < 1e-6
