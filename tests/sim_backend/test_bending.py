"""The key's bending mode, against closed forms."""

import numpy as np
import pytest
from pydantic import ValidationError

from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.parts import Bending, Fingertip
from sautereau.sim_backend.physics.observation import errors, observe, reference
from sautereau.sim_backend.physics.world import new_world
from tests.sim_backend.scenes import BARE, MUTE, RIG, press_solved, push_of, pushed, scene_of

KEY, JACK = RIG.key, RIG.jack


def bent(frequency, damping=0.0, front=0.5):
    return Bending.model_construct(frequency=frequency, damping=damping, front=front)


def parts(bending):
    """Return the spring [N m/rad], and the inertias before and behind it, with the jack."""
    front, back = KEY.inertia * bending.front, KEY.inertia * (1 - bending.front)
    stiffness = (2 * np.pi * bending.frequency) ** 2 * front * back / KEY.inertia
    return stiffness, front, back + JACK.mass * KEY.jack_arm**2


@pytest.mark.parametrize("frequency", [150.0, 800.0, 5000.0])
@pytest.mark.parametrize("front", [0.05, 0.5, 0.95])
def test_a_sudden_push_bends_the_key_as_two_inertias_on_a_spring(frequency, front):
    """Without gravity: d = d_s (1 - cos w t), on the motion of the centre of inertia."""
    bending = bent(frequency, front=front)
    stiffness, before, behind = parts(bending)
    push, total = 1e-3, before + behind
    scene = scene_of("free-key", step=20e-6, gravity=0.0, bending=bending, push=push_of(push, 9e-3))
    motions = observe(RIG, scene).motions
    w = np.sqrt(stiffness * (1 / before + 1 / behind))
    part = motions.time < min(9e-3, 8 / w)  # later its phase differs, by (w step)^2 / 24 per radian
    time, moment = motions.time[part], push * KEY.press_arm
    bend = moment / (before * w**2) * (1 - np.cos(w * time))
    centre = moment * time**2 / (2 * total)
    back = np.arctan(
        motions.rise[part] / KEY.jack_arm
    )  # its rise beyond b tan a is of the second order
    scale = bend.max()
    np.testing.assert_allclose(
        motions.angle[part], centre + behind / total * bend, atol=5e-3 * scale
    )
    np.testing.assert_allclose(back, centre - before / total * bend, atol=5e-3 * scale)
    # The laser sees the front move.
    speed = moment * time / total + behind / total * moment / (before * w) * np.sin(w * time)
    np.testing.assert_allclose(motions.angular_velocity[part], speed, atol=5e-3 * w * scale)


def test_a_key_pressed_on_its_felt_is_bent_by_its_jack():
    """At rest the spring carries the moment of the jack less that of the key."""
    bending = bent(200.0, 0.5)
    stiffness, _, _ = parts(bending)
    scene = pushed(1.0, 0.5, **MUTE, friction=False, engine="rigid", bending=bending, step=1e-4)
    motions = observe(RIG, scene).motions
    load = JACK.mass * GRAVITY * KEY.jack_arm - KEY.gravity_moment
    tangent = motions.rise[-1] / KEY.jack_arm
    for _ in range(5):  # r = b tan a + hb (1 / cos a - 1)
        surface = KEY.jack_surface_height * (np.sqrt(1 + tangent**2) - 1)
        tangent = (motions.rise[-1] - surface) / KEY.jack_arm
    assert motions.angle[-1] - np.arctan(tangent) == pytest.approx(load / stiffness, rel=1e-2)
    felt = (motions.angle[-1] * KEY.press_arm - KEY.dip) * KEY.felt_stiffness
    assert felt == pytest.approx(1.0 - load / KEY.press_arm, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("tip", [None, Fingertip.model_construct(stiffness=3e4, damping=5.0)])
@pytest.mark.parametrize("name", ["ideal", "paper"])
def test_a_stiff_key_is_a_rigid_one(name, tip):
    """Its compliance 1 / k = 4 / (I w^2) delays the release by force / (k speed)."""
    changes = {"sensors": None, "fingertip": tip, "step": 20e-6}
    rigid = press_solved(name)[0] if tip is None else reference(RIG, scene_of(name, **changes))
    found = observe(RIG, scene_of(name, **changes, bending=bent(5000.0, 0.05)))
    assert errors(found, rigid).time < 2e-5
    assert errors(found, rigid).force < 1e-2


def test_the_exact_engine_refuses_a_bending_key():
    scene = scene_of("ideal", bending=bent(400.0))
    with pytest.raises(SceneError, match="two angles"):
        new_world(RIG, scene.model_copy(update={"engine": "exact"}))
    with pytest.raises(ValidationError, match="a key with bending has two angles"):
        type(scene).model_validate(
            {**BARE, "finger": "ideal", "engine": "exact", "step": "1 ms"}
            | {"bending": {"frequency": "400 Hz"}}
        )


@pytest.mark.slow
def test_errors_fall_with_the_square_of_the_step():
    """Of the contact and the release, with everything elastic."""
    scene = scene_of("ideal", fingertip=Fingertip.model_construct(stiffness=3e4, damping=5.0))
    scene = scene.model_copy(update={"bending": bent(400.0, 0.02)})
    steps = [observe(RIG, scene.model_copy(update={"step": s})) for s in (2e-5, 1e-5, 2.5e-6)]
    assert errors(steps[0], steps[2]).time < 1e-6
    assert errors(steps[1], steps[2]).time < 0.5 * errors(steps[0], steps[2]).time + 1e-9


@pytest.mark.slow
def test_a_bent_key_releases_later():
    """By the bend that the string's force has caused by then, over the front's speed."""
    _, drive = press_solved("ideal")
    changes = {"step": 50e-6, "friction": False}
    times, forces = [], []
    for bending in (bent(5000.0, 0.05), bent(200.0, 0.05)):
        seen = observe(RIG, scene_of("ideal", **changes, bending=bending), drive)
        at = seen.events.releases[0].time
        times.append(at)
        forces.append(seen.events.releases[0].force)
        speed = np.interp(at - 1e-3, seen.motions.time, seen.motions.angular_velocity)
    moment = forces[1] * KEY.jack_arm + (JACK.mass * GRAVITY * KEY.jack_arm - KEY.gravity_moment)
    bends = [moment / parts(b)[0] for b in (bent(5000.0), bent(200.0))]
    assert times[1] - times[0] == pytest.approx((bends[1] - bends[0]) / speed, rel=0.2)
