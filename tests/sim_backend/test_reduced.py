"""The reduced engine against closed forms, an independent solver, the model, the reference."""

import math
import subprocess
import sys

import numpy as np
import pytest

from sautereau.analysis.model.key import finger_force
from sautereau.analysis.model.predict import rig_pluck
from sautereau.rig.load import with_values
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.drive import PushDrive, drive_of
from sautereau.sim_backend.physics.observation import errors, observe
from sautereau.sim_backend.physics.reduced.engine import ReducedWorld
from sautereau.sim_backend.physics.reference.observe import reference
from sautereau.trajectory.arm import fingertip_motion
from sautereau.trajectory.key import key_under_fingertip, surface_axes
from tests import key_oracle
from tests.key_oracle import rise
from tests.sim_backend.scenes import MUTE, RETURNING, RIG, choir, pressed, pushed, slow

KEY, JACK = RIG.key, RIG.jack
PERIOD = RIG.controller.sample_period


def run(rig, scene, drive=None):
    found = observe(rig, scene, drive)
    assert all(np.isfinite(values).all() for values in vars(found.motions).values())
    return found


def times(events):
    return [e.time for e in events.contacts + events.releases + events.returns]


# Independent solutions.


def solved_push(force, end):
    """Return the times of contact, release and felt, and the state at the end, with friction."""
    pluck, bottom = rig_pluck(RIG), KEY.dip / KEY.press_arm
    contact, release = key_oracle.plucked(RIG, force, pluck, friction=True)
    felt = key_oracle.solved(
        RIG, force, release, end, friction=True, stop=lambda _, state: state[0] - bottom
    )
    # The felt stops the key, and the jack flies on.
    _, state = key_oracle.solved(RIG, force, felt, end, friction=True, felt=True, jack=False)
    return [contact[0], release[0], felt[0]], state


def test_a_push_with_friction_and_felt_is_that_of_an_independent_solver():
    end = 24 * PERIOD  # in the felt, before the key reverses
    found, (angle, spin) = solved_push(1.2, end)
    assert found[2] < end
    happened = run(RIG, pushed(duration=end))
    np.testing.assert_allclose(times(happened.events), found[:2], atol=2e-8)
    assert happened.motions.time[-1] == pytest.approx(end, abs=1e-15)
    assert happened.motions.angle[-1] == pytest.approx(angle, abs=1e-7)
    fine = run(RIG, pushed(duration=end, step=5e-05))
    np.testing.assert_allclose(times(fine.events), found[:2], atol=1e-12)
    assert fine.motions.angle[-1] == pytest.approx(angle, abs=1e-11)
    assert fine.motions.angular_velocity[-1] == pytest.approx(spin, abs=1e-9)
    pluck = rig_pluck(RIG)
    force = float(pluck.force_on_jack(pluck.release_height))
    assert fine.events.releases[0].force == pytest.approx(force, rel=1e-9)


def test_steps_are_of_order_four():
    exact = run(RIG, pushed(step=1e-05))
    wrong = [
        abs(run(RIG, pushed(step=PERIOD / n)).motions.angle[-1] - exact.motions.angle[-1])
        for n in (1, 2, 4)
    ]
    assert wrong[0] / wrong[1] > 10
    assert wrong[1] / wrong[2] > 10


COVERED_BY_OTHERS = ("an ideal finger", "two choirs", "a heavy push")
"""Scenes with no part that another one lacks."""
SCENES = {
    "a push and the fall back": (RIG, pushed(duration=0.05, rest=0.3, **RETURNING)),
    "a heavy push": (RIG, pushed(force=20, rest=0.05, friction=False, **RETURNING)),
    "an ideal finger": (RIG, pressed(**RETURNING)),
    "a key that leaves the finger": (
        with_values(RIG, {"jack.register_friction": "60 mN", "press.return_speed": "0.5 m/s"}),
        pressed(**RETURNING),
    ),
    "two choirs": (
        RIG.model_copy(update={"more_choirs": (choir(0.205, 3e-3),)}),
        pushed(duration=0.03, rest=0.2, **RETURNING),
    ),
    "two choirs under an ideal finger": (
        RIG.model_copy(update={"more_choirs": (choir(0.205, 3e-3),)}),
        pressed(**RETURNING),
    ),
    "a light key and heavy jacks": (
        with_values(
            RIG.model_copy(update={"more_choirs": (choir(0.2, 2.5e-3, mass=9e-3),)}),
            {"key.inertia": "1e-4 kg m^2"},
        ),
        pushed(force=8, duration=0.008, rest=0.08, friction=False),
    ),
}


