"""The exact engine against energy, inverse dynamics, and itself in other steps and processes."""

import math
import subprocess
import sys

import numpy as np
import pytest
from scipy.optimize import brentq

from benchmarks.extreme_cases import random_cases
from sautereau.analysis.model.choirs import choir_pluck, choirs
from sautereau.analysis.model.key import finger_force
from sautereau.rig.load import with_values
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.drive import LEAD, PressDrive, PushDrive, drive_of
from sautereau.sim_backend.physics.exact.compile import Announcement
from sautereau.sim_backend.physics.exact.inclusion import select
from sautereau.sim_backend.physics.exact_world import ExactWorld
from sautereau.sim_backend.physics.finger import SETTLED
from sautereau.sim_backend.physics.observation import errors, observe, reference
from sautereau.sim_backend.scene import packaged_scenes
from sautereau.trajectory.arm import fingertip_motion
from sautereau.trajectory.dynamics import gravity_torque
from sautereau.trajectory.key import (
    angle_of_rise,
    key_under_fingertip,
    surface_axes,
)
from sautereau.trajectory.press import plan_press
from tests import key_oracle
from tests.budget import amount, slow
from tests.sim_backend.scenes import (
    MUTE,
    RETURNING,
    RIG,
    at_rest,
    press_solved,
    pressed,
    pushed,
    run,
    scene_of,
)

KEY_OF_RIG, JACK_OF_RIG = RIG.key, RIG.jack
PERIOD = RIG.controller.sample_period


# Friction and energy of a push.


@pytest.mark.parametrize(("factor", "moves"), [(1 - 1e-9, False), (1 + 1e-6, True)])
def test_friction_holds_the_key_up_to_its_limit(factor, moves):
    """The moment at the start is tau + f b + m g b - H."""
    limit = key_oracle.static_moment(RIG, friction=1)
    moved = reference(RIG, pushed(factor * limit / RIG.key.press_arm, 0.05, **MUTE)).motions
    assert (moved.angle.max() > 0) == moves


def test_friction_holds_the_key_where_it_stops():
    truth = {"key.pivot_coulomb_friction": "20 mN m"}
    moved = reference(RIG, pushed(1.0, 0.02, 0.3, **MUTE, truth=truth)).motions
    still = moved.angle[moved.time > 0.2]
    assert still[0] > 0.01
    assert (still == still[0]).all()
    fallen = reference(RIG, pushed(0.5, 0.015, 0.5, **MUTE)).motions
    assert fallen.angle[-1] == 0.0


@pytest.mark.parametrize(("force", "friction"), [(1.2, False), (1.5, True)])
def test_the_pluck_takes_its_work_and_friction_the_heat(force, friction):
    """F a_p a = kinetic + potential energy + the pluck's own work + heat, at release."""
    found = reference(RIG, pushed(force, 0.03, friction=friction))
    release = found.events.releases[0]
    pluck = choir_pluck(choirs(RIG)[0])
    assert release.force == pytest.approx(float(pluck.vertical_force[-1]), rel=1e-12)
    moved, key = found.motions, RIG.key
    i = int(np.flatnonzero(moved.time == release.time)[0])
    angle, omega, rise = moved.angle[i], moved.angular_velocity[i], moved.rise[i]
    heat = key.pivot_coulomb_friction * angle + RIG.jack.register_friction * rise
    squares = moved.angular_velocity[: i + 1] ** 2
    heat += key.pivot_viscous_friction * np.trapezoid(squares, moved.time[: i + 1])
    work = force * key.press_arm * angle
    stored = key_oracle.energy(RIG, angle, omega)
    assert work == pytest.approx(stored + pluck.work + friction * heat, rel=1e-7)


# Steps and references.


