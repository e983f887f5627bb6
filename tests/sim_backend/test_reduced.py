"""The reduced engine against closed forms, an independent solver, the model and the reference."""

import math
import os
import subprocess
import sys
from dataclasses import fields

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sautereau.analysis.model.key import finger_force
from sautereau.analysis.model.predict import rig_pluck
from sautereau.rig.instrument import Choir
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.section import GRAVITY
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.drive import PushDrive
from sautereau.sim_backend.physics.events import Motions
from sautereau.sim_backend.physics.observation import Observation, drive_of, errors
from sautereau.sim_backend.physics.reduced.engine import ReducedWorld
from sautereau.sim_backend.physics.reference.observe import reference
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.arm import fingertip_motion
from sautereau.trajectory.key import (
    key_under_fingertip,
    rise_curvature,
    rise_of_angle,
    rise_slope,
    surface_axes,
)

RIG = load_rig("paper")
KEY, JACK = RIG.key, RIG.jack
PERIOD = RIG.controller.sample_period


def scene(force="1.2 N", duration="20 ms", rest="0 s", **changes):
    told = {
        "finger": "push",
        "plectrum": "elastica",
        "string": "spring",
        "friction": True,
        "felt": True,
        "engine": "reduced",
        "step": "1 ms",
        "push": {"force": force, "duration": duration, "rest": rest},
    } | changes
    if told["finger"] == "ideal":
        del told["push"]
    return Scene.model_validate(told)


def run(rig, scene, drive=None):
    drive = drive or drive_of(rig, scene)
    world = ReducedWorld(rig, scene, drive.start)
    parts = [world.advance(drive.reference(i), True) for i in range(drive.samples)]
    joined = (np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Motions))
    found = Observation(Motions(*joined), world.events)
    assert all(np.isfinite(values).all() for values in vars(found.motions).values())
    return found


def times(events):
    return [e.time for e in events.contacts + events.releases + events.returns]


def choir(arm, clearance, mass=6e-3, overlap=0.2e-3):
    return Choir.model_construct(
        jack_arm=arm,
        jack=JACK.model_copy(update={"string_clearance": clearance, "mass": mass}),
        plectrum=RIG.plectrum.model_copy(update={"overlap": overlap}),
        string=RIG.string,
    )


MUTE = {"plectrum": "none", "string": "none"}
ALL = {"tongue": True, "damper": True}


# Independent solutions.


def solved_push(force, end):
    """Contact, release, meeting of the felt and the angle at the end, with friction."""
    pluck = rig_pluck(RIG)
    bottom = KEY.dip / KEY.press_arm
    held = {"string": True, "felt": False}

    def rates(time, state):
        angle, spin = state
        slope, bend = (
            float(rise_slope(KEY, angle)),
            float(rise_curvature(KEY, angle)) * spin**2,
        )
        height = float(rise_of_angle(KEY, angle)) - JACK.string_clearance
        string = float(pluck.force_on_jack(height)) if held["string"] else 0.0
        moment = KEY.press_arm * force + KEY.gravity_moment - KEY.pivot_coulomb_friction
        moment -= KEY.pivot_viscous_friction * spin
        if held["felt"]:
            depth = KEY.felt_stiffness * (angle - bottom) + KEY.felt_damping * spin
            moment -= KEY.press_arm**2 * max(0.0, depth)
            return [spin, moment / KEY.inertia]  # the jack flies on
        load = JACK.mass * (GRAVITY + bend) + JACK.register_friction + string
        inertia = KEY.inertia + JACK.mass * slope**2
        return [spin, (moment - slope * load) / inertia]

    def reaches(goal):
        def event(time, state):
            return float(rise_of_angle(KEY, state[0])) - goal

        event.terminal, event.direction = True, 1
        return event

    found, time, state = [], 0.0, [0.0, 0.0]
    clearance, release = JACK.string_clearance, JACK.string_clearance + pluck.release_height
    for goal, change in (
        (clearance, None),
        (release, "string"),
        (float(rise_of_angle(KEY, bottom)), "felt"),
        (math.inf, None),
    ):
        part = solve_ivp(
            rates, (time, end), state, "DOP853", events=reaches(goal), rtol=1e-11, atol=1e-15,
            max_step=2e-4,
        )  # fmt: skip
        time, state = part.t[-1], part.y[:, -1]
        if time < end:
            found.append(time)
        if change:
            held[change] = not held[change]
    return found, state


