"""A lag is taken back to a fraction of a sample, and nothing is carried on beyond the samples."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.daq.signals.calibration import HALF_WIDTH, WIDTH, undelayed

RATE = 51_200.0


@pytest.mark.parametrize("lag", [0.0, 0.1, 0.5, 0.512, 0.999, 1.0, 56.32, 1000.25])
@pytest.mark.parametrize(
    ("frequency", "error"), [(100.0, 1e-9), (5e3, 1e-9), (10e3, 1e-8), (15e3, 2e-4), (20e3, 0.06)]
)
def test_a_sine_comes_back(lag, frequency, error):
    w = 2 * np.pi * frequency / RATE
    k = np.arange(4000)
    found = undelayed(np.sin(w * (k - lag)), lag)
    assert len(found) == 4000 - np.ceil(lag)
    inner = slice(HALF_WIDTH, len(found) - HALF_WIDTH)
    np.testing.assert_allclose(found[inner], np.sin(w * k[: len(found)])[inner], atol=error)


@given(st.integers(0, 80), st.floats(0, 90))
def test_as_many_as_there_are(n, lag):
    signal = np.arange(float(n))
    found = undelayed(signal, lag)
    integer = abs(lag - round(lag)) < 1e-9
    assert len(found) == max(0, n - (round(lag) if integer else int(np.ceil(lag))))
    # A straight line is carried between two samples by any polynomial.
    np.testing.assert_allclose(found, lag + np.arange(len(found)), atol=1e-9)


def test_near_the_ends_the_polynomial_is_through_fewer():
    """Of degree 1 beside the end, 3 one further in: a cubic is exact from there on."""
    k = np.arange(40.0)
    found = undelayed((k / 40) ** 3, 0.5)
    exact = ((k[:-1] + 0.5) / 40) ** 3
    assert abs(found[0] - exact[0]) > 1e-6
    assert abs(found[-1] - exact[-1]) > 1e-6
    np.testing.assert_allclose(found[1:-1], exact[1:-1], atol=1e-14)


def test_white_noise_keeps_its_power_in_the_band_that_counts():
    """Half a sample is the worst: nothing of the power below 0.3 of the rate goes."""
    noise = np.random.default_rng(0).standard_normal(2**16)
    found = undelayed(noise, 0.5)
    band = np.fft.rfftfreq(len(found)) < 0.29
    before, after = (np.abs(np.fft.rfft(x[: len(found)])[band]) ** 2 for x in (noise, found))
    assert after.sum() == pytest.approx(before.sum(), rel=2e-3)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e308])
@pytest.mark.parametrize("at", [0, 31, 32, 500, 999])
def test_what_is_no_number_spoils_what_is_near_it_alone(bad, at):
    signal = np.sin(0.1 * np.arange(1000.0))
    expected = undelayed(signal, 3.3)
    signal[at] = bad
    found = undelayed(signal, 3.3)
    far = np.abs(np.arange(len(found)) + 3.3 - at) > 2 * WIDTH
    np.testing.assert_allclose(found[far], expected[far], rtol=0, atol=1e-12)
    near = np.abs(np.arange(len(found)) + 3.3 - at) < 1
    assert not np.any(np.abs(found[near]) < 1e300)


def test_integer_delays_keep_the_samples():
    signal = np.random.default_rng(0).standard_normal(100)
    for lag in (3.0, 3 + 1e-12, 3 - 1e-12):
        assert np.array_equal(undelayed(signal, lag), signal[3:])
