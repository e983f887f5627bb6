"""The least-squares problem: whitening of correlated residuals with gaps, and the solver."""

from unittest.mock import Mock

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.optimize import least_squares

from sautereau.analysis.identify.observed import noise_at_rest
from sautereau.analysis.identify.problem import autocovariance, minimise, whitening
from sautereau.trajectory.motion import Motion

STEP = 0.5e-3


def autoregressive(random, count, share=0.8):
    noise = random.standard_normal(count + 200)
    found = np.zeros_like(noise)
    for k in range(1, len(noise)):
        found[k] = share * found[k - 1] + noise[k]
    return found[200:]


def with_gaps(count):
    used = np.ones(count, bool)
    used[100:120] = used[300:301] = False
    return used


@pytest.mark.parametrize("free_offset", [False, True])
def test_whitening_is_that_of_the_dense_covariance(free_offset):
    used = with_gaps(400)
    covariance = 4e-6 * np.power(0.8, np.arange(100.0))
    white = whitening(used, covariance, free_offset)
    at = np.flatnonzero(used)
    dense = toeplitz(np.r_[covariance, np.zeros(300)])[np.ix_(at, at)]
    factor = np.linalg.cholesky(dense)
    residual = 1e-3 * np.random.default_rng(1).standard_normal(len(at))
    expected = np.linalg.solve(factor, residual)
    if free_offset:
        trends = np.linalg.solve(factor, np.stack([np.ones(len(at)), at], 1).astype(float))
        expected = expected - trends @ np.linalg.lstsq(trends, expected, rcond=None)[0]
    assert white(residual) == pytest.approx(expected, abs=1e-9)


def test_whitened_noise_is_white_with_variance_one():
    random = np.random.default_rng(3)
    used = [with_gaps(2000) for _ in range(5)]
    residuals = [1e-3 * autoregressive(random, 2000)[u] for u in used]
    covariance = autocovariance(residuals, used, STEP, 0)
    whites = [whitening(u, covariance, False)(r) for u, r in zip(used, residuals, strict=True)]
    joined = np.concatenate(whites)
    assert joined.var() == pytest.approx(1, abs=0.1)
    neighbours = np.mean([np.mean(w[1:] * w[:-1]) for w in whites])
    assert abs(neighbours) < 0.06


def test_hum_and_silence_have_a_positive_covariance():
    time = np.arange(800) * STEP
    used = [np.ones(800, bool)]
    for residual in (1e-3 * np.sin(2 * np.pi * 50 * time), np.zeros(800)):
        found = autocovariance([residual], used, STEP, 1)
        assert np.isfinite(whitening(used[0], found, True)(residual)).all()


def test_coloured_columns_have_the_dense_covariance():
    used = with_gaps(400)
    covariance = np.power(0.8, np.arange(100), dtype=float)
    scale = np.linspace(1, 2, used.sum())
    at = np.flatnonzero(used)
    dense = toeplitz(np.r_[covariance, np.zeros(300)])[np.ix_(at, at)] * np.outer(scale, scale)
    columns = np.random.default_rng(2).standard_normal((len(at), 3))
    found = whitening(used, covariance, False, scale).coloured(columns)
    assert found.T @ found == pytest.approx(columns.T @ dense @ columns, rel=1e-9)


def test_noise_at_rest_is_that_of_the_rest_without_what_is_flagged():
    """Second differences of white noise keep its RMS; a slow sine is not in the fast part."""
    random, rate = np.random.default_rng(4), 2e3
    time = np.arange(4000) / rate
    motion = Motion(*np.zeros((3, len(time))))
    motion.velocity[-200:] = 1.0
    force = 2e-3 * random.standard_normal(len(time)) + 3e-3 * np.sin(2 * np.pi * 5 * time)
    motion.acceleration[:] = 0.1 * random.standard_normal(len(time))
    clean = (time < 0.5) | (time > 0.6)
    force[~clean] = 1.0
    found = noise_at_rest(rate, time, force, motion, clean)
    assert found is not None
    assert found.fast_force == pytest.approx(2e-3, rel=0.06)
    assert found.slow_force == pytest.approx(3e-3 / np.sqrt(2), rel=0.06)
    fast = found.fast_of_load(0.01)
    assert np.hypot(found.slow_force, fast) == pytest.approx(np.sqrt(9.5e-6), rel=0.05)
    assert found.fast_of_load(0.01, 2.0) == pytest.approx(np.sqrt(16e-6 + 1e-6), rel=0.05)
    assert noise_at_rest(rate, time, force, motion, time < 5e-3) is None


def test_the_autocovariance_of_an_autoregression_is_found_through_gaps():
    """Of x[k] = a x[k-1] + e it is a^lag / (1 - a^2)."""
    random = np.random.default_rng(0)
    used = [with_gaps(4000) for _ in range(10)]
    residuals = [autoregressive(random, 4000)[u] for u in used]
    found = autocovariance(residuals, used, STEP, 0)
    lags = np.arange(6)
    assert found[:6] == pytest.approx(0.8**lags / (1 - 0.64), rel=0.08)


@pytest.mark.parametrize("loss", ["linear", "soft_l1"])
def test_the_solver_ends_at_the_minimum_of_an_independent_one_between_the_bounds(loss):
    """Of Rosenbrock's function, and of a parameter that ends at its bound."""

    def residuals(x):
        return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0], x[2] - 3, x[2] / 10])

    def jacobian(x):
        return np.array([[-20 * x[0], 10, 0], [-1, 0, 0], [0, 0, 1], [0, 0, 0.1]])

    bounds, start = (np.full(3, -2.0), np.array([0.8, 2.0, 2.0])), np.array([-1.2, 1.0, 1.0])
    problem = Mock(bounds=bounds, scales=np.ones(3), all=residuals, slopes=jacobian)
    cost, found = minimise(problem, start, loss != "linear")
    expected = least_squares(residuals, start, jacobian, bounds, loss=loss, xtol=1e-12)
    np.testing.assert_allclose(found, expected.x, atol=1e-3)
    assert found[2] == 2.0
    assert cost == pytest.approx(expected.cost, rel=1e-5)


def test_a_start_at_which_the_model_has_no_solution_is_left_alone():
    """Of stiff plectra, points between the bounds may lift the string too far."""
    none = Mock(side_effect=AssertionError("there are no slopes"))
    bounds, scales = (np.zeros(2), np.ones(2)), np.ones(2)
    problem = Mock(bounds=bounds, scales=scales, all=lambda x: np.full(1, np.inf), slopes=none)
    cost, values = minimise(problem, np.array([0.3, 0.4]), robust=False)
    assert cost == np.inf
    assert values.tolist() == [0.3, 0.4]
