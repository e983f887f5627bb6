"""Modes of a tapped key against the eigenvalues of the independent simulator's key."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim

from benchmarks.independent import ONE_FACTOR
from benchmarks.independent.assembly import build_key
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.transient.tap import tap_response

RATE, TAPS = 20e3, 6


def tapped(conditions, seed, noise=5e-5):
    """Return force and velocity of a tapped key on its rail, and its eigenvalues [1/s]."""
    key, random = build_key(conditions), np.random.default_rng(seed)
    rail, press, laser = (key.at(x) for x in (conditions.back_arm, -0.171, -0.082))
    stiffness = key.stiffness + 2e5 * np.outer(rail, rail)
    damping = key.damping + 20.0 * np.outer(rail, rail)
    n, inverse = len(rail), np.linalg.inv(key.mass)
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ damping]])
    b = np.concatenate([np.zeros(n), -inverse @ press])[:, None]
    c = np.concatenate([np.zeros(n), -laser])[None]
    time = np.arange(round(TAPS * 0.4 * RATE)) / RATE
    force = np.zeros(len(time))
    for k in range(TAPS):
        since = (time - 0.05 - 0.4 * k) / random.uniform(0.6e-3, 1.2e-3)
        force += random.uniform(0.3, 1.0) * np.sin(np.pi * since) * ((since > 0) & (since < 1))
    discrete = cont2discrete((a, b, c, np.zeros((1, 1))), 1 / RATE, method="foh")
    velocity = dlsim(discrete, force)[1][:, 0]
    force = force + 2e-3 * random.standard_normal(len(time))
    return (force, velocity + noise * random.standard_normal(len(time))), np.linalg.eigvals(a)


@pytest.mark.parametrize("name", ["key bends at 350 Hz", "key heaves at 120 Hz"])
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
        tap_response([tuple(part[: round(0.35 * RATE)] for part in recording)], RATE)
