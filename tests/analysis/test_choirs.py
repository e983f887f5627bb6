"""Several strings on one key: their plucks, their stagger, and the finger's force."""

import numpy as np
import pytest
from scipy.integrate import trapezoid

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.key import finger_force
from sautereau.analysis.model.predict import expectation, predict
from sautereau.analysis.results.prediction import Prediction
from sautereau.rig.instrument import Choir
from sautereau.rig.units import GRAVITY
from sautereau.trajectory.key import angle_of_rise, key_motion, rise_of_angle, rise_slope
from sautereau.trajectory.motion import Motion


def choir(paper, *, arm=0.0, stagger=2e-3, **plectrum):
    """Another 8' string, its jack `arm` further back and its plectrum `stagger` lower."""
    clearance = paper.jack.string_clearance + stagger
    return Choir.model_construct(
        jack_arm=paper.key.jack_arm + arm,
        jack=paper.jack.model_copy(update={"string_clearance": clearance}),
        plectrum=paper.plectrum.model_copy(update=plectrum),
        string=paper.string,
    )


def with_choirs(paper, *more, **press):
    changed = {"more_choirs": more, "press": paper.press.model_copy(update=press)}
    return paper.model_copy(update=changed)


@pytest.fixture(scope="module")
def staggered(paper):
    return with_choirs(paper, choir(paper, arm=12e-3))


def test_two_strings_with_a_stagger_give_two_plucks(paper, staggered):
    found, alone = predict(staggered), predict(paper)
    first, second = found.choirs
    assert (first.contact, first.release) == (alone.contact, alone.release)
    assert first.release < second.contact < second.release
    held = [choir.string_force > 0 for choir in found.choirs]
    assert not np.any(held[0] & held[1])
    np.testing.assert_array_equal(found.string_force, first.string_force)
    assert second.plectrum_force == pytest.approx(first.plectrum_force, rel=1e-12)


def test_the_second_jack_is_where_the_lever_puts_it(paper, staggered):
    """At contact and at release of the second string its own jack has its own height."""
    second = predict(staggered).choirs[1]
    lever = paper.key.model_copy(update={"jack_arm": staggered.more_choirs[0].jack_arm})
    speed = paper.press.jack_speed
    own = rise_of_angle(
        lever, angle_of_rise(paper.key, speed * np.array([second.contact, second.release]))
    )
    clearance = staggered.more_choirs[0].jack.string_clearance
    assert own[0] == pytest.approx(clearance, rel=1e-12)
    alone = predict(paper)
    height = (alone.release - alone.contact) * speed
    assert own[1] - clearance == pytest.approx(height, rel=1e-9)
    ratio = rise_slope(lever, 0.02) / rise_slope(paper.key, 0.02)
    faster = second.released_string.velocity_z / alone.released_string.velocity_z
    assert faster == pytest.approx(ratio, rel=1e-3)


def test_strings_held_together_add_up(paper):
    """Two like choirs on one arm are one with twice the string's force, jack and friction."""
    found, alone = predict(with_choirs(paper, choir(paper, stagger=0.0))), predict(paper)
    key, jack = paper.key, paper.jack
    angle = np.asarray(alone.deflection / key.laser_arm)
    extra = alone.string_force + jack.mass * GRAVITY + jack.register_friction
    assert len(found.rise) > len(alone.rise)
    more = np.interp(alone.rise, found.rise, found.finger_force) - alone.finger_force
    expected = extra * rise_slope(key, angle) / key.press_arm
    held = np.abs(alone.rise - alone.release * paper.press.jack_speed) > 1e-5
    np.testing.assert_allclose(more[held], expected[held], rtol=1e-5, atol=1e-5)
    assert found.work == pytest.approx(2 * alone.work, rel=1e-12)


def test_the_fingers_work_is_energy_and_heat_of_both(paper, staggered):
    found, key = predict(staggered), paper.key
    angle = found.deflection / key.laser_arm
    motion = key_motion(
        key, Motion(found.rise, np.full_like(found.rise, 0.072), np.zeros_like(found.rise))
    )
    jacks = (paper.jack, staggered.more_choirs[0].jack)
    levers = (key, key.model_copy(update={"jack_arm": staggered.more_choirs[0].jack_arm}))
    energy = key.inertia * np.ptp(motion.velocity[[0, -1]] ** 2) / 2 * -1
    energy += -key.gravity_moment * angle[-1] + key.pivot_coulomb_friction * angle[-1]
    energy += trapezoid(key.pivot_viscous_friction * motion.velocity, angle)
    for jack, lever in zip(jacks, levers, strict=True):
        rise = rise_of_angle(lever, angle)
        energy += (jack.mass * GRAVITY + jack.register_friction) * rise[-1]
        speed = rise_slope(lever, angle) * motion.velocity
        energy += jack.mass * (speed[-1] ** 2 - speed[0] ** 2) / 2
    strings = found.work
    work = trapezoid(found.finger_force * key.press_arm, angle)
    assert work == pytest.approx(energy + strings, rel=1e-5)


def test_a_single_force_leaves_the_other_strings_untouched(staggered, paper):
    """The other jacks weigh on the key all the same."""
    angle = Motion(np.zeros(1), np.zeros(1), np.zeros(1))
    one = finger_force(staggered, angle, np.array([0.5]))
    two = finger_force(staggered, angle, np.array([[0.5], [0.0]]))
    assert one == two
    weight = paper.jack.mass * GRAVITY * staggered.more_choirs[0].jack_arm / paper.key.press_arm
    bare = finger_force(paper, angle, np.array([0.5]))
    assert one - bare == pytest.approx(weight, rel=1e-12)


def test_a_planner_expects_all_plucks(staggered):
    found = predict(staggered)
    expected = expectation(found)
    speed = staggered.press.jack_speed
    assert expected.contact == pytest.approx(found.choirs[0].contact * speed, rel=1e-12)
    assert expected.release == pytest.approx(found.choirs[1].release * speed, rel=1e-9)


def test_text_and_json_say_the_same_of_every_string(paper, staggered):
    found = predict(staggered)
    result = Prediction(staggered, found)
    said = str(result)
    for each, choir in zip(result.document["choirs"], found.choirs, strict=True):
        assert each["pluck_duration"] == choir.pluck_duration == each["release"] - each["contact"]
        assert f"pluck duration {each['pluck_duration'] * 1e3:.4g} ms" in said
        assert f"{np.degrees(each['release_angle']):.4g} deg" in said
    assert f"release force {found.release_force:.4g} N of string 1" in said
    assert "Vosc of string 1" in said
    assert "of string 1" not in str(Prediction(paper, predict(paper)))


def test_faults_name_the_choir(paper):
    late = with_choirs(paper, choir(paper, stagger=7e-3))
    with pytest.raises(
        ModelError, match=r"jack_rise: .* lower more_choirs\[0\]\.plectrum\.overlap"
    ):
        predict(late)
    deep = choir(paper, overlap=4.4e-3, youngs_modulus=1e6)
    with pytest.raises(
        ModelError, match=r"more_choirs\[1\]\.plectrum\.overlap: at 4\.4 mm .* still held"
    ):
        predict(with_choirs(paper, choir(paper), deep))
