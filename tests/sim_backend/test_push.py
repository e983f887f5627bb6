"""A force on the key, rigid bodies: against the key's own equation, solved by scipy."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sautereau.analysis.model.predict import rig_pluck
from sautereau.rig.load import load_rig
from sautereau.rig.section import GRAVITY
from sautereau.sim_backend.parts import Push
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.physics.world import new_world
from sautereau.sim_backend.scene import load_scene

RIG = load_rig("paper")
KEY, JACK = RIG.key, RIG.jack
PERIOD = RIG.controller.sample_period


def rise(angle):
    return KEY.jack_arm * np.tan(angle) + KEY.jack_surface_height * (1 / np.cos(angle) - 1)


def slope(angle):
    return (KEY.jack_arm + KEY.jack_surface_height * math.sin(angle)) / math.cos(angle) ** 2


def solved(force, start, until, string=None, damping=0.0, stop=None):
    """The key's angle and spin from a time and state on, to a time or to where ``stop`` is 0."""

    def rate(_, state):
        angle, spin = state
        b, hb, sine = KEY.jack_arm, KEY.jack_surface_height, math.sin(angle)
        bend = (2 * b * sine + hb * (1 + sine**2)) / math.cos(angle) ** 3
        load = JACK.mass * (GRAVITY + bend * spin**2)
        if string is not None:
            load += float(string.force_on_jack(max(rise(angle) - JACK.string_clearance, 0.0)))
        moment = KEY.press_arm * force + KEY.gravity_moment - damping * spin
        inertia = KEY.inertia + JACK.mass * slope(angle) ** 2
        return [spin, (moment - slope(angle) * load) / inertia]

    events = []
    if stop is not None:
        stop.terminal = True
        events = [stop]
    time, state = start
    done = solve_ivp(
        rate, (time, until), state, "DOP853", events=events, rtol=1e-11, atol=1e-14
    )  # fmt: skip
    return done.t[-1], done.y[:, -1]


def true_pluck(force, level="elastica"):
    """Times of contact and release, and the state at the end."""
    pluck = rig_pluck(RIG, level)
    top = JACK.string_clearance + pluck.release_height
    contact = solved(force, (0, [0, 0]), 1, stop=lambda t, y: rise(y[0]) - JACK.string_clearance)
    release = solved(force, contact, 1, pluck, stop=lambda t, y: rise(y[0]) - top)
    return contact[0], release[0], release


def scene_of(name="pluck", **changes):
    return load_scene(name).model_copy(update=changes)


def push(force, duration, rest="0 s"):
    return Push.model_validate({"force": force, "duration": duration, "rest": rest})


def event_errors(step, level="elastica"):
    contact, release, _ = true_pluck(1.2, level)
    events = observe(RIG, scene_of(step=step, plectrum=level)).events
    assert len(events.contacts) == len(events.releases) == 1
    return events.contacts[0].time - contact, events.releases[0].time - release


@pytest.mark.parametrize(("step", "bound"), [(5e-4, 2e-6), (1e-4, 0.2e-6), (2e-5, 0.02e-6)])
def test_contact_and_release_are_the_equations(step, bound):
    assert np.abs(event_errors(step)).max() < bound


@pytest.mark.parametrize("level", ["rods", "beam", "two-beam"])
def test_every_level_is_plucked(level):
    assert np.abs(event_errors(1e-4, level)).max() < 0.5e-6


def test_a_release_inside_a_step_does_not_smear_into_the_motion():
    """The state at the end, after both events."""
    duration = 15 * PERIOD
    *_, release = true_pluck(1.2)
    _, (angle, spin) = solved(1.2, release, duration)
    error = []
    for step in (PERIOD / 8, PERIOD / 16):
        moved = observe(RIG, scene_of(step=step, push=push("1.2 N", f"{duration} s"))).motions
        error.append(moved.angle[-1] - angle)
        assert moved.spin[-1] == pytest.approx(spin, rel=2e-5)
    assert abs(error[0]) < 5e-7
    assert abs(error[1]) < abs(error[0]) / 2.5


def test_a_push_that_ends_within_a_step_ends_there():
    """Half way between two steps, and the key goes on by its own weight."""
    duration = 0.0101
    moved = observe(RIG, scene_of("free-key", push=push("0.2 N", f"{duration} s", "9 ms"))).motions
    end = solved(0.2, (0, [0, 0]), duration)
    _, (angle, spin) = solved(0.0, end, moved.time[-1])
    assert moved.angle[-1] == pytest.approx(angle, abs=5e-9)
    assert moved.spin[-1] == pytest.approx(spin, abs=5e-7)
    np.testing.assert_array_equal(np.unique(moved.finger_force), [0.0, 0.2])


