"""Play at the balance pin, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.parts import Fingertip, Play
from sautereau.sim_backend.physics.observation import errors, observe
from sautereau.sim_backend.physics.world import new_world
from sautereau.sim_backend.scene import Scene
from tests.sim_backend.scenes import BARE, MUTE, RIG, at_rest, push_of, pushed, scene_of
from tests.sim_backend.test_fingertip import overlapping

KEY, JACK = RIG.key, RIG.jack
LOAD = (JACK.mass * GRAVITY * KEY.jack_arm - KEY.gravity_moment) / KEY.press_arm
"""N, of a finger that holds the key up."""
PAD = Fingertip.model_construct(stiffness=3e5, damping=15.0)


def play(stiffness, damping=0.0, clearance=0.5e-3, mass=0.05):
    return Play.model_construct(
        stiffness=stiffness, damping=damping, clearance=clearance, mass=mass
    )


def heights(motions):
    """Return angle [rad] and height [m] of the key, by the laser and a jack that stands on it."""
    angle = np.arctan(motions.rise / KEY.jack_arm)
    for _ in range(30):
        height = (angle - motions.angle) * KEY.laser_arm
        surface = KEY.jack_surface_height * (1 / np.cos(angle) - 1)
        angle = np.arctan((motions.rise - height - surface) / KEY.jack_arm)
    return angle, (angle - motions.angle) * KEY.laser_arm


@pytest.mark.parametrize("damping", [0.0, 0.3])
@pytest.mark.parametrize(("stiffness", "mass"), [(1e4, 0.03), (1e6, 0.05), (1e5, 0.2)])
def test_a_sudden_push_makes_the_key_oscillate_on_its_felt(stiffness, mass, damping):
    """Without gravity: one coordinate of constant acceleration, and a damped oscillator."""
    matrix = np.array(
        [
            [KEY.inertia + JACK.mass * KEY.jack_arm**2, JACK.mass * KEY.jack_arm],
            [JACK.mass * KEY.jack_arm, mass + JACK.mass],
        ]
    )
    mobility = np.linalg.inv(matrix)
    w = np.sqrt(stiffness * mobility[1, 1])
    push = 1e-3
    loads = np.array([push * KEY.press_arm, -push])
    felt = play(stiffness, 2 * damping * w / mobility[1, 1], mass=mass)
    scene = scene_of("free-key", step=20e-6, gravity=0.0, play=felt, push=push_of(push, 9e-3))
    motions = observe(RIG, scene).motions
    part = motions.time < min(9e-3, 8 / w)
    time = motions.time[part]
    # Of the height: z'' = (M^-1 loads)_z - w^2 z - 2 zeta w z'; the felt's force is -(k z + c z').
    low = (mobility @ loads)[1] / w**2
    wd, decay = w * np.sqrt(1 - damping**2), np.exp(-damping * w * time)
    height = low * (1 - decay * (np.cos(wd * time) + damping * w / wd * np.sin(wd * time)))
    # What no force of the felt changes: (M (a, z))_a, whose acceleration is the push's moment.
    turned = loads[0] * time**2 / 2 - matrix[0, 1] * height
    found_angle, found_height = heights(motions)
    np.testing.assert_allclose(found_height[part], height, atol=6e-3 * abs(low))
    np.testing.assert_allclose(
        found_angle[part], turned / matrix[0, 0], atol=6e-3 * abs(low) / KEY.press_arm
    )
    speed = low * decay * w**2 / wd * np.sin(wd * time)
    rate = (loads[0] * time - matrix[0, 1] * speed) / matrix[0, 0]
    seen = rate - speed / KEY.laser_arm
    np.testing.assert_allclose(motions.angular_velocity[part], seen, atol=8e-3 * abs(seen).max())


@pytest.mark.parametrize("clearance", [0.5e-3, 0.02e-3])
def test_a_held_key_sinks_by_the_load_over_the_stiffness_down_to_the_rail(clearance):
    felt = play(1e4, 20.0, clearance)
    scene = pushed(1.0, 0.5, engine="rigid", play=felt, step=2e-4).model_copy(
        update={**MUTE, "friction": False}
    )
    motions = observe(RIG, scene).motions
    _, height = heights(motions)
    # The finger's force less that of the front felt balances the jack; the pin carries both.
    assert height[-1] == pytest.approx(-min(LOAD / felt.stiffness, clearance), rel=1e-2)
    depth = motions.angle[-1] * KEY.laser_arm + height[-1]
    depth = depth / KEY.laser_arm * KEY.press_arm - height[-1]
    assert (depth - KEY.dip) * KEY.felt_stiffness == pytest.approx(1.0 - LOAD, rel=1e-2)
    assert height.min() > -clearance - 1e-8


def test_without_damping_no_energy_is_made_or_lost():
    """From the push to the key's rotation, its height, the jack, and the felt under it."""
    felt = play(5e4)
    scene = scene_of("free-key", step=10e-6, play=felt, push=push_of(0.8, 12e-3))
    motions = observe(RIG, scene).motions
    _, kept = np.unique(motions.time[motions.time < 12e-3], return_index=True)
    motions = replace(motions, **{name: part[kept] for name, part in vars(motions).items()})
    angle, height = heights(motions)
    speed = np.gradient(height, motions.time)
    rate = motions.angular_velocity + speed / KEY.laser_arm
    rise = np.gradient(motions.rise, motions.time)
    kinetic = (KEY.inertia * rate**2 + felt.mass * speed**2 + JACK.mass * rise**2) / 2
    carried = JACK.mass * GRAVITY
    stored = felt.stiffness * height**2 / 2 - carried * height + JACK.mass * GRAVITY * motions.rise
    work = 0.8 * (KEY.press_arm * angle - height) + KEY.gravity_moment * angle
    part = slice(5, -5)  # off the ends of the differences
    balance = (work - kinetic - stored)[part]
    assert (felt.stiffness * height**2).max() > 2e-2 * work.max()
    assert np.abs(balance).max() < 2e-3 * work.max()


