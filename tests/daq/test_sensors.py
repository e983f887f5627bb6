"""Sensors against closed forms."""

import math

import numpy as np
import pytest

from daq.sensors import (
    Clipped,
    clipping,
    correct,
    sample_times,
    time_shift,
    to_si,
    to_volts,
    undo_high_pass,
)

RATE = 51_200.0


@pytest.fixture
def velocity(paper):
    return paper.daq.channels[0]


def with_high_pass(channel, corner):
    return channel.model_copy(update={"high_pass": corner})


def test_volts_to_si_and_back(velocity):
    volts = np.array([-4.0, 0.0, 2.0])
    np.testing.assert_allclose(to_si(volts, velocity), [-0.1, 0.0, 0.05], rtol=1e-15)
    np.testing.assert_allclose(to_volts(to_si(volts, velocity), velocity), volts, rtol=1e-15)


@pytest.mark.parametrize("corner", [0.1, 0.5, 1.0])
def test_droop_of_a_step_is_undone(velocity, corner):
    """A step through the high-pass is exp(-w t); the step itself must come back."""
    t = np.arange(int(0.5 * RATE)) / RATE
    step = np.exp(-2 * math.pi * corner * t)
    found = correct(to_volts(step, velocity), with_high_pass(velocity, corner), RATE)
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


def test_no_high_pass_leaves_the_scaled_signal(velocity):
    volts = np.array([1.0, 2.0, -3.0])
    found = correct(volts, with_high_pass(velocity, 0.0), RATE)
    assert np.array_equal(found, volts * velocity.scale)


def test_empty_signal_stays_empty(velocity):
    assert correct(np.empty(0), velocity, RATE).shape == (0,)
    assert clipping(np.empty(0), velocity) == []


def test_the_delay_moves_the_time_axis_back(velocity):
    assert time_shift(velocity) == -1.1e-3
    times = sample_times(3, velocity, RATE)
    np.testing.assert_allclose(times, np.array([0, 1, 2]) / RATE - 1.1e-3, rtol=1e-15)


def test_clipping_finds_both_ends_of_the_range(velocity):
    volts = np.zeros(20)
    volts[:2] = 4.0
    volts[5] = -3.997
    volts[8:11] = 4.5
    volts[12] = 3.99
    volts[18:] = -4.0
    found = clipping(volts, velocity)
    assert found == [Clipped(0, 2), Clipped(5, 6), Clipped(8, 11), Clipped(18, 20)]
