"""The fit of damped modes against signals whose modes are known."""

import numpy as np
import pytest

from sautereau.analysis.phases.response import esprit
from sautereau.analysis.transient.modes import fit_modes
from tests.budget import slow

RATE, SAMPLES = 10_240.0, 256
TIME = np.arange(SAMPLES) / RATE
NOISE = np.array([2.0, 0.01])


def ringing(frequency, decay, amplitude):
    """Return a damped mode of two channels, its amplitudes in units of the noise."""
    wave = np.exp((-decay + 2j * np.pi * frequency) * TIME)
    return NOISE[:, None] * np.real(np.outer(amplitude, wave))


def noisy(rng, *modes):
    trend = NOISE[:, None] * (3 * TIME / TIME[-1] - 50 * (TIME / TIME[-1]) ** 2)
    return sum(modes, trend) + NOISE[:, None] * rng.standard_normal((2, SAMPLES))


def test_modes_without_noise_are_exact():
    signals = ringing(300, 40, [5, 2j]) + ringing(1234, 10, [1, 1])
    found = fit_modes(signals, RATE, NOISE).modes
    assert [m.frequency for m in found] == pytest.approx([300, 1234], rel=1e-6)
    assert [m.decay for m in found] == pytest.approx([40, 10], rel=1e-4)
    assert found[0].amplitude == pytest.approx(NOISE * [5, 2j], rel=1e-4)


def _coverage(draws):
    """Return the errors of two close modes over their standard errors, shape (draws, 2, 4)."""
    rng = np.random.default_rng(15)
    truth = (330.0, 60.0, 5 * np.exp(1j)), (390.0, 40.0, 3.0 + 0j)
    errors = []
    for _ in range(draws):
        signals = noisy(rng, *(ringing(f, d, [a, 2.0]) for f, d, a in truth))
        found = sorted(fit_modes(signals, RATE, NOISE).modes, key=lambda m: m.frequency)
        assert len(found) == 2
        for mode, (frequency, decay, amplitude) in zip(found, truth, strict=True):
            away = mode.amplitude[0] - NOISE[0] * amplitude
            of_frequency = (mode.frequency - frequency) / mode.frequency_std
            of_decay = (mode.decay - decay) / mode.decay_std
            of_amplitude = [part / mode.amplitude_std[0] for part in (away.real, away.imag)]
            errors.append([of_frequency, of_decay, *of_amplitude])
    return np.array(errors)


@pytest.mark.parametrize("draws", [5, slow(300)])
def test_uncertainties_cover(draws):
    errors = np.abs(_coverage(draws))
    tolerance = 3 * np.sqrt(0.25 / len(errors))
    assert np.mean(errors < 1, axis=0) == pytest.approx(0.683, abs=tolerance)
    assert np.mean(errors < 1.96, axis=0) == pytest.approx(0.95, abs=tolerance)


@pytest.mark.parametrize(("draws", "most"), [(6, 0), slow(2000, 6)])
def test_false_alarms_are_rarer_than_stated(draws, most):
    """Of noise and a trend; 2 of 2000 are expected."""
    rng = np.random.default_rng(1)
    assert sum(len(fit_modes(noisy(rng), RATE, NOISE).modes) > 0 for _ in range(draws)) <= most


def test_noise_larger_than_stated_is_recognised():
    rng = np.random.default_rng(2)
    found = fit_modes(3 * noisy(rng), RATE, NOISE)
    assert found.excess == pytest.approx(9, rel=0.2)
    assert found.modes == ()


def test_esprit_finds_shared_poles():
    signals = ringing(300, 40, [5, 2j]) + ringing(330, 10, [1, 1])
    poles = esprit([signals], signals.shape[1] // 3, 4) * RATE
    above = sorted(poles[poles.imag > 0], key=lambda p: p.imag)
    expected = [-40 + 2j * np.pi * 300, -10 + 2j * np.pi * 330]
    np.testing.assert_allclose(above, expected, rtol=1e-6)