def test_a_pad_presses_key_and_felt_together():
    """A fingertip that stands within the key at rest: pad and felt carry the load."""
    felt, pad, inside = (
        play(2e4, 20.0),
        Fingertip.model_construct(stiffness=1e4, damping=10.0),
        5e-5,
    )
    scene = scene_of("ideal", **BARE, engine="rigid", step=50e-6, fingertip=pad, play=felt)
    world = new_world(RIG, scene, overlapping(inside))
    motions = [world.advance(at_rest, True) for _ in range(250)][-1]
    _, height = heights(motions)
    assert motions.finger_force[-1] == pytest.approx(LOAD, rel=2e-4)
    assert height[-1] == pytest.approx(-LOAD / felt.stiffness, rel=1e-3)
    depth = (motions.angle[-1] + height[-1] / KEY.laser_arm) * KEY.press_arm - height[-1]
    assert depth == pytest.approx(inside - LOAD / pad.stiffness, rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "tip"), [("ideal", PAD), ("paper", PAD), ("paper", None)])
def test_a_stiff_pin_is_a_fixed_one(name, tip):
    """Its compliance delays the release in proportion to 1 / k."""
    changes = {"sensors": None, "fingertip": tip, "engine": "rigid", "step": 10e-6}
    fixed = observe(RIG, scene_of(name, **changes))
    firm, stiff = (
        errors(observe(RIG, scene_of(name, **changes, play=play(k, 100.0))), fixed)
        for k in (1e6, 1e7)
    )
    assert stiff.time < 1e-5
    assert stiff.time == pytest.approx(firm.time / 10, rel=0.15)
    assert stiff.force < 2e-3


def test_what_cannot_be_simulated_is_refused_with_the_reason():
    felt = {"play": {"stiffness": "200 kN/m"}}
    document = {**BARE, "finger": "ideal", "step": "1 ms", **felt}
    with pytest.raises(ValidationError, match=r"play: the rigid fingertip .* add the table"):
        Scene.model_validate(document)
    document |= {"fingertip": {"stiffness": "30 kN/m"}}
    Scene.model_validate(document)
    with pytest.raises(ValidationError, match="with play has an angle and a height"):
        Scene.model_validate(document | {"engine": "exact"})
    with pytest.raises(ValidationError, match="either sinks or bends"):
        Scene.model_validate(document | {"bending": {"frequency": "400 Hz"}})
    scene = scene_of("free-key", engine="exact", play=play(1e5))
    with pytest.raises(SceneError, match="with play has an angle and a height"):
        new_world(RIG, scene)
    with pytest.raises(SceneError, match=r"the balance felt needs steps of .*play\.stiffness"):
        new_world(RIG, scene_of("free-key", engine="rigid", play=play(1e8, 1e4, mass=1e-3)))


@pytest.mark.slow
def test_errors_fall_with_the_square_of_the_step():
    scene = scene_of("ideal", fingertip=PAD, play=play(1e5, 10.0))
    steps = [observe(RIG, scene.model_copy(update={"step": s})) for s in (4e-5, 2e-5, 2.5e-6)]
    assert errors(steps[0], steps[2]).time < 4e-6
    assert errors(steps[1], steps[2]).time < 0.5 * errors(steps[0], steps[2]).time + 1e-8
