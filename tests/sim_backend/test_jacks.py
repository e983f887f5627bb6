"""Jacks that stand, fly and land, against closed forms."""

import math

import numpy as np
import pytest

from sautereau.sim_backend.physics.drive import drive_of
from sautereau.sim_backend.physics.observation import errors, observe, reference
from sautereau.sim_backend.physics.world import new_world
from sautereau.sim_backend.scene import packaged_scenes
from tests.budget import slow
from tests.key_oracle import rise, static_moment
from tests.sim_backend.scenes import RIG, push_of, scene_of

KEY, JACK = RIG.key, RIG.jack


def thrown(force, duration, rest, **changes):
    return scene_of("free-key", push=push_of(force, duration, rest), **changes)


FLIES = thrown(0.8, 15e-3, 150e-3, truth={"key.gravity_moment": "-50 mN m"})
"""A key with a large gravity moment to the back, which falls twice as fast as a jack."""
LANDS = thrown(
    0.3, 45e-3, 85e-3, felt=True,
    truth={"key.felt_damping": "60 N s/m", "key.gravity_moment": "-8 mN m"},
)  # fmt: skip
"""The felt stops the key; the jack flies on and lands on a key that falls back slowly."""
STEPS = (1e-4, 1e-3)  # s, with which nothing overlaps however far the jack flies


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
    assert steps[inside].max() <= 0.1 / omega * 1.3
    assert np.median(steps[~inside]) > 1.9e-4
    np.testing.assert_allclose(
        moved.angle, np.interp(moved.time, fine.time, fine.angle), rtol=0, atol=5e-6
    )


@pytest.mark.parametrize("name", ["pluck", "free-key", "return", "two-choirs", slow("ideal")])
def test_packaged_scenes_agree_with_the_reference(name):
    agree(scene_of(name), 3e-7)


@pytest.mark.parametrize("scene", [FLIES, LANDS], ids=["flies", "lands"])
def test_a_jack_in_flight_agrees_with_the_reference(scene):
    """Whose flight is ballistic, and whose landing conserves momentum (test_exact.py)."""
    moved = agree(scene, 2e-6)
    assert np.max(moved.rise - rise(KEY, moved.angle)) > 1e-4


def agree(scene, most):
    """Compare all motion and all events with the reference's; `most` is in rad and m."""
    drive = drive_of(RIG, scene)
    found, true = observe(RIG, scene, drive), reference(RIG, scene, drive)
    error = errors(found, true)
    if true.events.contacts:  # else it is that of the motion, which follows
        assert error.time < 0.2e-6
    assert error.force < 1e-4
    moved, exact = found.motions, true.motions
    for name in ("angle", "rise"):
        expected = np.interp(moved.time, exact.time, getattr(exact, name))
        np.testing.assert_allclose(getattr(moved, name), expected, rtol=0, atol=most)
    return moved


@pytest.mark.parametrize(
    "scene",
    [*map(scene_of, packaged_scenes()), *(FLIES.model_copy(update={"step": s}) for s in STEPS)],
    ids=[*packaged_scenes(), *(f"thrown in steps of {s} s" for s in STEPS)],
)
def test_joints_and_contacts_hold(scene):
    drive = drive_of(RIG, scene)
    world = new_world(RIG, scene, drive.start)
    for i in range(drive.samples):
        world.advance(drive.reference(i), True)
    assert world.worst_gap < 1e-6
