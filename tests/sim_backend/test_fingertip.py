"""A compliant fingertip, against the closed form of a damped spring and between the engines."""

import numpy as np
import pytest
from pydantic import ValidationError

from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.parts import Fingertip
from sautereau.sim_backend.physics.events import Motions, PluckEvents, StringEvent
from sautereau.sim_backend.physics.observation import Observation, errors, observe, reference
from sautereau.sim_backend.physics.world import new_world
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.arm import joints_holding_point
from sautereau.trajectory.dynamics import gravity_torque
from sautereau.trajectory.motion import Motion
from tests.budget import slow
from tests.sim_backend.scenes import BARE, RIG, at_rest, press_solved, scene_of

ENGINES = ("exact", "rigid")
KEY, JACK = RIG.key, RIG.jack
INERTIA = KEY.inertia + JACK.mass * KEY.jack_arm**2
LOAD = (JACK.mass * GRAVITY * KEY.jack_arm - KEY.gravity_moment) / KEY.press_arm
"""N, at the pressing point, that lifts the jack with standard gravity."""


def soft(stiffness, damping=0.0):
    return Fingertip.model_construct(stiffness=stiffness, damping=damping)


def overlapping(length):
    """Return the joints [rad] of a fingertip within the key at rest by a length [m]."""
    height = KEY.surface_height + RIG.arm.fingertip_radius - length
    centre = np.array([[-KEY.press_arm, height]])
    still = Motion(centre, np.zeros((1, 2)), np.zeros((1, 2)))
    first, second = joints_holding_point(RIG.arm, still).position[0].tolist()
    return first, second


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("stiffness", [1e3, 1e5, 1e7])
@pytest.mark.parametrize(("damping", "gravity"), [(0.0, GRAVITY), (0.5, GRAVITY), (0.5, 2.0)])
def test_a_compressed_pad_lifts_the_key_as_a_damped_spring_does(
    engine, stiffness, damping, gravity
):
    """About the static deflection load / k, with w = sqrt(k a_p^2 / (I + m b^2)).

    The angles are small enough to be linear, and the key does not come back to its rail.
    """
    w = KEY.press_arm * np.sqrt(stiffness / INERTIA)
    tip = soft(stiffness, 2 * damping * w * INERTIA / KEY.press_arm**2)
    load = LOAD * gravity / GRAVITY
    static = load / stiffness
    amplitude = 0.9 * static
    scene = scene_of("ideal", **BARE, engine=engine, step=20e-6, fingertip=tip, gravity=gravity)
    world = new_world(RIG, scene, overlapping(static + amplitude))
    motions = [world.advance(at_rest, True) for _ in range(4)]
    time, angle, force = (
        np.concatenate([getattr(m, name) for m in motions])
        for name in ("time", "angle", "finger_force")
    )
    part = (time > 0) & (time < 5.5 / w)
    assert part.sum() > 10
    time, angle, force = time[part], angle[part], force[part]
    wd, decay = w * np.sqrt(1 - damping**2), np.exp(-damping * w * time)
    expected = 1 - decay * (np.cos(wd * time) + damping * w / wd * np.sin(wd * time))
    found = angle * KEY.press_arm / amplitude
    np.testing.assert_allclose(found, expected, atol=1e-3 if engine == "rigid" else 1e-5)
    # The acceleration of the key needs the force beyond the load.
    acceleration = decay * (np.cos(wd * time) - damping * w / wd * np.sin(wd * time))
    np.testing.assert_allclose(force, load * (1 + 0.9 * acceleration), rtol=6e-3, atol=1e-6)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("gravity", [0.0, 1.62, 30.0])