@pytest.mark.parametrize("order", [2, 4, 6])
def test_steps_have_their_order(order):
    viscous = {"key.pivot_viscous_friction": "0.5 N m s/rad"}
    scene = pushed(duration=2 * PERIOD, **{**MUTE, "felt": False}, truth=viscous)
    drive = drive_of(RIG, scene)
    exact = reference(RIG, scene).motions.angle[-1]
    wrong = []
    for n in (2, 4):
        world = ExactWorld(
            RIG, scene.model_copy(update={"step": PERIOD / n}), order=order, tolerance=1.0
        )
        wrong.append(abs(world.play(drive).angle[-1] - exact))
    assert math.log2(wrong[0] / wrong[1]) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize("part", [slice(11, 12), slow(slice(amount(25, 100)))], ids=["one", "all"])
def test_the_reference_agrees_with_finer_steps(part):
    """In case 11 a jack of 0.3 g crosses many cells of the force law of a string of 1300 N."""
    for case in list(random_cases(RIG, 100, seed=424242))[part]:
        rig = with_values(RIG, case.values)
        if case.scene.solvable and case.scene.finger != "push":
            drive = drive_of(rig, case.scene)
            try:
                found, finer = (reference(rig, case.scene, drive, step=h) for h in (50e-6, 10e-6))
            except SceneError as error:
                if "string would be lifted" not in str(error):  # no spring is a string there
                    raise
                continue
            assert errors(found, finer).time < (1e-7 if case.scene.servo else 1e-9), case


# The ideal finger.


def test_an_ideal_finger_prescribes_the_motion_and_takes_the_force_of_inverse_dynamics():
    scene = pressed(step=250e-6)
    drive = drive_of(RIG, scene)
    found = run(RIG, scene, drive).motions
    motion = drive.joints(found.time)
    centre = fingertip_motion(RIG.arm, motion)
    planned = key_under_fingertip(RIG.key, RIG.arm.fingertip_radius, centre)
    breaks = np.min(np.abs(found.time[:, None] - (LEAD + drive.segments.ends) * PERIOD), axis=1)
    breaks[:-1] *= np.diff(found.time) > 0  # before a jump
    moving = (planned.position > 0) & (planned.velocity > 1e-3) & (breaks > 1e-5)
    assert moving.sum() > 300
    np.testing.assert_allclose(found.angle[moving], planned.position[moving], atol=1e-13)
    np.testing.assert_allclose(found.angular_velocity[moving], planned.velocity[moving], atol=1e-10)
    rise = key_oracle.rise(RIG.key, found.angle[moving])
    np.testing.assert_allclose(found.rise[moving], rise)
    tangent, _ = surface_axes(planned.position)
    arm = -np.sum(centre.position * tangent, axis=1)
    force = finger_force(RIG, planned, found.string_force) * RIG.key.press_arm / arm
    np.testing.assert_allclose(found.finger_force[moving], force[moving], atol=1e-9)


def test_an_ideal_finger_plucks_where_it_was_planned():
    found, drive = press_solved("return")
    clearance, law = RIG.jack.string_clearance, plan_press(RIG).law
    start, top = LEAD * PERIOD, LEAD * PERIOD + law.return_start
    height = choir_pluck(choirs(RIG)[0]).release_height
    lever = RIG.plectrum.length - RIG.plectrum.overlap
    travel = lever * RIG.plectrum.overlap / RIG.jack.tongue.pivot

    def reaches(rise, after, before):
        def past(time):
            centre = fingertip_motion(RIG.arm, drive.joints(np.array([time])))
            key = key_under_fingertip(RIG.key, RIG.arm.fingertip_radius, centre)
            return key.position[0] - float(angle_of_rise(RIG.key, rise))

        return brentq(past, after, before, xtol=1e-14)

    end = found.motions.time[-1]
    for event, rise, after, before in (
        (found.events.contacts, clearance, start, top),
        (found.events.releases, clearance + height, start, top),
        (found.events.returns, clearance - travel, top, end),
    ):
        assert [e.choir for e in event] == [0]
        assert event[0].time == pytest.approx(reaches(rise, after, before), abs=1e-9)


# The servo.


def played(world, drive, samples):
    """Yield before each sample: number and joints [rad], and then the motors' torques [N m]."""
    for i in range(samples):
        before = world.finger.joints()
        world.advance(drive.reference(i), True)
        yield i, before, world.finger.torques()