def test_the_free_key_lands_on_its_rail_and_stays():
    """Pushed, let go, back down: the landing as the equation has it, and without a rebound."""
    moved = observe(RIG, load_scene("free-key")).motions
    end = solved(0.2, (0, [0, 0]), 0.020)
    landing, _ = solved(0.0, end, 1, stop=lambda _, y: y[0])
    landed = np.flatnonzero((moved.time > 0.1) & (moved.angle < 1e-12))[0]
    assert moved.time[landed] == pytest.approx(landing, abs=1e-6)
    assert (moved.angle[:landed] > 0).all()
    np.testing.assert_allclose(moved.angle[landed:], 0, atol=1e-12)
    np.testing.assert_allclose(moved.rise[landed:], 0, atol=1e-12)
    np.testing.assert_allclose(moved.spin[landed:], 0, atol=1e-9)


def test_energy_is_that_of_the_push():
    """Without friction: work of the push, less what the string took, is all in the motion."""
    moved = observe(RIG, scene_of(step=2e-5)).motions
    speed = moved.spin * np.array([slope(a) for a in moved.angle])
    stored = (
        KEY.inertia * moved.spin**2 / 2
        + JACK.mass * speed**2 / 2
        + JACK.mass * GRAVITY * moved.rise
        - KEY.gravity_moment * moved.angle
    )
    work = 1.2 * KEY.press_arm * moved.angle
    pluck = rig_pluck(RIG)
    top = JACK.string_clearance + pluck.release_height
    released = (moved.rise > top + 1e-9) & (moved.time < 0.015)
    before = moved.rise < JACK.string_clearance
    np.testing.assert_allclose(stored[before], work[before], rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(stored[released], work[released] - pluck.work, rtol=1e-5)


def test_viscous_friction_slows_the_key_as_the_equation_says():
    scene = scene_of("free-key", friction=True, push=push("0.2 N", "20 ms"))
    damping = 2e-3
    truth = {
        "key.pivot_viscous_friction": f"{damping} N m s/rad",
        "key.pivot_coulomb_friction": "0 N m",
        "jack.register_friction": "0 N",
    }
    error = []
    for step in (PERIOD / 4, PERIOD / 8):
        moved = observe(RIG, scene.model_copy(update={"truth": truth, "step": step})).motions
        _, (angle, _) = solved(0.2, (0, [0, 0]), 0.020, damping=damping)
        at_end = np.argmin(np.abs(moved.time - 0.020))
        assert moved.time[at_end] == pytest.approx(0.020, abs=1e-9)
        error.append(moved.angle[at_end] - angle)
    assert abs(error[0]) < 3e-8
    assert abs(error[1]) < abs(error[0]) / 2.5


def test_dry_friction_holds_a_key_that_is_hardly_pushed():
    """Its own weight lifts the front by 8.65 mN m, and 0.5 + 4.3 mN m of friction add to it."""
    needed = (
        JACK.mass * GRAVITY * KEY.jack_arm
        - KEY.gravity_moment
        + KEY.pivot_coulomb_friction
        + JACK.register_friction * KEY.jack_arm
    ) / KEY.press_arm
    for share, moves in ((0.999, False), (1.001, True)):
        scene = scene_of("free-key", friction=True, push=push(f"{needed * share} N", "20 ms"))
        moved = observe(RIG, scene).motions
        assert (moved.angle[-1] > 1e-7) == moves


def test_no_power_is_no_push():
    world = new_world(RIG, load_scene("pluck"))
    for _ in range(5):
        motions = world.advance(lambda f: (np.zeros((len(f), 2)), np.zeros((len(f), 2))), False)
    np.testing.assert_allclose(motions.angle, 0, atol=1e-15)
    np.testing.assert_array_equal(motions.finger_force, 0)
    start = RIG.arm.home_angles
    scene = load_scene("pluck")
    assert world.finger.joints() == (
        start[0] + scene.start_offset[0], start[1] + scene.start_offset[1],
    )  # fmt: skip
    assert world.finger.torques() == (0, 0)
    assert world.finger.settled