def test_nothing_moves_at_rest_for_any_gravity(engine, gravity):
    """With the motors on, too: their integrators start at the links' weight."""
    world = new_world(RIG, scene_of("paper", engine=engine, gravity=gravity, sensors=None))
    world.advance(at_rest, False)
    start = world.finger.joints()
    motions = [world.advance(at_rest, True) for _ in range(20)]
    assert max(abs(m.angle).max() for m in motions) < 1e-12
    np.testing.assert_allclose(world.finger.joints(), start, atol=RIG.arm.radians_per_count)
    weight = gravity_torque(RIG.arm, np.array(start)) * gravity / GRAVITY
    expected = np.clip(weight, -RIG.arm.torque_limit, RIG.arm.torque_limit)
    np.testing.assert_allclose(world.finger.torques(), expected, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("name", ["ideal", "paper"])
@pytest.mark.parametrize("tip", [soft(3e4, 5.0), slow(soft(1e3)), slow(soft(1e6, 20.0))])
def test_both_engines_agree(name, tip):
    scene = scene_of(name, sensors=None, fingertip=tip)
    found = observe(RIG, scene)
    error = errors(found, reference(RIG, scene))
    assert error.time < (3e-5 if tip.damping == 0 else 2e-6)
    assert error.force < 2e-3
    assert found.motions.finger_force.min() >= 0.0


@pytest.mark.parametrize("engine", ENGINES)
def test_a_contact_with_a_damper_is_a_jump_of_the_force(engine):
    """From 0 to c times the speed of the fingertip, 40 um per sample; both at one instant."""
    above, below = np.array(overlapping(-20e-6)), np.array(overlapping(20e-6))
    counts = (below - above) / RIG.arm.radians_per_count
    scene = scene_of("ideal", **BARE, engine=engine, step=50e-6, fingertip=soft(1e3, 5.0))
    world = new_world(RIG, scene, (float(above[0]), float(above[1])))
    motions = world.advance(lambda f: (np.outer(f, counts), np.tile(counts, (len(f), 1))), True)
    first = np.flatnonzero(motions.finger_force > 0)[0]
    assert motions.time[first - 1] == motions.time[first]
    period = RIG.controller.sample_period
    assert motions.time[first] == pytest.approx(period / 2, rel=1e-3)
    assert motions.finger_force[first] == pytest.approx(5.0 * 40e-6 / period, rel=1e-3)


def test_a_push_has_no_fingertip():
    document = {"finger": "push", "push": {"force": "1 N", "duration": "9 ms"}, "step": "1 ms"}
    document |= {**BARE, "fingertip": {"stiffness": "30 kN/m"}}
    with pytest.raises(ValidationError, match=r'fingertip: .*finger = "ideal"'):
        Scene.model_validate(document)


def test_a_damper_too_strong_for_any_step_is_refused():
    scene = scene_of("ideal", engine="rigid", fingertip=soft(1e4, 1e5))
    with pytest.raises(SceneError, match=r"pad needs steps of .*fingertip\.damping"):
        new_world(RIG, scene)


def test_a_jump_of_the_force_at_another_time_is_an_error_of_time_and_not_of_force():
    def seen(jump, height=0.2):
        time = np.sort([*np.linspace(0.0, 0.1, 2001), jump, jump])
        force = np.where(time < jump, 0.0, height + time)
        force[np.searchsorted(time, jump)] = 0.0
        motions = Motions(time, *(0 * time for _ in range(3)), force, 0 * time, 0 * time)
        contacts, releases = [StringEvent(0.01, 0, 0.0)], [StringEvent(0.09, 0, 0.5)]
        return Observation(motions, PluckEvents(contacts, releases))

    true = seen(0.05003)
    late = errors(seen(0.05013), true)
    assert late.force == pytest.approx(0.0, abs=1e-12)
    assert late.time == pytest.approx(1e-4)
    small = errors(seen(0.05013, -0.05), seen(0.05003, -0.05))  # jumps by 0.1 mN
    assert small.time == 0.0
    assert 0.0 < small.force < 1e-3
    assert errors(seen(0.05013, 0.21), true).force > 1e-2
    assert errors(seen(0.07), true).force > 0.1  # another event
    other = errors(seen(0.05013, 0.6), true)  # likewise, by its size
    assert other.time == 0.0
    assert other.force > 0.1


def test_a_stiff_pad_is_a_rigid_fingertip():
    """Its compression delays the contact by load / (k v), and the release by the string's force."""
    rigid, drive = press_solved("ideal")
    stiff = reference(RIG, scene_of("ideal", fingertip=soft(1e7, 100.0)), drive)
    found = stiff.events.releases[0].time - rigid.events.releases[0].time
    speed = np.interp(
        rigid.events.releases[0].time, rigid.motions.time, rigid.motions.angular_velocity
    )
    force = rigid.motions.finger_force[
        np.searchsorted(rigid.motions.time, rigid.events.releases[0].time) - 1
    ]
    assert found == pytest.approx(force / 1e7 / (speed * KEY.press_arm), rel=0.1)
