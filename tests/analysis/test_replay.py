"""Replay of a press: measured motion, and the model aligned with it."""

from dataclasses import replace

import numpy as np
import pytest

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.phases import find_phases
from sautereau.analysis.press.replay import replay, shown_stretch
from sautereau.daq.file.recorded import Joints
from sautereau.rig.load import load_rig, with_values
from sautereau.sim_backend.scene import load_scene


@pytest.fixture(scope="module")
def press(make_press):
    return make_press()


@pytest.fixture(scope="module")
def phases(press):
    return find_phases(press)


@pytest.fixture(scope="module")
def scene(press, phases):
    return replay(press, phases, np.linspace(0.03, 0.12, 361))


def middle(motion):
    """Return the mid-line of the plectrum; its second last point is under the string."""
    half = motion.outline.shape[1] // 2
    return (motion.outline[:, :half] + motion.outline[:, : half - 1 : -1]) / 2


def held(scene):
    (pluck,) = scene.phases.plucks
    return (scene.time >= pluck.contact) & (scene.time < pluck.release)


def test_the_wire_lies_on_the_plectrum_while_it_is_held(scene):
    """The clamp plus the centre line's point under the string is the position of the string."""
    (motion,) = scene.choirs
    during = held(scene)
    plectrum = motion.choir.plectrum
    clamp = np.stack(
        [np.full(during.sum(), plectrum.overlap - plectrum.length), motion.height[during]], -1
    )
    contact = clamp + middle(motion)[during, -2]
    np.testing.assert_allclose(contact, motion.wire[during, 0], atol=3e-6)


def test_unheld_it_is_straight_and_the_string_rests_till_contact(scene):
    (motion,) = scene.choirs
    during = held(scene)
    assert not middle(motion)[~during, :, 1].any()
    assert (middle(motion)[during][3:, -1, 1] < 0).all()
    (pluck,) = scene.phases.plucks
    before = scene.time < pluck.contact - (scene.time[1] - scene.time[0])
    assert not motion.deflection[before].any()
    assert not motion.wire[before].any()


def test_the_jacks_height_is_0_at_contact_and_rises_all_the_way(scene, press):
    (motion,) = scene.choirs
    (pluck,) = scene.phases.plucks
    assert np.interp(pluck.contact, scene.time, motion.height) == pytest.approx(0, abs=1e-5)
    rise = np.interp(scene.time, press.data.index, press.data["jack_rise"])
    assert np.all(np.diff(motion.height[rise < 9e-3]) > 0)
    # Off the string it moves as far as the jack was seen to.
    free = scene.time < pluck.contact
    np.testing.assert_allclose(np.diff(motion.height[free]), np.diff(rise[free]), atol=1e-9)


def test_after_release_it_vibrates_at_the_strings_pitch(press, phases):
    (pluck,) = phases.plucks
    start = pluck.release + 1e-3
    fine = replay(press, phases, start + np.arange(2000) / 20_000)
    (motion,) = fine.choirs
    middle = motion.deflection[:, 0, 80]
    size = np.abs(np.fft.rfft(middle * np.hanning(2000), 40_000))
    assert np.fft.rfftfreq(40_000, 1 / 20_000)[np.argmax(size)] == pytest.approx(365, abs=2)
    assert np.all(motion.deflection[:, :, 0] == 0)
    np.testing.assert_allclose(motion.deflection[:, :, -1], 0, atol=1e-12)


def test_a_press_without_a_pluck_leaves_the_string_at_rest(make_press):
    mute = make_press(slope=0)
    scene = replay(mute, find_phases(mute), np.linspace(0.03, 0.12, 50))
    (motion,) = scene.choirs
    assert not motion.plucks
    assert not motion.deflection.any()
    assert not middle(motion)[..., 1].any()
    clearance = motion.choir.jack.string_clearance
    rise = np.interp(scene.time, mute.data.index, mute.data["jack_rise"])
    np.testing.assert_allclose(motion.height, rise - clearance, atol=1e-12)


