"""Variance components: against the analysis of variance, brute force and known truths."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from sautereau.analysis.campaign.variance import Components, Nested, fit_nested
from sautereau.analysis.errors import AnalysisError
from tests.budget import slow


def nested(random, groups=8, subgroups=3, values=10, stds=(0.01, 0.03, 0.2), columns=None):
    """Return balanced values with these residual, subgroup and group deviations."""
    group = np.repeat(np.arange(groups), subgroups * values)
    subgroup = np.repeat(np.arange(groups * subgroups), values)
    rest, between, among = stds
    y = 1 + random.normal(0, among, groups)[group]
    y += random.normal(0, between, groups * subgroups)[subgroup]
    y += random.normal(0, rest, len(group))
    return Nested(y, np.ones((len(y), 1)) if columns is None else columns, group, subgroup)


def test_balanced_values_give_the_analysis_of_variance():
    data = nested(np.random.default_rng(0))
    y = data.values.reshape(8, 3, 10)
    rest = y.var(axis=2, ddof=1).mean()
    subgroup = 10 * y.mean(2).var(axis=1, ddof=1).mean()
    group = 30 * y.mean((1, 2)).var(ddof=1)
    found = fit_nested(data, subgroups=True, groups=True)
    assert found.residual.value**2 == pytest.approx(rest, rel=5e-3)
    assert found.subgroup is not None
    assert found.group is not None
    assert found.subgroup.value**2 == pytest.approx((subgroup - rest) / 10, rel=5e-3)
    assert found.group.value**2 == pytest.approx((group - subgroup) / 30, rel=5e-3)
    assert found.coefficients[0] == pytest.approx(y.mean(), rel=1e-9)
    assert found.covariance[0, 0] == pytest.approx(group / 240, rel=5e-3)


def test_the_likelihood_is_that_of_the_complete_covariance():
    random = np.random.default_rng(1)
    group = np.sort(random.integers(0, 4, 30))
    subgroup = np.unique(3 * group + random.integers(0, 3, 30), return_inverse=True)[1]
    columns = np.column_stack([np.ones(30), random.normal(size=30)])
    y = random.normal(size=30)
    data = Nested(y, columns, group, subgroup)

    def brute(rest, between, among):
        v = rest**2 * np.eye(30) + between**2 * (subgroup[:, None] == subgroup)
        v = v + among**2 * (group[:, None] == group)
        inner = columns.T @ np.linalg.solve(v, columns)
        mean = np.linalg.solve(inner, columns.T @ np.linalg.solve(v, y))
        log = multivariate_normal.logpdf(y, columns @ mean, v)
        influence = np.linalg.solve(inner, np.linalg.solve(v, columns).T)
        deviance = -2 * log - 30 * np.log(2 * np.pi) + np.linalg.slogdet(inner)[1]
        return deviance, mean, influence

    for stds in ((1.0, 0.5, 2.0), (0.3, 0.0, 1.0), (0.7, 1.3, 0.0), (0.01, 1e-4, 30.0)):
        expected, mean, influence = brute(*stds)
        assert data.deviance(*np.array(stds)[:, None])[0] == pytest.approx(expected, rel=1e-9)
        matrix = data.products(*np.array(stds)[:, None])[0][0]
        np.testing.assert_allclose(np.linalg.solve(matrix[:2, :2], matrix[:2, 2]), mean, rtol=1e-7)
        with np.errstate(divide="ignore"):
            components = Components(data, np.ones(3, bool), np.log(stds))
        atol = 1e-7 * np.abs(influence).max()
        np.testing.assert_allclose(components.influence, influence, rtol=0, atol=atol)


@pytest.mark.parametrize("shape", [(1, 1, 2), (2, 1, 2), (1, 3, 2), (2, 2, 2), (3, 2, 1)])
def test_few_values_give_wide_finite_intervals(shape):
    groups, subgroups, values = shape
    data = nested(np.random.default_rng(3), *shape)
    found = fit_nested(data, subgroups=subgroups > 1 and values > 1, groups=groups > 1)
    assert 0 < found.residual.low < found.residual.value < found.residual.high < np.inf
    assert (found.group is None) == (groups == 1)


def test_values_without_a_spread_are_refused():
    random = np.random.default_rng(5)
    with pytest.raises(AnalysisError, match="no spread beyond"):
        fit_nested(nested(random, stds=(0, 0, 0)), subgroups=True, groups=True)
    with pytest.raises(AnalysisError, match="no degree of freedom"):
        fit_nested(nested(random, 1, 1, 1), subgroups=False, groups=False)


def coverage(cases, shape, stds):
    """Return the fraction of cases whose intervals hold the truth, for each component."""
    held = np.zeros(3)
    for seed in range(cases):
        found = fit_nested(
            nested(np.random.default_rng(seed), *shape, stds), subgroups=True, groups=True
        )
        spreads = (found.residual, found.subgroup, found.group)
        held += [s.low <= true <= s.high for s, true in zip(spreads, stds, strict=True) if s]
    return held / cases


@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    ("cases", "shape", "least"), [(5, (6, 2, 5), 0.7), slow(150, (6, 2, 4), 0.9)]
)
def test_intervals_of_95_percent_hold_the_truth_so_often(cases, shape, least):
    held = coverage(cases, shape, (0.01, 0.03, 0.2))
    assert (held >= least).all(), held


def test_a_component_of_0_is_within_its_interval():
    random = np.random.default_rng(2)
    for stds in ((0.01, 0.0, 0.0), (0.01, 0.03, 0.0), (0.01, 0.0, 0.2)):
        found = fit_nested(nested(random, stds=stds), subgroups=True, groups=True)
        for spread, true in zip((found.residual, found.subgroup, found.group), stds, strict=True):
            assert spread is not None
            assert spread.low <= true < spread.high
            assert np.isfinite([spread.value, spread.low, spread.high]).all()


def test_the_unit_does_not_matter():
    data = nested(np.random.default_rng(4))
    plain = fit_nested(data, subgroups=True, groups=True)
    for scale in (1e-9, 1e9):
        scaled = Nested(data.values * scale, data.columns, data.groups, data.subgroups)
        found = fit_nested(scaled, subgroups=True, groups=True)
        for part in ("residual", "subgroup", "group"):
            ours, theirs = getattr(found, part), getattr(plain, part)
            assert ours.low / scale == pytest.approx(theirs.low, rel=1e-2)
            assert ours.high / scale == pytest.approx(theirs.high, rel=1e-2)