def test_the_motors_give_what_the_position_loops_say():
    """A PID on the encoder's counts, from the same motion."""
    scene = scene_of("paper", engine="exact")
    drive = drive_of(RIG, scene)
    world, servo = ExactWorld(RIG, scene, drive.start), scene.servo
    stiffness, damping = np.array(servo.stiffness), np.array(servo.damping)
    integral, last = gravity_torque(RIG.arm, np.array(drive.start)), np.zeros(2)
    radians = RIG.arm.radians_per_count
    for i, joints, torques in played(world, drive, drive.samples):
        counts, speeds = drive.reference(i)(np.array([0.0, 1.0]))
        error = (counts[0] - np.round((np.array(joints) - drive.start) / radians)) * radians
        spin = (speeds[1] - speeds[0]) * radians / PERIOD**2
        expected = stiffness * error + damping * (error - last) / PERIOD + integral
        expected += np.array(servo.feedforward) * spin
        limited = np.abs(expected) < RIG.arm.torque_limit
        integral = integral + limited * stiffness * error * PERIOD / servo.integral_time
        last, most = error, RIG.arm.torque_limit
        assert torques == pytest.approx(np.clip(expected, -most, most), rel=1e-9, abs=1e-11)


def test_an_arm_is_settled_at_the_same_count_as_the_rigid_bodies():
    """Following errors in radians have the rounding of the joints' angles."""
    world = ExactWorld(RIG, scene_of("paper", engine="exact"))
    world.advance(at_rest, True)
    random, radians = np.random.default_rng(0), RIG.arm.radians_per_count
    most = round(SETTLED * RIG.arm.counts_per_revolution)
    for _ in range(200):
        start, count = random.uniform(-3, 3), int(random.integers(-500_000, 500_000))
        for error in (most, -most, most + 1, -most - 1):
            reference = start + count * radians
            world.press.finger.lag[:] = reference - start - (count - error) * radians, 0.0
            assert world.finger.settled == (abs(error) <= most)


# Extremes, and refused scenes.


def test_a_servo_that_cannot_lift_its_key_rests_without_events():
    rig = with_values(RIG, {"jack.mass": "20 kg"})
    moved = run(rig, scene_of("paper", engine="exact", step=1e-3)).motions
    assert moved.angle.max() < 1e-11  # by the blow of the finger
    assert moved.finger_force.max() > 1
    per_sample = len(moved.time) / (moved.time[-1] / PERIOD)
    assert per_sample < 2.1


def test_unsupported_scenes_are_refused():
    with pytest.raises(SceneError, match="rigid"):
        ExactWorld(RIG, pushed().model_copy(update={"string": "modal"}))
    with pytest.raises(SceneError, match="select_solver"):
        ExactWorld(RIG, pushed().model_copy(update={"step": None, "accuracy": "1 us"}))
    with pytest.raises(SceneError, match=r"plectrum\.overlap"):
        ExactWorld(with_values(RIG, {"plectrum.overlap": "4.4999 mm"}), pushed())


def test_motions_beyond_the_model_are_refused():
    with pytest.raises(SceneError, match=r"1\.2 rad"):
        run(RIG, pushed(force=50, duration=0.2, felt=False))
    scene = pressed()
    drive = drive_of(RIG, scene)
    world = ExactWorld(RIG, scene, drive.start)
    world.advance(drive.reference(0), True)
    with pytest.raises(SceneError, match=r"after 0\.000976562 s .* suddenly within the key"):
        world.advance(drive.reference(70), True)
    near = RIG.replaced({"arm.base_x": -0.1, "arm.base_z": 0.1})
    upper, lower = RIG.arm.upper_length, RIG.arm.lower_length
    elbow = math.acos((0.02 - upper**2 - lower**2) / (2 * upper * lower))
    shoulder = -math.pi / 4 - math.atan2(lower * math.sin(elbow), upper + lower * math.cos(elbow))
    with pytest.raises(SceneError, match="balance pin"):
        ExactWorld(near, scene, (shoulder, elbow)).advance(drive.reference(0), True)


