"""Friction of the fingertip on the key: against the model, closed forms and between the engines."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.simulated import sensed
from sautereau.analysis.identify.identified import identify
from sautereau.analysis.model.key import finger_force
from sautereau.analysis.model.predict import predict, rig_pluck
from sautereau.analysis.phases import find_phases
from sautereau.analysis.session.analysed import jack_speeds
from sautereau.analysis.session.compare import compare
from sautereau.rig.load import with_values
from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.parts import Fingertip, Play
from sautereau.sim_backend.physics.drive import LEAD
from sautereau.sim_backend.physics.observation import errors, observe, reference
from sautereau.sim_backend.physics.world import new_world
from sautereau.trajectory.arm import joints_holding_point
from sautereau.trajectory.motion import Motion
from sautereau.trajectory.press import plan_press
from tests.budget import slow
from tests.sim_backend.scenes import MUTE, RIG, at_rest, press_solved, push_of, scene_of

KEY = RIG.key
CRUISE = plan_press(RIG).cruise
ENGINES = ("exact", "rigid")
PAD = Fingertip.model_construct(stiffness=3e4, damping=5.0)


def rough(friction, **values):
    """Return the packaged rig with a friction of its fingertip."""
    return with_values(RIG, {"arm.fingertip_friction": friction, **values})


def in_cruise(motions, events):
    """Return where the jack rises at the planned speed, 0.2 ms off the events."""
    start, end = (LEAD * RIG.controller.sample_period + t for t in (CRUISE.start, CRUISE.end))
    apart = np.abs(motions.time[:, None] - [e.time for e in events.contacts + events.releases])
    return (apart.min(1) > 2e-4) & (motions.time > start) & (motions.time < end)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("friction", [0.1, 0.3, slow(-0.3)])
def test_the_force_of_a_press_is_that_of_predict(engine, friction):
    """At each rise of the cruise, but for what the planned path differs from a constant speed."""
    rig = rough(friction)
    seen = observe(rig, scene_of("ideal", engine=engine, sensors=None))
    made, plain = predict(rig), predict(RIG)
    moved, on = seen.motions, in_cruise(seen.motions, seen.events)
    assert on.sum() > 500
    force, without = (np.interp(moved.rise[on], p.rise, p.finger_force) for p in (made, plain))
    found = moved.finger_force[on]
    np.testing.assert_allclose(found, force, rtol=0, atol=5e-5)
    lever = KEY.press_arm / (KEY.press_arm + friction * KEY.surface_height)
    assert np.median(found / without) == pytest.approx(lever, abs=1e-4)


@pytest.mark.parametrize("engine", ENGINES)
def test_the_force_of_a_servo_is_that_of_its_inverse_dynamics(engine):
    """Down and back, while its arm yields to the friction; a millisecond's mean."""
    rig = rough(0.3)
    seen = observe(rig, scene_of("paper", engine=engine, sensors=None))
    time, once = np.unique(seen.motions.time, return_index=True)
    moved = {name: values[once] for name, values in vars(seen.motions).items()}
    speed, rise = moved["angular_velocity"], moved["rise"]
    angle = (moved["angle"], speed, np.gradient(speed, time))
    string = rig_pluck(rig).force_on_jack(rise - rig.jack.string_clearance)
    held = (time > seen.events.contacts[0].time) & (time < seen.events.releases[0].time)
    expected = finger_force(rig, Motion(*angle), np.where(held, string, 0.0))
    apart = [e.time for kind in vars(seen.events).values() for e in kind]
    smooth = np.abs(time[:, None] - apart).min(1) > 2e-3
    # Off the felt and the string that a falling plectrum passes.
    smooth &= (np.abs(speed) > 0.1) & (KEY.press_arm * moved["angle"] < KEY.dip)
    error = np.convolve(moved["finger_force"] - expected, np.full(10, 0.1), "same")
    for part in (smooth & held, smooth & (speed > 0), smooth & (speed < 0)):
        assert part.sum() > 100
        assert abs(np.mean(error[part])) < 2e-3 * np.abs(expected[smooth & held]).max()


@pytest.mark.parametrize("name", ["ideal", "paper"])
@pytest.mark.parametrize("tip", [None, PAD])
@pytest.mark.parametrize("friction", [0.3, slow(-0.3)])
def test_both_engines_agree(name, tip, friction):
    """As well as without friction: one encoder count, or what a step resolves of the pad."""
    rig = rough(friction)
    scene = scene_of(name, sensors=None, fingertip=tip, engine="rigid")
    error = errors(observe(rig, scene), reference(rig, scene))
    assert error.time < 8e-6
    assert error.force < 2e-3


def test_the_error_of_the_rigid_bodies_is_at_most_proportional_to_the_step():
    """Of a servo with fine encoders; the key starts from rest, as a landing does."""
    rig = rough(-0.3, **{"arm.counts_per_revolution": 2**31})
    scene = scene_of("paper", sensors=None, engine="rigid")
    true = reference(rig, scene)
    found = [
        errors(observe(rig, scene.model_copy(update={"step": step})), true)
        for step in (2e-4, 1e-4, 5e-5)
    ]
    assert found[0].time < 1e-5
    assert found[1].time < 0.7 * found[0].time
    assert found[2].time < 0.7 * found[1].time


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("share", [0.98, 1.02])
def test_friction_that_hinders_holds_the_key_up_to_its_cone(engine, share):
    """A push F of a key at rest: F (a_p - mu h) against the jack's weight and all dry friction."""
    rig = rough(-0.3, **{"key.surface_height": "20 mm"})
    key, jack = rig.key, rig.jack
    load = jack.mass * GRAVITY + jack.register_friction
    needed = load * key.jack_arm + key.pivot_coulomb_friction - key.gravity_moment
    force = share * needed / (key.press_arm - 0.3 * key.surface_height)
    scene = scene_of("free-key", friction=True, engine=engine, step=1e-4)
    scene = scene.model_copy(update={"push": push_of(force, 20e-3)})
    motions = observe(rig, scene).motions
    moved = np.interp(20e-3, motions.time, motions.angle)
    # The moments beyond the cone accelerate key and jack; rigid bodies creep by a step's speed.
    inertia = key.inertia + jack.mass * key.jack_arm**2
    free = (share - 1) * needed / inertia * 20e-3**2 / 2
    if share > 1:
        assert moved == pytest.approx(free, rel=0.02 if engine == "exact" else 0.05)
    else:
        assert abs(moved) < (1e-12 if engine == "exact" else 0.05 * abs(free))


