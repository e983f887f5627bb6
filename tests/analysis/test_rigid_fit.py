"""The linear fits of a rigid key: noise of its rows, orthonormal columns, contacts of a grid."""

from dataclasses import replace

import numpy as np
import pytest

from sautereau.analysis.phases.expected import expected
from sautereau.analysis.phases.fit import KeyAndString
from sautereau.analysis.phases.levenberg import orthonormal
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.signals import NO_ROWS, rows_of, signals_of


@pytest.mark.parametrize("n", [1, 2, 7])
def test_the_noise_of_rows_is_that_of_their_weights(make_press, n):
    """A row weights the force by a triangle over two blocks, and subtracts two block means of v."""
    signals = replace(signals_of(make_press()), force_noise=0.02, velocity_noise=1e-4)
    rows = rows_of(signals, 1000, 3000, n)
    late = (np.arange(n) + 0.5) / n
    force = np.array([*late, *late[::-1]]) / n
    velocity = np.repeat([-1.0, 1.0], n) / n * signals.inertial * signals.rate / n
    for away, found in ((0, rows.variance), (n, rows.covariance)):
        of_force, of_velocity = (
            std**2 * (weights[away:] @ weights[: 2 * n - away])
            for std, weights in ((0.02, force), (1e-4, velocity))
        )
        np.testing.assert_allclose(found, of_force + of_velocity, rtol=1e-12)


def test_a_base_is_orthonormal_and_spans_its_columns():
    columns = np.random.default_rng(0).standard_normal((3, 20, 4)) * [1.0, 1e3, 1.0, 1e-3]
    base, inverse = orthonormal(columns)
    np.testing.assert_allclose(base.swapaxes(1, 2) @ base, [np.eye(4)] * 3, atol=1e-9)
    np.testing.assert_allclose(columns @ inverse, base)


def test_the_fit_of_a_contact_is_the_same_in_every_grid(make_press, paper):
    signals = signals_of(make_press())
    held = rows_of(signals, 1500, 3500)
    release = Release(float(held.time[-1]), 1e-5, 0.7, 0.01, 0.0, 100.0, 1.0)
    fit = KeyAndString(expected(paper), NO_ROWS, held, release, (0.0, 0.0))
    times = held.time[[20, 60, 90]] + 1e-5
    together, alone = fit.at(times, 1.0), [fit.at(times[i : i + 1], 1.0) for i in range(3)]
    np.testing.assert_allclose(together.chi2, [float(each.chi2[0]) for each in alone], rtol=1e-9)
    np.testing.assert_allclose(
        together.at_release, [float(each.at_release[0]) for each in alone], rtol=1e-6
    )