@pytest.mark.parametrize("name", [slow(n) if n in COVERED_BY_OTHERS else n for n in SCENES])
def test_events_are_those_of_the_reference(name):
    rig, scene = SCENES[name]
    drive = drive_of(rig, scene)
    true = reference(rig, scene, drive)
    assert true.events.contacts
    for step, time, angle in ((1e-3, 1e-6, 3e-6), (1e-4, 2e-9, 1e-8)):
        happened = run(rig, scene.model_copy(update={"step": step}), drive)
        assert errors(happened, true).time < time
        fit = np.interp(happened.motions.time, true.motions.time, true.motions.angle)
        known = np.isin(happened.motions.time.round(9), true.motions.time.round(9))
        np.testing.assert_allclose(happened.motions.angle[known], fit[known], atol=angle)


def test_an_ideal_finger_prescribes_the_motion_and_takes_the_force_of_inverse_dynamics():
    scene = pressed(step=250e-6)
    drive = drive_of(RIG, scene)
    happened = run(RIG, scene, drive).motions
    motion = drive.joints(happened.time)
    planned = key_under_fingertip(KEY, RIG.arm.fingertip_radius, fingertip_motion(RIG.arm, motion))
    breaks = np.min(np.abs(happened.time[:, None] - drive.breaks), axis=1)
    breaks[:-1] *= np.diff(happened.time) > 0  # before a jump
    moving = (planned.position > 0) & (planned.velocity > 1e-3) & (breaks > 1e-5)
    assert moving.sum() > 300
    np.testing.assert_allclose(happened.angle[moving], planned.position[moving], atol=1e-13)
    np.testing.assert_allclose(
        happened.angular_velocity[moving], planned.velocity[moving], atol=1e-10
    )
    np.testing.assert_allclose(happened.rise[moving], rise(KEY, happened.angle[moving]))
    tangent, _ = surface_axes(planned.position)
    arm = -np.sum(fingertip_motion(RIG.arm, motion).position * tangent, axis=1)
    force = finger_force(RIG, planned, happened.string_force) * KEY.press_arm / arm
    np.testing.assert_allclose(happened.finger_force[moving], force[moving], atol=1e-9)


# Conservation.


def test_a_resting_key_stays_at_rest():
    happened = run(RIG, pushed(force=0, **RETURNING))
    for name in ("angle", "angular_velocity", "rise", "finger_force", "string_force"):
        assert not getattr(happened.motions, name).any()
    assert not times(happened.events)


def test_dry_friction_holds_the_key_as_long_as_it_can():
    least = key_oracle.static_moment(RIG, friction=1) / KEY.press_arm
    stuck = run(RIG, pushed(force=least * (1 - 1e-9)))
    assert not stuck.motions.angle.any()
    assert run(RIG, pushed(force=least * (1 + 1e-6))).motions.angle.max() > 0
    # Released half way up, it falls back only if the friction is below the weight.
    rough = with_values(RIG, {"key.pivot_coulomb_friction": "12 mN m"})
    held = run(rough, pushed(force=0.5, duration=0.015, rest=0.2, **MUTE)).motions
    assert held.angle[-1] > 1e-3
    assert held.angular_velocity[-1] == 0.0
    fallen = run(RIG, pushed(force=0.5, duration=0.015, rest=0.5, **MUTE)).motions
    assert fallen.angle[-1] == 0.0


# Extremes.


@pytest.mark.parametrize(
    "values",
    [
        {"key.inertia": "6e-5 kg m^2", "jack.mass": "60 g"},
        {"key.inertia": "1 kg m^2", "jack.mass": "5 g"},
        {"key.felt_stiffness": "2e7 N/m", "key.felt_damping": "0 N s/m"},
        {"key.felt_stiffness": "20 N/m", "key.felt_damping": "1000 N s/m"},
        {"string.tension": "66950 N"},
        {"string.tension": "0.066 N"},
        {"plectrum.overlap": "0.001 mm"},
        {"key.gravity_moment": "0 mN m"},
        {"jack.register_friction": "0 mN", "key.pivot_coulomb_friction": "0 mN m"},
    ],
)
@pytest.mark.parametrize("force", [0.15, 1.2, 20.0])
def test_extremes_converge(values, force):
    rig = with_values(RIG, values)
    scene = pushed(force=force, duration=0.06, rest=0.02, **RETURNING)
    coarse, fine = (
        run(rig, scene.model_copy(update={"step": step})).events for step in (2e-3, 5e-5)
    )
    first = [[*events.contacts[:1], *events.releases[:1]] for events in (coarse, fine)]
    assert len(first[0]) == len(first[1])
    for a, b in zip(*first, strict=True):
        assert a.time == pytest.approx(b.time, abs=1e-6)