def test_a_push_with_friction_and_felt_is_that_of_an_independent_solver():
    end = 24 * PERIOD  # within the felt, before the key turns
    found, (angle, spin) = solved_push(1.2, end)
    assert len(found) == 3
    happened = run(RIG, scene(duration=f"{end} s"))
    np.testing.assert_allclose(times(happened.events), found[:2], atol=2e-8)
    assert happened.motions.time[-1] == pytest.approx(end, abs=1e-15)
    assert happened.motions.angle[-1] == pytest.approx(angle, abs=1e-7)
    fine = run(RIG, scene(duration=f"{end} s", step="50 us"))
    np.testing.assert_allclose(times(fine.events), found[:2], atol=1e-12)
    assert fine.motions.angle[-1] == pytest.approx(angle, abs=1e-11)
    assert fine.motions.spin[-1] == pytest.approx(spin, abs=1e-9)
    pluck = rig_pluck(RIG)
    force = float(pluck.force_on_jack(pluck.release_height))
    assert fine.events.releases[0].force == pytest.approx(force, rel=1e-9)


def test_steps_are_of_order_four():
    exact = run(RIG, scene(step="10 us"))
    wrong = [
        abs(run(RIG, scene(step=f"{PERIOD / n} s")).motions.angle[-1] - exact.motions.angle[-1])
        for n in (1, 2, 4)
    ]
    assert wrong[0] / wrong[1] > 10
    assert wrong[1] / wrong[2] > 10


