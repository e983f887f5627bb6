"""A push in the rigid-body engine, against the key's equation of motion solved by scipy."""

import numpy as np
import pytest

from sautereau.analysis.model.predict import rig_pluck
from sautereau.rig.load import with_values
from sautereau.sim_backend.physics.observation import observe
from tests import key_oracle
from tests.key_oracle import energy, solved
from tests.sim_backend.scenes import RIG, push_of, scene_of

KEY, JACK = RIG.key, RIG.jack
PERIOD = RIG.controller.sample_period


def true_pluck(force, level="elastica"):
    """Return the times of contact and release, and time and state at the end."""
    contact, release = key_oracle.plucked(RIG, force, rig_pluck(RIG, level))
    return contact[0], release[0], release


def event_errors(step, level="elastica"):
    contact, release, _ = true_pluck(1.2, level)
    events = observe(RIG, scene_of("pluck", step=step, plectrum=level)).events
    assert len(events.contacts) == len(events.releases) == 1
    return events.contacts[0].time - contact, events.releases[0].time - release


@pytest.mark.parametrize(("step", "bound"), [(5e-4, 2e-6), (1e-4, 0.2e-6), (2e-5, 0.02e-6)])
def test_contact_and_release_are_the_equations(step, bound):
    assert np.abs(event_errors(step)).max() < bound


@pytest.mark.parametrize("level", ["rods", "beam", "two-beam"])
def test_every_level_is_plucked(level):
    assert np.abs(event_errors(1e-4, level)).max() < 0.5e-6


def test_a_release_inside_a_step_keeps_second_order():
    """The state at the end, after both events."""
    duration = 15 * PERIOD
    *_, release = true_pluck(1.2)
    _, (angle, spin) = solved(RIG, 1.2, release, duration)
    error = []
    for step in (PERIOD / 8, PERIOD / 16):
        moved = observe(RIG, scene_of("pluck", step=step, push=push_of(1.2, duration))).motions
        error.append(moved.angle[-1] - angle)
        assert moved.angular_velocity[-1] == pytest.approx(spin, rel=2e-5)
    assert abs(error[0]) < 5e-7
    assert abs(error[1]) < abs(error[0]) / 2.5


def test_a_push_that_ends_within_a_step_ends_there():
    """Half way between two steps; then the key continues by its own weight."""
    duration = 0.0101
    moved = observe(RIG, scene_of("free-key", push=push_of(0.2, duration, 9e-3))).motions
    end = solved(RIG, 0.2, (0, [0, 0]), duration)
    _, (angle, spin) = solved(RIG, 0.0, end, moved.time[-1])
    assert moved.angle[-1] == pytest.approx(angle, abs=5e-9)
    assert moved.angular_velocity[-1] == pytest.approx(spin, abs=5e-7)
    np.testing.assert_array_equal(np.unique(moved.finger_force), [0.0, 0.2])


def test_viscous_friction_is_that_of_the_equation():
    scene = scene_of("free-key", friction=True, push=push_of(0.2, 0.020))
    truth = {
        "key.pivot_viscous_friction": "2 mN m s/rad",
        "key.pivot_coulomb_friction": "0 N m",
        "jack.register_friction": "0 N",
    }
    viscous = with_values(RIG, truth)
    error = []
    for step in (PERIOD / 4, PERIOD / 8):
        moved = observe(RIG, scene.model_copy(update={"truth": truth, "step": step})).motions
        _, (angle, _) = solved(viscous, 0.2, (0, [0, 0]), 0.020, friction=True)
        at_end = np.argmin(np.abs(moved.time - 0.020))
        assert moved.time[at_end] == pytest.approx(0.020, abs=1e-9)
        error.append(moved.angle[at_end] - angle)
    assert abs(error[0]) < 3e-8
    assert abs(error[1]) < abs(error[0]) / 2.5


def test_energy_is_that_of_the_push():
    """Without friction: the work of the push minus the work on the string is the energy."""
    scene = scene_of("pluck", step=2e-5)
    found = observe(RIG, scene)
    moved, (contact,), (release,) = found.motions, found.events.contacts, found.events.releases
    stored = energy(RIG, moved.angle, moved.angular_velocity)
    pushed = np.minimum(moved.angle, np.interp(scene.push.duration, moved.time, moved.angle))
    work = 1.2 * KEY.press_arm * pushed
    work[moved.time > release.time] -= rig_pluck(RIG).work
    free = (moved.time < contact.time) | (moved.time > release.time)
    assert np.sum(moved.time > release.time) > 5
    np.testing.assert_allclose(stored[free], work[free], rtol=1e-5, atol=1e-9)


def test_dry_friction_holds_the_key_up_to_its_limit():
    """Static balance: gravity 8.65 mN m, friction of pivot and register 0.5 and 4.3 mN m."""
    needed = key_oracle.static_moment(RIG, friction=1) / KEY.press_arm
    for factor, moves in ((0.999, False), (1.001, True)):
        push = push_of(needed * factor, 0.020)
        moved = observe(RIG, scene_of("free-key", friction=True, push=push)).motions
        assert (moved.angle[-1] > 1e-7) == moves