def test_an_endless_series_of_landings_ends_at_rest():
    # Each landing makes the light key leave the other jack.
    rig = with_values(RIG, {"key.inertia": "1e-4 kg m^2"})
    rig = rig.model_copy(update={"more_choirs": (choir(0.2, 1.6e-3, mass=12e-3),)})
    scene = pushed(force=0.5, duration=0.03, rest=0.03, friction=False)
    coarse, fine = (run(rig, scene.model_copy(update={"step": s})) for s in (1e-3, 1e-4))
    assert errors(coarse, fine).time < 1e-6
    assert len(coarse.events.releases) == 2


# The world.


def test_a_world_of_a_push():
    scene = pushed(duration=0.0055)
    world = ReducedWorld(RIG, scene)
    drive = PushDrive(RIG, scene.push)
    home, offset = np.array(RIG.arm.home_angles), np.array(scene.start_offset)
    np.testing.assert_allclose(world.start, home + offset)
    assert world.finger.joints() == world.start
    assert world.finger.torques() == (0.0, 0.0)
    assert world.finger.settled
    parts = [world.advance(drive.reference(i), True) for i in range(8)]
    assert world.samples == 8
    assert world.time == 8 * PERIOD
    np.testing.assert_allclose([p.finger_force[0] for p in parts], [1.2] * 6 + [0.0] * 2)
    unpowered = ReducedWorld(RIG, scene)
    assert not unpowered.advance(drive.reference(0), False).angle.any()


def test_a_world_follows_the_joints_of_its_finger():
    scene = pressed()
    drive = drive_of(RIG, scene)
    world = ReducedWorld(RIG, scene, drive.start)
    for i in range(60):
        world.advance(drive.reference(i), True)
    np.testing.assert_allclose(
        world.finger.joints(), drive.joints(np.array([60 * PERIOD])).position[0], atol=1e-12
    )


def test_unsupported_scenes_are_refused():
    with pytest.raises(SceneError, match="rigid"):
        ReducedWorld(RIG, pushed().model_copy(update={"string": "modal"}))
    with pytest.raises(SceneError, match="select_solver"):
        ReducedWorld(RIG, pushed().model_copy(update={"step": None, "accuracy": "1 us"}))
    with pytest.raises(SceneError, match=r"plectrum\.overlap"):
        ReducedWorld(with_values(RIG, {"plectrum.overlap": "4.4999 mm"}), pushed())
    with pytest.raises(SceneError, match=r"1\.2 rad"):
        run(RIG, pushed(force=50, duration=0.2, felt=False))
    scene = pressed()
    drive = drive_of(RIG, scene)
    world = ReducedWorld(RIG, scene, drive.start)
    world.advance(drive.reference(0), True)
    with pytest.raises(SceneError, match="suddenly within the key"):
        world.advance(drive.reference(70), True)
    near = RIG.model_copy(
        update={"arm": RIG.arm.model_copy(update={"base_x": -0.1, "base_z": 0.1})}
    )
    upper, lower = RIG.arm.upper_length, RIG.arm.lower_length
    elbow = math.acos((0.02 - upper**2 - lower**2) / (2 * upper * lower))
    shoulder = -math.pi / 4 - math.atan2(lower * math.sin(elbow), upper + lower * math.cos(elbow))
    with pytest.raises(SceneError, match="balance pin"):
        ReducedWorld(near, scene, (shoulder, elbow)).advance(drive.reference(0), True)


def bits():
    seen = observe(RIG, pushed(duration=0.03, rest=0.01, **RETURNING))
    rows = zip(*vars(seen.motions).values(), strict=True)
    return "\n".join([*(" ".join(float(v).hex() for v in row) for row in rows), str(seen.events)])


def test_the_same_bits_in_another_process_without_numba():
    code = "import sys; sys.modules['numba'] = None\n"
    code += "from tests.sim_backend.test_reduced import bits; print(bits())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    expected = bits()
    assert expected.count("\n") > 40
    assert done.stdout.strip() == expected
