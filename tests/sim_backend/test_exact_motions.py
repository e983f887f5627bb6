"""The exact engine against closed forms of its motions, and the convergence of its events."""

import math

import numpy as np
import pytest

from sautereau.analysis.model.predict import rig_pluck
from sautereau.rig.load import with_values
from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.physics.drive import drive_of
from sautereau.sim_backend.physics.observation import errors, reference
from tests import key_oracle
from tests.budget import slow
from tests.sim_backend.scenes import (
    BARE,
    RETURNING,
    RIG,
    choir,
    pressed,
    pushed,
    run,
    scene_of,
)

LIGHT = with_values(RIG, {"key.inertia": "1e-4 kg m^2"})
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
        LIGHT.model_copy(update={"more_choirs": (choir(0.2, 2.5e-3, mass=9e-3),)}),
        pushed(force=8, duration=0.008, rest=0.08, friction=False),
    ),
    "landings without end": (
        LIGHT.model_copy(update={"more_choirs": (choir(0.2, 1.6e-3, mass=12e-3),)}),
        pushed(force=0.5, duration=0.03, rest=0.03, friction=False),
    ),
}
PERIOD = RIG.controller.sample_period
COVERED_BY_OTHERS = ("an ideal finger", "two choirs", "a heavy push")
"""Scenes with no part that another one lacks."""


def times(events):
    return [e.time for e in events.contacts + events.releases + events.returns]


def test_a_pushed_key_moves_by_its_energy():
    """(I + m r'^2) w^2 / 2 = (F a_p + H) a - m g r(a)."""
    key, mass = RIG.key, RIG.jack.mass
    moved = reference(RIG, pushed(1.2, 40 * PERIOD, **BARE)).motions
    angle = moved.angle
    moment = 1.2 * key.press_arm + key.gravity_moment
    stored = moment * angle - mass * GRAVITY * key_oracle.rise(key, angle)
    speed = np.sqrt(2 * stored / (key.inertia + mass * key_oracle.slope(key, angle) ** 2))
    np.testing.assert_allclose(moved.angular_velocity, speed, rtol=1e-10, atol=1e-14)


def test_a_light_jacks_key_swings_on_the_felt_as_a_spring():
    """To the felt in sqrt(2 I dip / P), then about the depth P / k."""
    changes = {"jack.mass": "1e-12 kg", "key.gravity_moment": "0 N m"}
    changes["key.felt_damping"] = "0 N s/m"
    scene = pushed(1.0, 0.06, **{**BARE, "felt": True}, truth=changes)
    moved = reference(RIG, scene).motions
    key = RIG.key
    moment, dip = key.press_arm, key.dip / key.press_arm
    stiffness = key.felt_stiffness * key.press_arm**2
    omega, contact = math.sqrt(stiffness / key.inertia), math.sqrt(2 * key.inertia * dip / moment)
    mean, speed = moment / stiffness, moment * contact / key.inertia
    phase = omega * (moved.time - contact)
    depth = mean * (1 - np.cos(phase)) + speed / omega * np.sin(phase)
    first = (phase > 0) & (phase < math.pi + 2 * math.atan(mean * omega / speed))
    assert first.sum() > 20
    np.testing.assert_allclose(moved.angle[first] - dip, depth[first], rtol=0, atol=1e-10)
    assert moved.angle[~first][-1] < dip


def test_a_jack_in_flight_is_ballistic():
    """A key with a large moment to the back falls faster, and is on its rail before the jack."""
    truth = {"key.gravity_moment": "-50 mN m"}
    moved = reference(RIG, pushed(1.0, 20 * PERIOD, 0.2, **BARE, truth=truth)).motions
    start = int(np.flatnonzero(moved.time == 20 * PERIOD)[-1])
    a0, w0, y0 = moved.angle[start], moved.angular_velocity[start], moved.rise[start]
    v0 = w0 * key_oracle.slope(RIG.key, a0)
    fall = 0.05 / RIG.key.inertia
    down = (w0 + math.sqrt(w0**2 + 2 * fall * a0)) / fall
    lands = (v0 + math.sqrt(v0**2 + 2 * GRAVITY * y0)) / GRAVITY
    time = moved.time - 20 * PERIOD
    turns = (time > 0) & (time < down)
    parabola = a0 + w0 * time - fall * time**2 / 2
    np.testing.assert_allclose(moved.angle[turns], parabola[turns], atol=1e-13)
    air = (time > 0) & (time < lands)
    parabola = y0 + v0 * time - GRAVITY * time**2 / 2
    np.testing.assert_allclose(moved.rise[air], parabola[air], atol=1e-13)
    assert np.abs(time - lands).min() < 1e-11
    assert np.abs(time - down).min() < 1e-11
    assert not moved.rise[time > lands + 1e-9].any()


