"""Sensors against closed forms."""

import math
from datetime import date

import numpy as np
import pytest
from scipy import signal

from sautereau.daq.signals.calibration import (
    calibration_warning,
    restored,
    to_volts,
    undo_high_pass,
    white_noise,
)
from sautereau.rig.errors import RigError
from sautereau.rig.load import with_values

RATE = 51_200.0


@pytest.mark.parametrize("corner", [0.1, 0.5, 1.0])
def test_droop_of_a_step_is_undone(velocity, corner):
    """A step through the high-pass is exp(-w t); the step itself must come back."""
    t = np.arange(int(0.5 * RATE)) / RATE
    step = np.exp(-2 * math.pi * corner * t)
    undelayed = velocity.model_copy(update={"delay": 0.0, "low_pass": 0.0, "high_pass": corner})
    found = restored(to_volts(step, velocity), undelayed, RATE)
    np.testing.assert_allclose(found, 1.0, atol=1e-9)


def test_droop_of_a_sine_is_undone_at_second_order():
    """x = sin(a t) gives y = (a w cos + a^2 sin - a w exp) / (a^2 + w^2), from rest."""
    errors = []
    a, corner = 2 * math.pi * 7.0, 1.0
    w = 2 * math.pi * corner
    for rate in (500.0, 1000.0, 2000.0):
        t = np.arange(int(rate)) / rate
        y = a * (w * np.cos(a * t) + a * np.sin(a * t) - w * np.exp(-w * t)) / (a**2 + w**2)
        errors.append(np.abs(undo_high_pass(y, corner, rate) - np.sin(a * t)).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("corner", [0.1, 1.0, 300.0])
def test_the_sampled_filter_is_undone_exactly(corner):
    """Noise from rest through scipy's first-order high-pass, over 10 s."""
    x = np.random.default_rng(0).standard_normal(int(10 * RATE))
    x[0] = 0.0
    y = signal.lfilter(*signal.butter(1, corner, "high", fs=RATE), x)
    np.testing.assert_allclose(undo_high_pass(y, corner, RATE), x, atol=1e-9)


@pytest.mark.parametrize(("order", "corner"), [(1, 1000.0), (2, 1000.0), (2, 22_400.0), (8, 500.0)])
def test_the_low_pass_lags_as_scipys_does(velocity, order, corner):
    """By the phase of the analogue filter; the NEXUS's of order 2 are stated as 225 and 10 us."""
    channel = velocity.model_copy(update={"low_pass": corner, "low_pass_order": order})
    b, a = signal.butter(order, 2 * math.pi * corner, analog=True)
    slow = corner * 1e-3
    _, response = signal.freqs(b, a, [2 * math.pi * slow])
    expected = -np.angle(response[0]) / (2 * math.pi * slow)
    assert channel.lag - channel.delay == pytest.approx(expected, rel=1e-5)


def test_without_an_order_the_delay_is_all(velocity):
    assert velocity.low_pass_order == 0
    assert velocity.lag == velocity.delay == 1.1e-3


def test_an_order_needs_a_corner(paper):
    with pytest.raises(RigError, match="low_pass_order: 2 is given and low_pass is 0 Hz"):
        with_values(paper, {"daq.channels.1.low_pass_order": 2, "daq.channels.1.low_pass": "0 Hz"})


@pytest.mark.parametrize("std", [1e-6, 1.0])
def test_white_noise_is_separated_from_motion(std):
    time = np.arange(51_200) / RATE
    noise = std * np.random.default_rng(0).standard_normal(len(time))
    assert white_noise(1e3 * std * np.sin(300 * time) + noise) == pytest.approx(std, rel=0.02)
    assert white_noise(np.empty(0)) == white_noise(np.ones(2)) == 0


@pytest.mark.parametrize(
    ("calibrated", "message"),
    [
        (None, "has no date of calibration"),
        (date(2025, 2, 1), None),
        (date(2025, 1, 31), "367 days before the recording, more than 366"),
        (date(2026, 2, 2), None),
        (date(2026, 2, 3), "1 days after the recording"),
    ],
)
def test_the_age_of_a_calibration(velocity, calibrated, message):
    channel = velocity.model_copy(update={"calibrated": calibrated})
    found = calibration_warning(channel, date(2026, 2, 2))
    if message is None:
        assert found is None
    else:
        assert message in found
        assert "velocity: Polytec PDV-100" in found


def test_noise_in_a_part_of_the_band_has_the_density_of_white_noise():
    """A boxcar of 8 samples: 8 times the density of its own differences."""
    noise = np.random.default_rng(0).standard_normal(2**16)
    limited = np.convolve(noise, np.full(8, 1 / 8), "valid")
    assert white_noise(limited) < 0.3
    assert white_noise(limited, 64) == pytest.approx(1.0, rel=0.1)
    assert white_noise(noise, 64) == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e308])
def test_white_noise_of_what_is_hardly_a_number(bad):
    """A few samples do not count; of nothing but them there is none."""
    noisy = np.random.default_rng(0).standard_normal(5000)
    noisy[::97] = bad
    assert white_noise(noisy) == pytest.approx(1.0, rel=0.15)
    assert white_noise(np.full(50, bad)) == 0.0
