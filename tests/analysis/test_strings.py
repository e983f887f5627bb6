"""Strings held, released and damped, compared with the modal pluck and closed forms."""

import math

import numpy as np
import pytest

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.modal_pluck import modal_pluck
from sautereau.analysis.model.predict import predict
from sautereau.analysis.press.strings import QUALITY, stilled, string_decay, vibrating_strings
from sautereau.rig.load import load_rig
from sautereau.sim_backend.scene import load_scene

RIG = load_rig()
PLACE = np.array([RIG.string.plucking_point])


@pytest.fixture(scope="module")
def string():
    (only,) = vibrating_strings(RIG)
    return only


def test_the_losses_are_those_of_air_and_quality():
    string = RIG.string
    n = np.arange(1, 31)
    decay = string_decay(string, 30, 1e300)
    # The drag on a slow wide wire grows as the root of the frequency.
    thick = string.model_copy(update={"diameter": 0.1})
    wide = string_decay(thick, 30, 1e300)
    np.testing.assert_allclose(wide / wide[0], np.sqrt(n), rtol=2e-3)
    assert np.all(np.diff(decay) > 0)
    metal = string_decay(string, 30, 200.0) - decay
    np.testing.assert_allclose(metal, np.pi * string.frequency * n / 200.0, rtol=1e-9)


def test_the_papers_string_falls_by_60_db_in_6_s():
    decay = string_decay(RIG.string, 1)[0]
    assert 3 * math.log(10) / decay == pytest.approx(6.2, abs=0.1)
    assert QUALITY == 1500


@pytest.mark.parametrize("quality", [1.0, 0.0, -3.0, math.nan])
def test_a_quality_factor_of_1_or_less_is_refused(quality):
    with pytest.raises(ModelError, match=r"quality: .* must be above 1"):
        string_decay(RIG.string, 30, quality)


def test_it_is_the_modal_pluck(string):
    decay = string_decay(RIG.string, 30)
    pluck = modal_pluck(RIG, decay=decay, width=RIG.plectrum.width)
    since = np.linspace(0, 0.05, 400)
    time = string.release + since
    np.testing.assert_allclose(string.bridge_force(time), pluck.free.bridge_force(since), atol=1e-9)
    moved = string.displacement(time, PLACE)[:, :, 0].T
    at = RIG.string.plucking_point
    np.testing.assert_allclose(moved, pluck.free.motion(since, at)[0], atol=1e-12)
    prediction = predict(RIG)
    assert string.contact == pytest.approx(prediction.contact)
    assert string.release == pytest.approx(prediction.release, rel=2e-3)


def test_before_contact_it_rests_and_held_it_is_a_triangle(string):
    places = np.linspace(0, RIG.string.length, 461)
    time = np.array([0.0, string.contact, (string.contact + string.release) / 2])
    moved = string.displacement(time, places)
    assert not moved[:, :2].any()
    triangle = moved[1, 2]
    assert triangle.max() == pytest.approx(triangle[108])
    bends = np.abs(np.diff(triangle, 2)) > 1e-12
    assert np.flatnonzero(bends).tolist() == [107]
    # A steady string pulls at the bridge by tension times slope.
    pull = RIG.string.tension * (triangle[-2] - triangle[-1]) / 1e-3
    assert string.bridge_force(time)[2, 1] == pytest.approx(pull, rel=1e-9)
    assert not string.bridge_force(time)[:2].any()


def test_it_is_continuous_when_the_damper_touches_it(string):
    end = string.release + 0.1
    damped = stilled(string, end)
    early = np.linspace(string.release, end - 1e-9, 300)
    np.testing.assert_array_equal(damped.bridge_force(early), string.bridge_force(early))
    near = end + np.array([-1e-8, 1e-8])
    before, after = damped.displacement(near, PLACE)[1, :, 0]
    assert after == pytest.approx(before, abs=1e-7)
    # What the felt's 40 1/s take more than the air, put back.
    late = end + 0.5 + np.linspace(0, 5 / 365, 500)
    loud, soft = (s.bridge_force(late)[:, 1] for s in (string, damped))
    assert (soft * np.exp(40 * (late - end))).std() == pytest.approx(loud.std(), rel=0.02)


def test_a_missing_or_too_early_damper_is_refused(string):
    with pytest.raises(ModelError, match="before the release"):
        stilled(string, string.release - 1e-3)
    bare = RIG.replaced({"jack.damper": None})
    with pytest.raises(ModelError, match=r"jack\.damper"):
        stilled(vibrating_strings(bare)[0], 1.0)


def test_every_choir_is_plucked_at_its_own_time():
    rig = load_scene("two-choirs").true_rig(RIG)
    found = vibrating_strings(rig)
    expected = predict(rig).choirs
    assert len(found) == len(expected) == 2
    for string, choir in zip(found, expected, strict=True):
        assert string.contact == choir.contact
        assert string.release == pytest.approx(choir.release, rel=5e-3)


def test_modes_are_limited_to_the_requested_frequency():
    (found,) = vibrating_strings(RIG, highest=3650.0)
    assert len(found.string.order) == 10
    with pytest.raises(ModelError, match="the number of modes is 0"):
        vibrating_strings(RIG, highest=100.0)
