"""Worlds by their interface: choice of engine, refused scenes, clock, reproducibility."""

import hashlib

import numpy as np
import pytest

from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.physics.world import new_world
from sautereau.sim_backend.scene import packaged_scenes
from tests.budget import slow
from tests.sim_backend.scenes import MUTE, RIG, at_rest, push_of, scene_of


def test_an_open_choice_is_refused():
    scene = scene_of("pluck", step=None, accuracy="10 us", engine="auto", string="auto")
    with pytest.raises(SceneError, match=r"step, engine, string .* 10 us; .*select\.select_solver"):
        new_world(RIG, scene)


@pytest.mark.parametrize("name", packaged_scenes())
def test_a_bench_at_rest_stays_at_rest(name):
    world = new_world(RIG, scene_of(name))
    joints = world.finger.joints()
    for _ in range(300):
        moved = world.advance(at_rest, False)
        np.testing.assert_allclose(moved.angle, 0, atol=1e-12)
        np.testing.assert_allclose(moved.rise, 0, atol=1e-12)
        np.testing.assert_array_equal(moved.finger_force, 0)
    assert world.events.contacts == []
    np.testing.assert_allclose(world.finger.joints(), joints, atol=1e-12)
    assert world.finger.settled


def test_the_clock_does_not_accumulate_rounding():
    world = new_world(RIG, scene_of("ideal", **MUTE))
    times = [world.advance(at_rest, True).time for _ in range(1024)]
    assert world.time == 1.0
    assert times[-1][-1] == 1.0
    assert np.all(np.diff(np.concatenate(times)) > 0)


def test_power_comes_on_at_home_or_at_the_given_joints():
    home, offset = RIG.arm.home_angles, (0.01, -0.02)
    world = new_world(RIG, scene_of("ideal", start_offset=offset))
    assert world.start == world.finger.joints() == (home[0] + 0.01, home[1] - 0.02)
    world = new_world(RIG, scene_of("paper"), (0.2, -1.5))
    assert world.start == (0.2, -1.5)
    np.testing.assert_allclose(world.finger.joints(), (0.2, -1.5), rtol=1e-15)


def digest(name):
    seen = observe(RIG, scene_of(name))
    data = b"".join(np.ascontiguousarray(array).tobytes() for array in vars(seen.motions).values())
    return hashlib.sha256(data + repr(seen.events).encode()).hexdigest()


@pytest.mark.parametrize("name", ["pluck", slow("paper")])
def test_another_process_gives_the_same_bits(name, command_server, tmp_path):
    code = f"from tests.sim_backend.test_world import digest; print(digest({name!r}))"
    done = command_server.run("-c", code, folder=tmp_path)
    assert done.stdout.strip() == digest(name), done.stderr


@pytest.mark.parametrize(
    ("truth", "words"),
    [
        (
            {"key.pivot_viscous_friction": "1000 N m s/rad"},
            r"viscous friction needs .*lower key\.p",
        ),
        ({"key.felt_stiffness": "1e16 N/m"}, r"front felt needs steps of .* lower key\.felt_stiff"),
        ({"key.felt_damping": "1e8 N s/m"}, r"front felt needs steps of .*lower .*felt_damping"),
        ({"jack.mass": "1e-10 kg", "key.gravity_moment": "-1 N m"}, r"string needs .*jack\.mass"),
    ],
)
def test_a_scene_too_stiff_for_any_step_is_refused(truth, words):
    with pytest.raises(SceneError, match=words):
        new_world(RIG, scene_of("ideal", truth=truth))


def test_a_key_without_a_stop_is_an_error():
    with pytest.raises(SceneError, match=r"after 0\.\d+ s the key has turned by 1\.2 rad.*felt"):
        observe(RIG, scene_of("pluck", push=push_of(1.2, 1.0)))


def test_a_finger_that_starts_in_the_key_is_refused():
    with pytest.raises(SceneError, match=r"start: the fingertip is in the key"):
        new_world(RIG, scene_of("ideal"), (-0.9, -0.5))


@pytest.mark.parametrize("step", [1e-6, 2e-3])
def test_the_step_divides_the_controllers_sample(step):
    world = new_world(RIG, scene_of("pluck", step=step))
    times = world.advance(at_rest, True).time
    assert times[0] == 0.0  # the push starts there
    steps = np.diff(times)
    assert steps.max() <= step * (1 + 1e-9)
    assert np.ptp(steps) < 1e-12
