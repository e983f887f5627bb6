"""Modes of a tapped key against the eigenvalues of the independent simulator's key."""

import numpy as np
import pytest

from benchmarks.independent import ONE_FACTOR
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.transient.tap import tap_response
from tests.budget import slow
from tests.taps import RATE, TAPS, tapped

SLOW = slow("key heaves at 120 Hz")


@pytest.mark.parametrize("name", ["key bends at 350 Hz", SLOW])
def test_modes_of_a_tapped_key_are_those_of_its_equations(name):
    recording, values = tapped(ONE_FACTOR[name], seed=1)
    found = tap_response([recording], RATE)
    true = sorted({round(abs(v), 3): v for v in values if v.imag > 0}.values(), key=abs)
    true = [v for v in true if 50 < abs(v) / (2 * np.pi) < 1500 and -v.real / abs(v) < 0.2]
    assert found.taps == TAPS
    for value in true:
        frequency, damping = abs(value) / (2 * np.pi), -value.real / abs(value)
        mode = min(found.modes, key=lambda m: abs(m.frequency - frequency))
        assert mode.frequency == pytest.approx(frequency, rel=0.01)
        assert abs(mode.frequency - frequency) < 4 * mode.frequency_std + 1e-3 * frequency
        assert mode.damping == pytest.approx(damping, rel=0.15, abs=0.002)


def test_too_few_taps_are_refused_and_counted():
    recording, _ = tapped(ONE_FACTOR["key bends at 350 Hz"], seed=2)
    with pytest.raises(AnalysisError, match="1 taps found, and 3 are needed"):
        tap_response([_until(0.35, recording)], RATE)
    with pytest.raises(
        AnalysisError, match="1 taps found and 1 cut off by the ends of a recording"
    ):
        tap_response([_until(0.55, recording)], RATE)


def test_a_tap_that_the_end_of_a_recording_cuts_off_is_counted_and_not_used():
    recording, _ = tapped(ONE_FACTOR["key bends at 350 Hz"], seed=2)
    found = tap_response([_until(0.4 * TAPS - 0.25, recording)], RATE)
    assert (found.taps, found.cut) == (TAPS - 1, 1)


def _until(end, recording):
    """Return force and velocity up to a time [s]."""
    return tuple(part[: round(end * RATE)] for part in recording)


def test_equal_taps_without_noise_and_without_force_at_some_frequencies():
    """A pair of equal samples has no force at all at the Nyquist frequency: 0 / 0."""
    force, velocity = np.zeros(round(TAPS * 0.4 * RATE)), np.zeros(round(TAPS * 0.4 * RATE))
    time = np.arange(round(0.2 * RATE)) / RATE
    ringing = 1e-2 * np.exp(-100 * time) * np.sin(2 * np.pi * 300 * time)
    for k in range(TAPS):
        start = round((0.05 + 0.4 * k) * RATE)
        force[start : start + 2] = 1.0
        velocity[start : start + len(ringing)] = ringing
    response = tap_response([(force, velocity)], RATE)
    assert response.taps == TAPS
    (mode,) = response.modes
    assert mode.frequency == pytest.approx(300, rel=0.02)


@pytest.mark.parametrize("ring", [0.0, 4e-3])
def test_the_fall_of_a_lifted_key_is_no_mode(ring):
    """It rises at 18 mm/s, slowed down by 1.1 m/s^2, and falls at 0.4 m/s^2 back to its rest."""
    random = np.random.default_rng(1)
    force, velocity = np.zeros(round(TAPS * 0.4 * RATE)), np.zeros(round(TAPS * 0.4 * RATE))
    time = np.arange(round(0.3 * RATE)) / RATE
    pulse = np.sin(np.pi * time / 1e-3) * (time < 1e-3)
    for k in range(TAPS):
        speed, start = 0.018, round((0.05 + 0.4 * k) * RATE)  # equal taps, as of a finger
        top = speed / 1.1
        landing = top + speed / np.sqrt(1.1 * 0.4)
        since = time - 0.5e-3  # the middle of the pulse
        flying = np.where(since < top, 1.1, 0.4) * (top - since) * (since < landing)
        response = np.cumsum(pulse) / pulse.sum()  # a free body follows the impulse
        force[start : start + len(pulse)] += speed * pulse
        velocity[start : start + len(pulse)] += flying * response
        decaying = np.exp(-0.03 * 2 * np.pi * 120 * time) * np.cos(2 * np.pi * 120 * time)
        velocity[start : start + len(pulse)] += ring / 0.018 * speed * decaying * response
    noise = random.standard_normal((2, len(force)))
    found = tap_response([(40 * force + 2e-3 * noise[0], velocity + 2e-5 * noise[1])], RATE)
    assert found.flight == pytest.approx(landing, rel=0.05)
    if not ring:
        assert not found.modes
        return
    mode = min(found.modes, key=lambda mode: abs(mode.frequency - 120))
    assert mode.frequency == pytest.approx(120, rel=0.005)
    assert mode.damping == pytest.approx(0.03, rel=0.05)
