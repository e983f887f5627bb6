"""Which measurement would reduce an uncertainty, against formulas of the normal distribution."""

from dataclasses import replace

import numpy as np
import pytest

from sautereau.analysis.identify.information import Information

NAMES = ("plectrum.overlap", "plectrum.friction", "offset.force_gain")


def information(lacking=0.0):
    """Only the sum of overlap and friction is measured, to 0.01; friction is known to 0.1."""
    data, prior = np.array([[100.0, 100.0, 0.0]]), np.diag([0.0, 10.0, 50.0])[1:]
    return Information(NAMES, data, prior, np.array([lacking, 0.0, 0.0]))


def test_the_uncertainty_is_that_of_the_conditional_distribution():
    known = information()
    assert known.std(0) == pytest.approx(np.hypot(0.01, 0.1))
    assert known.std(0, known=[1]) == pytest.approx(0.01)
    assert known.std(0, presses=4) == pytest.approx(np.hypot(0.005, 0.1))
    assert information(lacking=0.2).std(0) == pytest.approx(np.sqrt(0.01**2 + 0.1**2 + 0.2**2))


def test_the_measurement_that_helps_is_listed_with_its_result():
    """More presses and the gain do not help: friction alone limits the overlap."""
    (only,) = information().measurements(0, scale=0.3e-3)
    assert only.what == "measure plectrum.friction, free it, and give it by --prior"
    assert only.std == pytest.approx(0.3e-3 * 0.01)
    assert information(lacking=1.0).measurements(0, scale=1.0) == ()


def test_the_measurement_that_is_asked_for_helps_once_it_is_given():
    """The prior of another parameter counts, and that of the parameter itself does not."""
    data, prior = np.array([[100.0, 100.0, 0.0]]), np.diag([1e4, 500.0, 50.0])
    known = Information(NAMES, data, prior, np.zeros(3))
    assert known.std(0) == pytest.approx(np.hypot(0.01, 1 / 500))
    assert known.std(1) == pytest.approx(np.hypot(0.01, 1e-4))
    assert known.measurements(0, scale=1.0)[0].what.startswith("record")


def test_the_place_of_the_pin_counts_until_the_lengths_are_measured():
    known = replace(information(), names=("key.jack_arm", "key.front_arm", "offset.force_gain"))
    (best,) = known.measurements(0, scale=1.0)
    assert best.what.startswith("measure the place of the pin")
    assert best.std == pytest.approx(0.01)


def test_a_number_that_acts_alike_without_a_prior_leaves_a_result_undetermined():
    data, prior = np.diag([100.0, 0.0, 0.0]), np.diag([0.0, 0.0, 50.0])
    data[0, 1] = 100.0
    known = Information(NAMES, data, prior, np.zeros(3))
    assert known.std(0) == np.inf
    assert known.measurements(0, scale=1.0)[0].std == pytest.approx(0.01)
