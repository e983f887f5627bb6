"""Departures of a prediction from presses that depart by a known amount."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.compare import _departure, compare, predicted_features
from analysis.errors import AnalysisError
from analysis.model.predict import predict
from analysis.phases import HeldString, Phases


@pytest.fixture(scope="module")
def prediction(paper):
    return predict(paper)


def phases_of(prediction, *, slope=0.0, rise=0.0, duration=0.0):
    """Return phases that a measurement has from which the prediction departs by this much."""
    predicted_slope, predicted_rise = predicted_features(prediction)
    magnitude = predicted_rise / (1 + rise)
    held = HeldString(
        contact=0.04,
        release=0.04 + prediction.contact_duration / (1 + duration),
        contact_std=1e-5,
        release_std=1e-5,
        contact_force=0.3,
        peak_force=0.3 + magnitude,
        force_step=magnitude,
        slope=predicted_slope / (1 + slope),
    )
    return Phases(0.01, 0.2, (held,), 0.072, 0.07, 0.072, ())


MUTE = Phases(0.01, 0.2, (), 0.072, None, None, ())


def test_known_departures_of_one_press(prediction):
    found = compare([phases_of(prediction, slope=0.1, rise=-0.2, duration=0.05)], prediction)
    assert found.presses == 1
    assert found.slope_error.value == pytest.approx(0.1, rel=1e-12)
    assert found.magnitude_error.value == pytest.approx(-0.2, rel=1e-12)
    assert found.duration_error.value == pytest.approx(0.05, rel=1e-12)
    for departure in (found.slope_error, found.magnitude_error, found.duration_error):
        assert departure.low is None
        assert departure.high is None


def test_mean_and_interval_of_three(prediction):
    """Student's t of 2 degrees of freedom is 4.302653 at 97.5 %."""
    found = compare([phases_of(prediction, rise=r) for r in (0.1, 0.2, 0.3)], prediction)
    half = 4.302653 * 0.1 / np.sqrt(3)
    assert found.magnitude_error.value == pytest.approx(0.2, rel=1e-12)
    assert found.magnitude_error.low == pytest.approx(0.2 - half, rel=1e-6)
    assert found.magnitude_error.high == pytest.approx(0.2 + half, rel=1e-6)


def test_mute_presses_do_not_count(prediction):
    found = compare([MUTE, phases_of(prediction, slope=0.1), MUTE], prediction)
    assert found.presses == 1
    assert found.slope_error.value == pytest.approx(0.1, rel=1e-12)


@pytest.mark.parametrize("phases", [[], [MUTE], [MUTE, MUTE]])
def test_without_a_pluck_there_is_nothing_to_compare(prediction, phases):
    with pytest.raises(AnalysisError, match=f"none of the {len(phases)} presses has a pluck"):
        compare(phases, prediction)


@pytest.mark.parametrize("n", [2, 5, 20])
def test_the_interval_covers_the_mean_in_95_of_100(n):
    random = np.random.default_rng(n)
    draws = random.normal(0.1, 0.03, (2000, n))
    covered = [d.low <= 0.1 <= d.high for d in (_departure(list(row)) for row in draws)]
    assert np.mean(covered) == pytest.approx(0.95, abs=0.015)


def test_features_of_a_line_are_the_lines(prediction):
    """A force that rises in proportion to the deflection has that slope, and its own rise."""
    held = prediction.string_force > 0
    held[np.argmax(held) - 1] = True
    force = np.where(held, 0.4 + 900 * prediction.deflection, 0.2)
    slope, rise = predicted_features(replace(prediction, finger_force=force))
    assert slope == pytest.approx(900, rel=1e-9)
    deflected = np.interp(
        [prediction.contact, prediction.release], prediction.time, prediction.deflection
    )
    assert rise == pytest.approx(900 * np.ptp(deflected), rel=1e-9)