@pytest.mark.parametrize("name", [slow(n) if n in COVERED_BY_OTHERS else n for n in SCENES])
def test_events_converge(name):
    rig, scene = SCENES[name]
    drive = drive_of(rig, scene)
    true = reference(rig, scene, drive)
    assert true.events.contacts
    for step, time in ((1e-3, 1e-6), (1e-4, 2e-9)):
        found = run(rig, scene.model_copy(update={"step": step}), drive)
        assert errors(found, true).time < time


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
        {"jack.damper.stiffness": "15 kN/m"},
        {"jack.register_friction": "0 mN", "key.pivot_coulomb_friction": "0 mN m"},
    ],
)
@pytest.mark.parametrize("force", [0.15, 1.2, 20.0])
def test_extremes_converge(values, force):
    rig = with_values(RIG, values)
    scene = pushed(force=force, duration=0.06, rest=0.02, **RETURNING)
    coarse, fine = (run(rig, scene.model_copy(update={"step": step})) for step in (2e-3, 5e-5))
    first = [[*f.events.contacts[:1], *f.events.releases[:1]] for f in (coarse, fine)]
    assert len(first[0]) == len(first[1])
    for a, b in zip(*first, strict=True):
        assert a.time == pytest.approx(b.time, abs=1e-6)
    assert fine.motions.angle.min() >= -1e-14


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.005, 1.0])
@pytest.mark.parametrize("finger", ["ideal", "paper"])
def test_slowest_and_fastest_presses(finger, speed):
    """At 1 m/s, with raised limits of arm and planner."""
    changes = {"press.jack_speed": f"{speed} m/s"}
    if speed == 1.0:
        changes |= {
            "press.run_up_acceleration": "2000 m/s^2", "press.run_up_jerk": "1e8 m/s^3",
            "press.run_down_acceleration": "2000 m/s^2", "press.run_down_jerk": "1e8 m/s^3",
            "arm.speed_limit": "100 rad/s", "arm.acceleration_limit": "1e6 rad/s^2",
            "arm.jerk_limit": "1e10 rad/s^3", "arm.torque_limit": "1000 N m",
        }  # fmt: skip
    moved = run(with_values(RIG, changes), scene_of(finger, engine="exact"))
    assert len(moved.events.contacts) == len(moved.events.releases) == 1


def test_a_push_with_friction_and_felt_is_that_of_an_independent_solver():
    end = 24 * PERIOD  # in the felt, before the key reverses
    pluck, bottom = rig_pluck(RIG), RIG.key.dip / RIG.key.press_arm
    contact, release = key_oracle.plucked(RIG, 1.2, pluck, friction=True)
    felt = key_oracle.solved(
        RIG, 1.2, release, end, friction=True, stop=lambda _, state: state[0] - bottom
    )
    # The felt stops the key, and the jack flies on.
    _, (angle, omega) = key_oracle.solved(RIG, 1.2, felt, end, friction=True, felt=True, jack=False)
    assert felt[0] < end
    found = run(RIG, pushed(duration=end))
    np.testing.assert_allclose(times(found.events), [contact[0], release[0]], atol=2e-8)
    fine = reference(RIG, pushed(duration=end))
    np.testing.assert_allclose(times(fine.events), [contact[0], release[0]], atol=1e-12)
    assert fine.motions.time[-1] == pytest.approx(end, abs=1e-15)
    assert fine.motions.angle[-1] == pytest.approx(angle, abs=1e-11)
    assert fine.motions.angular_velocity[-1] == pytest.approx(omega, abs=1e-9)
