"""Impacts of key, jacks and rail in the rigid-body engine, without rebound, in closed form."""

import math
from itertools import product

import numpy as np
import pytest

from benchmarks.extreme_cases import mass_ratio
from sautereau.rig.load import with_values
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.events import PluckEvents
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.physics.rigid.assembly import assemble
from tests.key_oracle import GRAVITY, rise, slope
from tests.sim_backend.scenes import BARE, RIG, choir, push_of, scene_of

RATIOS = (1e-4, 1e-2, 1.0, 10.0, 100.0, 1e4)  # m b^2 / I of all jacks together
MS = 1e3  # ms/s


def after_impact(inertia, masses, slopes, omega, speeds, rail):
    """Return velocities of key and jacks after a perfectly inelastic impact.

    Of all choices of jacks that move with the key, and of whether the rail stops it, it is the one
    that conserves momentum, pulls nothing and lets nothing overlap.
    """
    for held, moved in product(
        (False, True) if rail else (False,), product((0, 1), repeat=len(masses))
    ):
        moved = np.array(moved)
        total = inertia + np.sum(moved * masses * slopes**2)
        common = (
            0.0 if held else (inertia * omega + np.sum(moved * masses * slopes * speeds)) / total
        )
        after = np.where(moved, slopes * common, speeds)
        pushed = masses * (after - speeds)  # N s on each jack
        stopped = inertia * (common - omega) + np.sum(slopes * pushed)  # N m s of the rail
        fits = np.all(pushed >= -1e-15) and np.all(after >= slopes * common - 1e-15)
        if fits and stopped >= -1e-15 and common >= (0.0 if rail else -math.inf):
            return common, after
    raise AssertionError("no impact")


@pytest.mark.parametrize("step", [1e-5, 1e-4, 1e-3])
@pytest.mark.parametrize("ratio", RATIOS)
def test_an_impact_conserves_momentum_and_has_no_rebound(ratio, step):
    """One to three jacks of different masses, on a key that is in the air or on its rail."""
    rng = np.random.default_rng(1)
    for jacks, rail in product((1, 2, 3), (False, True)):
        masses = rng.uniform(0.2, 1.0, jacks)
        arms = RIG.key.jack_arm * np.array([1.0, 0.95, 0.9])[:jacks]
        masses *= ratio * RIG.key.inertia / np.sum(masses * arms**2)
        first: dict[str, str | float] = {"jack.mass": f"{float(masses[0])!r} kg"}
        rig = with_values(RIG, first | {"key.gravity_moment": "0 N m"})
        more = tuple(choir(a, 3e-3, m) for a, m in zip(arms[1:], masses[1:], strict=True))
        rig = rig.model_copy(update={"more_choirs": more})
        scene = scene_of("free-key", step=step, **BARE)
        parts = assemble(rig, scene, rig.arm.home_angles, PluckEvents())
        angle = 0.0 if rail else 0.02
        parts.key.body.angle = angle
        slopes = np.array([slope(rig.key.model_copy(update={"jack_arm": a}), angle) for a in arms])
        omega, speeds = rng.uniform(-1.0, 1.0), rng.uniform(-0.2, 0.2, jacks)
        parts.key.body.angular_velocity = omega / MS
        parts.key.body.angle = angle - omega * step  # the engine moves the bodies first
        for jack, speed in zip(parts.jacks, speeds, strict=True):
            jack.value = jack.next = jack.surface(angle)
            jack.speed = speed
            jack.set_bodies(step * MS, 0.0)
        parts.kick(step * MS, 0.0)
        common, after = after_impact(rig.key.inertia, masses, slopes, omega, speeds, rail)
        found = np.array([jack.body.velocity[1] for jack in parts.jacks])
        assert parts.key.body.angular_velocity * MS == pytest.approx(common, abs=1e-6)
        np.testing.assert_allclose(found, after, rtol=0, atol=1e-7)


@pytest.mark.parametrize("step", [1e-4, 1e-3])
@pytest.mark.parametrize("ratio", [1.0, 30.0, 1e4])
def test_a_key_that_falls_on_its_rail_stays_there(ratio, step):
    """With its jack, which falls by several millimetres."""
    rig = with_values(RIG, mass_ratio(RIG, 1 / ratio))
    key, mass = rig.key, rig.jack.mass
    moment = mass * (GRAVITY + 20.0) * key.jack_arm - key.gravity_moment
    push = push_of(moment / key.press_arm, 0.02, 0.25)
    moved = observe(rig, scene_of("free-key", push=push, step=step)).motions
    top = int(np.argmax(moved.rise))
    landed = top + int(np.flatnonzero(moved.rise[top:] < 1e-9)[0])
    assert moved.rise[top] > 5e-3
    assert np.abs(moved.rise[landed:]).max() < 1e-8
    np.testing.assert_allclose(moved.rise, rise(key, moved.angle), rtol=0, atol=1e-9)


def test_jacks_that_are_too_heavy_are_refused():
    rig = with_values(RIG, mass_ratio(RIG, 1e-5))
    with pytest.raises(SceneError, match=r"jack\.mass: .* 1e\+05 times .*lower the masses"):
        observe(rig, scene_of("free-key"))