SCENES = {
    "a push and the fall back": (RIG, scene(duration="50 ms", rest="300 ms", **ALL)),
    "a heavy push": (RIG, scene(force="20 N", rest="50 ms", friction=False, **ALL)),
    "an ideal finger": (RIG, scene(finger="ideal", **ALL)),
    "a key that leaves the finger": (
        with_values(RIG, {"jack.register_friction": "60 mN", "press.return_speed": "0.5 m/s"}),
        scene(finger="ideal", **ALL),
    ),
    "two choirs": (
        RIG.model_copy(update={"more_choirs": (choir(0.205, 3e-3),)}),
        scene(duration="30 ms", rest="200 ms", **ALL),
    ),
    "two choirs under an ideal finger": (
        RIG.model_copy(update={"more_choirs": (choir(0.205, 3e-3),)}),
        scene(finger="ideal", **ALL),
    ),
    "a light key and heavy jacks": (
        with_values(
            RIG.model_copy(update={"more_choirs": (choir(0.2, 2.5e-3, mass=9e-3),)}),
            {"key.inertia": "1e-4 kg m^2"},
        ),
        scene(force="8 N", duration="8 ms", rest="80 ms", friction=False),
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_events_are_those_of_the_reference(name):
    rig, told = SCENES[name]
    drive = drive_of(rig, told)
    true = reference(rig, told, drive)
    assert true.events.contacts
    for step, time, angle in ((1e-3, 1e-6, 3e-6), (1e-4, 2e-9, 1e-8)):
        happened = run(rig, told.model_copy(update={"step": step}), drive)
        assert errors(happened, true).time < time
        fit = np.interp(happened.motions.time, true.motions.time, true.motions.angle)
        np.testing.assert_allclose(happened.motions.angle, fit, atol=angle)


def test_an_ideal_finger_prescribes_the_motion_and_takes_the_force_of_inverse_dynamics():
    told = scene(finger="ideal", step="250 us")
    drive = drive_of(RIG, told)
    happened = run(RIG, told, drive).motions
    motion = drive.joints(happened.time)
    planned = key_under_fingertip(KEY, RIG.arm.fingertip_radius, fingertip_motion(RIG.arm, motion))
    breaks = np.min(np.abs(happened.time[:, None] - drive.breaks), axis=1)
    moving = (planned.position > 0) & (planned.velocity > 1e-3) & (breaks > 1e-5)
    assert moving.sum() > 300
    np.testing.assert_allclose(happened.angle[moving], planned.position[moving], atol=1e-13)
    np.testing.assert_allclose(happened.spin[moving], planned.velocity[moving], atol=1e-10)
    np.testing.assert_allclose(happened.rise[moving], rise_of_angle(KEY, happened.angle[moving]))
    tangent, _ = surface_axes(planned.position)
    arm = -np.sum(fingertip_motion(RIG.arm, motion).position * tangent, axis=1)
    force = finger_force(RIG, planned, happened.string_force) * KEY.press_arm / arm
    np.testing.assert_allclose(happened.finger_force[moving], force[moving], atol=1e-9)


# Conservation.


def test_energy_is_that_of_the_push_less_that_of_the_pluck():
    told = scene(duration=f"{15 * PERIOD} s", rest="5 ms", friction=False, felt=False)
    happened = run(RIG, told.model_copy(update={"step": 1e-4}))
    (contact,), (release,) = happened.events.contacts, happened.events.releases
    motions = happened.motions
    slope = rise_slope(KEY, motions.angle)
    energy = (KEY.inertia + JACK.mass * slope**2) * motions.spin**2 / 2
    energy += JACK.mass * GRAVITY * motions.rise - KEY.gravity_moment * motions.angle
    pushed = motions.angle[motions.time <= 15 * PERIOD]
    work = 1.2 * KEY.press_arm * np.minimum(motions.angle, pushed[-1])
    work[motions.time > release.time] -= rig_pluck(RIG).work
    free = (motions.time < contact.time) | (motions.time > release.time)
    np.testing.assert_allclose(energy[free], work[free], atol=1e-13, rtol=1e-9)


def flight():
    """Return a push into the felt, and its rows while the jack flies on; mute, frictionless."""
    told = scene(force="0.5 N", duration="180 ms", friction=False, **MUTE)
    motions = run(RIG, told.model_copy(update={"step": 2e-6})).motions
    aloft = np.flatnonzero(motions.rise - rise_of_angle(KEY, motions.angle) > 1e-7)
    rows = aloft[: 1 + np.argmax(np.diff(aloft, append=10**9) > 1)]
    assert len(rows) > 1000
    assert rows[-1] + 10 < len(motions.time)
    return motions, rows


def test_a_jack_in_the_air_is_ballistic():
    motions, rows = flight()
    time = motions.time[rows] - motions.time[rows[0]]
    parabola = np.polynomial.Polynomial.fit(time, motions.rise[rows], 2).convert()
    assert 2 * parabola.coef[2] == pytest.approx(-GRAVITY, rel=1e-9)
    np.testing.assert_allclose(parabola(time), motions.rise[rows], atol=1e-14)


def test_landing_conserves_momentum():
    motions, rows = flight()
    before, after = rows[-1] - 1, rows[-1] + 3
    step = motions.time[1] - motions.time[0]
    speed = (motions.rise[before] - motions.rise[before - 1]) / step - GRAVITY * step / 2
    slope = rise_slope(KEY, motions.angle[before])
    together = (KEY.inertia + JACK.mass * slope**2) * motions.spin[after]
    brought = JACK.mass * slope * speed
    assert brought < -1e-4
    expected = KEY.inertia * motions.spin[before] + brought
    assert together == pytest.approx(expected, abs=5e-3 * abs(brought))  # felt, in 8 us


def test_a_resting_key_stays_at_rest():
    happened = run(RIG, scene(force="0 N", **ALL))
    for name in ("angle", "spin", "rise", "finger_force", "string_force"):
        assert not getattr(happened.motions, name).any()
    assert not times(happened.events)


def test_dry_friction_holds_the_key_as_long_as_it_can():
    back = JACK.mass * GRAVITY * KEY.jack_arm - KEY.gravity_moment
    dry = KEY.pivot_coulomb_friction + JACK.register_friction * KEY.jack_arm
    least = (back + dry) / KEY.press_arm
    stuck = run(RIG, scene(force=f"{least * (1 - 1e-9)} N"))
    assert not stuck.motions.angle.any()
    assert run(RIG, scene(force=f"{least * (1 + 1e-6)} N")).motions.angle.max() > 0
    # Let go half way up, it falls back only where friction is the less.
    rough = with_values(RIG, {"key.pivot_coulomb_friction": "12 mN m"})
    held = run(rough, scene(force="0.5 N", duration="15 ms", rest="200 ms", **MUTE)).motions
    assert held.angle[-1] > 1e-3
    assert held.spin[-1] == 0.0
    fallen = run(RIG, scene(force="0.5 N", duration="15 ms", rest="500 ms", **MUTE)).motions
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
@pytest.mark.parametrize("force", ["0.15 N", "1.2 N", "20 N"])
def test_extremes_converge(values, force):
    rig = with_values(RIG, values)
    told = scene(force=force, duration="60 ms", rest="20 ms", **ALL)
    coarse, fine = (
        run(rig, told.model_copy(update={"step": step})).events for step in (2e-3, 5e-5)
    )
    first = [[*events.contacts[:1], *events.releases[:1]] for events in (coarse, fine)]
    assert len(first[0]) == len(first[1])
    for a, b in zip(*first, strict=True):
        assert a.time == pytest.approx(b.time, abs=1e-6)


@pytest.mark.parametrize("step", [1e-6, 1e-5, 3e-4, 2e-3])
def test_any_step_gives_the_same_pluck(step):
    exact = times(run(RIG, scene(step="50 us")).events)
    found = times(run(RIG, scene().model_copy(update={"step": step})).events)
    np.testing.assert_allclose(found, exact, atol=2e-8)


def test_jacks_that_land_without_end_come_to_stand():
    # Each landing kicks the light key from under the other jack.
    rig = with_values(RIG, {"key.inertia": "1e-4 kg m^2"})
    rig = rig.model_copy(update={"more_choirs": (choir(0.2, 1.6e-3, mass=12e-3),)})
    told = scene(force="0.5 N", duration="30 ms", rest="30 ms", friction=False)
    coarse, fine = (run(rig, told.model_copy(update={"step": s})) for s in (1e-3, 1e-4))
    assert errors(coarse, fine).time < 1e-6
    assert len(coarse.events.releases) == 2


# The world.


def test_a_world_of_a_push():
    told = scene(duration="5.5 ms")
    world = ReducedWorld(RIG, told)
    drive = PushDrive(RIG, told.push)
    home, offset = np.array(RIG.arm.home_angles), np.array(told.start_offset)
    np.testing.assert_allclose(world.start, home + offset)
    assert world.finger.joints() == world.start
    assert world.finger.torques() == (0.0, 0.0)
    assert world.finger.settled
    parts = [world.advance(drive.reference(i), True) for i in range(8)]
    assert world.samples == 8
    assert world.time == 8 * PERIOD
    np.testing.assert_allclose([p.finger_force[0] for p in parts], [1.2] * 6 + [0.0] * 2)
    unpowered = ReducedWorld(RIG, told)
    assert not unpowered.advance(drive.reference(0), False).angle.any()


def test_a_world_follows_the_joints_of_its_finger():
    told = scene(finger="ideal")
    drive = drive_of(RIG, told)
    world = ReducedWorld(RIG, told, drive.start)
    for i in range(60):
        world.advance(drive.reference(i), True)
    np.testing.assert_allclose(
        world.finger.joints(), drive.joints(np.array([60 * PERIOD])).position[0], atol=1e-12
    )


def test_what_it_cannot_do_is_refused():
    with pytest.raises(SceneError, match="rigid"):
        ReducedWorld(RIG, scene().model_copy(update={"string": "modal"}))
    with pytest.raises(SceneError, match="settle"):
        ReducedWorld(RIG, scene().model_copy(update={"step": None, "accuracy": "1 us"}))
    with pytest.raises(SceneError, match=r"plectrum\.overlap"):
        ReducedWorld(with_values(RIG, {"plectrum.overlap": "4.4999 mm"}), scene())
    with pytest.raises(SceneError, match=r"1\.2 rad"):
        run(RIG, scene(force="50 N", duration="200 ms", felt=False))
    told = scene(finger="ideal")
    drive = drive_of(RIG, told)
    world = ReducedWorld(RIG, told, drive.start)
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
        ReducedWorld(near, told, (shoulder, elbow)).advance(drive.reference(0), True)


SCRIPT = """
import sys
if sys.argv[1] == "without": sys.modules["numba"] = None
from dataclasses import fields
from sautereau.rig.load import load_rig
from sautereau.sim_backend.physics.reduced.engine import ReducedWorld
from sautereau.sim_backend.physics.drive import PushDrive
from sautereau.sim_backend.scene import Scene
told = Scene.model_validate({"finger": "push", "plectrum": "elastica", "string": "spring",
    "friction": True, "felt": True, "tongue": True, "damper": True, "engine": "reduced",
    "step": "1 ms", "push": {"force": "1.2 N", "duration": "30 ms", "rest": "10 ms"}})
rig = load_rig("paper")
world, drive = ReducedWorld(rig, told), PushDrive(rig, told.push)
for i in range(drive.samples):
    motions = world.advance(drive.reference(i), True)
    print(*(float(getattr(motions, f.name)[-1]).hex() for f in fields(motions)))
print(world.events)
"""


def test_the_same_bits_in_every_process_and_without_numba():
    def printed(how, **environment):
        return subprocess.run(
            [sys.executable, "-c", SCRIPT, how],
            env=os.environ | environment,
            capture_output=True,
            text=True,
            check=True,
        ).stdout

    first = printed("with")
    assert first.count("\n") > 40
    assert printed("with") == first
    assert printed("without") == first