@pytest.mark.parametrize("engine", ENGINES)
def test_friction_that_helps_moves_a_key_once_its_own_friction_does_not_hold_it(engine):
    """Below that the key rests; beyond, the moment is that with friction."""
    rig = rough(0.3, **{"key.surface_height": "20 mm"})
    key, jack = rig.key, rig.jack
    load = jack.mass * GRAVITY + jack.register_friction
    needed = load * key.jack_arm + key.pivot_coulomb_friction - key.gravity_moment
    inertia, found = key.inertia + jack.mass * key.jack_arm**2, []
    for share in (0.99, 1.01):
        scene = scene_of("free-key", friction=True, engine=engine, step=1e-4)
        push = push_of(share * needed / key.press_arm, 20e-3)
        motions = observe(rig, scene.model_copy(update={"push": push})).motions
        found.append(np.interp(20e-3, motions.time, motions.angle))
    lever = 1 + 0.3 * key.surface_height / key.press_arm
    assert found[0] < 1e-9
    free = (1.01 * lever - 1) * needed / inertia * 20e-3**2 / 2
    assert found[1] == pytest.approx(free, rel=0.02 if engine == "exact" else 0.15)


def test_a_scene_without_friction_has_none_of_the_fingertip():
    rig, (smooth, drive) = rough(0.3), press_solved("ideal")
    for friction in (True, False):
        scene = scene_of("ideal", sensors=None, friction=friction)
        same = reference(rig, scene, drive).motions
        plain = reference(RIG, scene, drive).motions
        assert (np.abs(same.finger_force - plain.finger_force).max() > 1e-3) == friction
    assert smooth.motions.finger_force.max() > 0.5


@pytest.mark.slow
def test_the_vertical_part_acts_on_a_key_with_play():
    """A pin of 10 MN/m moves by 0.1 um: the force is that of a fixed one."""
    rig = rough(0.3)
    play = Play.model_construct(stiffness=1e7, damping=300.0, clearance=0.5e-3, mass=0.05)
    scene = scene_of("paper", sensors=None, engine="rigid", fingertip=PAD)
    fixed, sinking = (
        observe(rig, scene.model_copy(update={"play": part})) for part in (None, play)
    )
    assert errors(sinking, fixed).time < 2e-5
    assert errors(sinking, fixed).force < 5e-3


def test_a_fingertip_that_jams_is_refused():
    """Painleve: the friction turns an arm above the key so that it presses the more."""
    rig = rough(1.0, **{"arm.base_x": "-0.18 m", "arm.base_z": "0.21 m"})
    height = KEY.surface_height + rig.arm.fingertip_radius
    centre, still = np.array([[-KEY.press_arm, height]]), np.zeros((1, 2))
    joints = joints_holding_point(rig.arm, Motion(centre, still, still)).position[0]
    scene = scene_of("paper", sensors=None, engine="exact", **MUTE)
    world = new_world(rig, scene, (float(joints[0]), float(joints[1])))
    with pytest.raises(SceneError, match=r"friction of the fingertip jams .*fingertip_friction"):
        world.advance(at_rest, True)


@pytest.fixture(scope="module")
def recorded():
    """Three presses with friction 0.3 of a rig with calibrated sensors that knows of none."""
    channels = tuple(c.model_copy(update={"gain_std": 3e-4}) for c in RIG.daq.channels)
    rig = RIG.replaced({"daq.channels": channels})
    scene = scene_of("paper", truth={"arm.fingertip_friction": 0.3})
    seen = observe(rig, scene)
    presses = [sensed(rig, scene, seen, seed)[0] for seed in range(3)]
    return presses, [find_phases(press) for press in presses]


def test_compared_with_a_rig_that_has_it_all_errors_are_within_their_intervals(recorded):
    presses, phases = recorded
    speeds = [jack_speeds(*each)[0] for each in zip(presses, phases, strict=True)]
    known, unknown = (
        compare(phases, [predict(rig, speed=speed) for speed in speeds])
        for rig in (rough(0.3), RIG)
    )
    for error in (known.slope_error, known.magnitude_error, known.duration_error):
        assert error.low < 0 < error.high
    assert unknown.slope_error.low > 0.0


@pytest.mark.parametrize("ranges", [False, True])
@pytest.mark.slow
def test_identification_finds_it(recorded, ranges):
    presses, phases = recorded
    if not ranges:
        rig = presses[0].rig.model_copy(update={"assumed": {}})
        presses = [replace(press, rig=rig) for press in presses]
    identified = identify(presses, phases, ["arm.fingertip_friction"], starts=1)
    (found,) = identified.estimates
    assert found.std_noise < 0.07
    assert found.low < 0.3 < found.high