def test_the_arm_is_the_encoders_and_may_be_missing(press, phases, scene):
    assert scene.joints is None
    t = np.array([0.0, 0.2])
    arm = Joints(t, np.array([0.0, 0.2]), np.array([1.0, 0.0]))
    shown = replay(press, phases, np.array([0.05, 0.1]), arm).joints
    np.testing.assert_allclose(shown, [[0.05, 0.75], [0.1, 0.5]])


def test_on_the_way_back_the_tongue_lets_the_plectrum_pass(make_press):
    """A press that returns: the tongue rotates back once, between the wire's top and rest."""
    forth = make_press(until=0.25)
    velocity = forth.data["velocity"].to_numpy()
    force = forth.data["force"].to_numpy()
    back = make_press.build(
        np.concatenate([velocity, -velocity[::-1]]), np.concatenate([force, 0 * force]), 51_200.0
    )
    phases = find_phases(back)
    scene = replay(back, phases, np.linspace(0.25, 0.49, 600))
    (motion,) = scene.choirs
    swung = np.flatnonzero(motion.tongue)
    assert len(swung) > 3
    assert np.all(np.diff(swung) == 1)
    assert motion.height[swung].max() < 0.9e-3
    assert motion.height[swung].min() > -0.2e-3
    assert motion.tongue.max() == pytest.approx((0.263e-3 + 0.155e-3) / 12e-3)
    # The damper has come down and stills the string.
    assert np.abs(motion.deflection[-1]).max() < 0.3 * np.abs(motion.deflection[0]).max()


@pytest.mark.parametrize(
    "changes",
    [
        {"plectrum.friction": 0.3},
        {"plectrum.overlap": "1 mm"},
        {"plectrum.overlap": "10 um"},
        {"plectrum.youngs_modulus": "0.4 GPa"},
        {"plectrum.youngs_modulus": "200 GPa"},
        {"plectrum.length": "9 mm"},
        {"jack.string_clearance": "5 mm"},
        {"string.frequency": "60 Hz", "string.length": "1.8 m", "string.diameter": "1.2 mm"},
        {"string.frequency": "1500 Hz", "string.length": "120 mm", "string.plucking_point": "9 mm"},
    ],
)
def test_any_rig_has_a_replay(press, phases, changes):
    other = replace(press, rig=with_values(press.rig, changes))
    scene = replay(other, phases, np.linspace(0.04, 0.1, 40))
    (motion,) = scene.choirs
    for array in (motion.height, motion.outline, motion.wire, motion.deflection, motion.tongue):
        assert np.isfinite(array).all()
    during = held(scene)
    string = np.array([motion.choir.plectrum.overlap - motion.choir.plectrum.length, 0.0])
    string = string + np.stack([0 * motion.height[during], motion.height[during]], -1)
    np.testing.assert_allclose(
        string + middle(motion)[during, -2], motion.wire[during, 0],
        atol=0.01 * np.abs(motion.wire).max(),
    )  # fmt: skip


def test_two_choirs_are_plucked_in_turn(make_press):
    """The second string is held where the first one's force would be found again."""
    rig = load_scene("two-choirs").true_rig(load_rig())
    press = make_press()
    double = replace(press, rig=rig)
    phases = find_phases(press)
    scene = replay(double, phases, np.linspace(0.03, 0.12, 50))
    assert len(scene.choirs) == 2
    assert [motion.plucks for motion in scene.choirs] == [True, False]


def test_the_shown_interval_must_be_in_the_recording(press, phases):
    start, stop = shown_stretch(press, phases, None, None)
    assert start == pytest.approx(phases.start - 10e-3)
    assert stop == press.data.index[-1]
    assert shown_stretch(press, phases, 0.05, 0.06) == (0.05, 0.06)
    for since, until in ((-1.0, None), (0.06, 0.05), (None, 9.0), (0.05, 0.05)):
        with pytest.raises(AnalysisError, match="must start before it ends, within the recording"):
            shown_stretch(press, phases, since, until)