@pytest.mark.parametrize("finger", ["push", "ideal", "paper"])
def test_diverging_motion_is_refused(finger):
    truth = {"key.pivot_viscous_friction": "1e200 N m s/rad"}
    scene = pushed(1.5, 0.1, truth=truth) if finger == "push" else scene_of(finger, truth=truth)
    with pytest.raises(SceneError, match=r"diverged|too many steps"):
        reference(RIG, scene)


def test_a_key_without_mass_is_no_jump_of_the_fingertip():
    """There is no fingertip in a push; and the instant in the message is a number."""
    light = {"key.inertia": 1e-9, "jack.mass": 1e-9, "key.gravity_moment": 0.0}
    with pytest.raises(SceneError, match=r"after [0-9.e-]+ s the simulation diverged"):
        run(RIG.replaced(light), pushed(force=1.2, duration=0.03))


# The world.


def test_a_world_of_a_push():
    scene = pushed(duration=0.0055)
    world = ExactWorld(RIG, scene)
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
    unpowered = ExactWorld(RIG, scene)
    assert not unpowered.advance(drive.reference(0), False).angle.any()


@pytest.mark.parametrize("name", ["pluck", "return", "paper"])
def test_samples_one_by_one_are_the_complete_drive(name):
    scene = scene_of(name, engine="exact", step=1e-3)
    drive = drive_of(RIG, scene)
    world = ExactWorld(RIG, scene, drive.start)
    parts = [world.advance(drive.reference(i), True) for i in range(drive.samples)]
    complete = observe(RIG, scene, drive)
    assert world.events == complete.events
    for field, values in vars(complete.motions).items():
        joined = np.concatenate([getattr(part, field) for part in parts])
        np.testing.assert_array_equal(joined, values)


def test_brakes_hold_the_arm_without_power():
    scene = scene_of("paper", engine="exact")
    drive = PressDrive(RIG, plan_press(RIG).segments)
    world = ExactWorld(RIG, scene, drive.start)
    for i in range(LEAD + 60):
        world.advance(drive.reference(i), True)
    held = world.finger.joints()
    assert not world.advance(drive.reference(80), False).angle[-1] < 0
    assert world.finger.joints() == held
    assert world.finger.torques() == (0.0, 0.0)
    assert world.finger.settled
    world.finger.block(1)
    for _ in range(5):
        world.advance(drive.reference(80), True)
    assert world.finger.joints()[0] != held[0]
    assert world.finger.joints()[1] == held[1]


def bits():
    seen = observe(RIG, pushed(duration=0.03, rest=0.01, **RETURNING))
    rows = zip(*vars(seen.motions).values(), strict=True)
    return "\n".join([*(" ".join(float(v).hex() for v in row) for row in rows), str(seen.events)])


@pytest.mark.slow
def test_the_same_bits_in_another_process_without_numba():
    code = "import sys; sys.modules['numba'] = None\n"
    code += "from tests.sim_backend.test_exact import bits; print(bits())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    expected = bits()
    assert expected.count("\n") > 40
    assert done.stdout.strip() == expected


def test_a_compilation_is_announced_once(caplog):
    numba, event = pytest.importorskip("numba"), pytest.importorskip("numba.core.event")
    caplog.set_level("INFO")
    announcement = Announcement()
    for dispatcher in (numba.njit(lambda: 0), select, select):
        data = {"dispatcher": dispatcher}
        announcement.notify(event.Event("numba:compile", event.EventStatus.START, data))
    assert [record.getMessage() for record in caplog.records] == [
        "compiling the exact engine, once for this version: about 15 s"
    ]


@pytest.mark.parametrize("name", sorted({*packaged_scenes()} - {"transient"}))
def test_packaged_scenes_are_exact_at_their_step(name):
    """To 1e-5 us, where the rigid bodies miss the events of `paper` by 1 us."""
    pytest.importorskip("numba")
    scene = scene_of(name, engine="auto", sensors=None).with_engine()
    assert scene.engine == "exact"
    found = errors(run(RIG, scene, press_solved(name)[1]), press_solved(name)[0])
    assert found.time < 1e-11
    assert found.force < 1e-5
