"""Variance components: how much of a spread lies within groups, and how much between them.

The model is y = X b + group + subgroup + residual. The three deviations are independent and normal;
groups and subgroups may have any numbers of values. The estimate is by restricted maximum
likelihood (REML; Patterson and Thompson 1971). For balanced numbers and positive variances it
equals the nested analysis of variance. Inverse and determinant of the covariance are closed forms
of sums over subgroups, so that the computing time depends on the number of subgroups and not on
that of values. docs/decisions/0007 compares `statsmodels`.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import chi2

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.session.repeatability import COVERAGE, Spread
from sautereau.trajectory.motion import Floats

LOG_RANGE = 8.0  # Logarithm of a ratio of standard deviations from which the smaller counts as 0
LOG_TOLERANCE = 1e-3  # Tolerance of a logarithm


@dataclass(frozen=True)
class Nested:
    """Values in subgroups, which are parts of groups."""

    values: Floats
    """Shape (n,)."""
    columns: Floats
    """Regressors of the mean, shape (n, k), including a column of ones."""
    groups: NDArray[np.intp]
    """Number of the group from 0; shape (n,)."""
    subgroups: NDArray[np.intp]
    """Number of the subgroup from 0, unique over all groups; shape (n,)."""

    @cached_property
    def _sums(self) -> "_Sums":
        joined = np.column_stack([self.columns, self.values])
        counts = np.bincount(self.subgroups)
        means = np.stack([np.bincount(self.subgroups, c) / counts for c in joined.T], 1)
        within = joined - means[self.subgroups]
        parents = np.empty(len(counts), np.intp)
        parents[self.subgroups] = self.groups
        order = np.argsort(parents, kind="stable")
        starts = np.flatnonzero(np.diff(parents[order], prepend=-1))
        sizes = np.diff(starts, append=len(counts))
        centres = np.add.reduceat(means[order], starts) / sizes[:, None]
        deviations = means[order] - np.repeat(centres, sizes, axis=0)
        return _Sums(within.T @ within, counts[order], deviations, centres, starts)

    def products(self, residual: Floats, subgroup: Floats, group: Floats) -> tuple[Floats, Floats]:
        """Return A' V^-1 A with A = (X, y), and ln det V, for standard deviations that make V.

        With W = n / (residual^2 + n subgroup^2) of a subgroup, by Woodbury's identity twice.

        Args:
            residual: Shape (m,), as the others.
            subgroup: 0 for subgroups without a deviation.
            group: 0 for groups without a deviation.

        Returns:
            Arrays of shape (m, k + 1, k + 1) and (m,).
        """
        sums = self._sums
        n, x = sums.counts, sums.deviations
        residual2, subgroup2, group2 = (np.square(s)[:, None] for s in (residual, subgroup, group))
        weights = n / (residual2 + n * subgroup2)
        h = np.add.reduceat(weights, sums.starts, axis=1)
        shifts = np.add.reduceat(weights[:, :, None] * x, sums.starts, axis=1) / h[:, :, None]
        means = shifts + sums.centres
        squares = (x[:, :, None] * x[:, None, :]).reshape(len(n), -1)
        matrix = (weights @ squares).reshape(len(residual), *sums.within.shape)
        matrix += sums.within / residual2[:, :, None]
        # Minus and plus the sums over the groups of w r r'.
        matrix -= np.swapaxes(h[:, :, None] * shifts, 1, 2) @ shifts
        matrix += np.swapaxes((h / (1 + group2 * h))[:, :, None] * means, 1, 2) @ means
        determinant = 2 * np.log(residual) * (n - 1).sum() + np.log(n / weights).sum(axis=1)
        return matrix, determinant + np.log1p(group2 * h).sum(axis=1)

    def unexplained(self, matrix: Floats) -> tuple[Floats, Floats]:
        """Return the weighted sum of squares not explained by X, and ln det of X' V^-1 X."""
        mean, known = matrix[:, :-1, :-1], matrix[:, :-1, -1:]
        explained = (known * np.linalg.solve(mean, known)).sum(axis=(1, 2))
        return matrix[:, -1, -1] - explained, np.linalg.slogdet(mean)[1]

    def deviance(self, residual: Floats, subgroup: Floats, group: Floats) -> Floats:
        """Return -2 ln of the restricted likelihood up to a constant; arguments as `products`."""
        matrix, determinant = self.products(residual, subgroup, group)
        squares, inner = self.unexplained(matrix)
        return np.asarray(determinant + inner + squares, np.float64)


@dataclass(frozen=True)
class _Sums:
    """Sufficient statistics of the values, subgroups in the order of their groups."""

    within: Floats
    """Sums of products of X and y, each minus the mean of its subgroup, shape (k + 1, k + 1)."""
    counts: NDArray[np.intp]  # Number of values of each subgroup
    deviations: Floats
    """Means of the subgroups minus the centre of their group, shape (subgroups, k + 1)."""
    centres: Floats  # Mean of the subgroups of each group, shape (groups, k + 1)
    starts: NDArray[np.intp]  # Number of the first subgroup of each group


@dataclass(frozen=True)
class Components:
    """Result of `fit_nested`; standard deviations in the unit of the values."""

    data: Nested
    free: NDArray[np.bool_]
    """Which of residual, subgroup and group deviations were estimated."""
    logs: Floats
    """ln of the three standard deviations; -inf for 0."""

    @cached_property
    def covariance(self) -> Floats:
        """Covariance of the regression coefficients, shape (k, k)."""
        return np.asarray(np.linalg.inv(self._matrix[:-1, :-1]), np.float64)

    @cached_property
    def coefficients(self) -> Floats:
        """Regression coefficients, shape (k,)."""
        return self.covariance @ self._matrix[:-1, -1]

    @cached_property
    def influence(self) -> Floats:
        """Derivatives of the coefficients by the values, (X' V^-1 X)^-1 X' V^-1, shape (k, n).

        V^-1 X is the closed form of `Nested.products`.
        """
        data, (residual2, subgroup2, group2) = self.data, np.exp(2 * self.logs)
        of, n = data.subgroups, np.bincount(data.subgroups).astype(float)
        parents = np.empty(len(n), np.intp)
        parents[of] = data.groups
        weights = n / (residual2 + n * subgroup2)
        means = np.stack([np.bincount(of, column) / n for column in data.columns.T])
        sums = np.stack([np.bincount(parents, weights * own) for own in means])
        shifts = sums * group2 / (1 + group2 * np.bincount(parents, weights))
        between = weights / n * (means - shifts[:, parents])
        within = (data.columns.T - means[:, of]) / residual2
        return np.asarray(self.covariance @ (within + between[:, of]), np.float64)

    @cached_property
    def residual(self) -> Spread:
        """Standard deviation within subgroups."""
        return self._spread(0)

    @cached_property
    def subgroup(self) -> Spread | None:
        """Standard deviation of subgroups within their group; None if it was not estimated."""
        return self._spread(1) if self.free[1] else None

    @cached_property
    def group(self) -> Spread | None:
        """Standard deviation of groups; None if it was not estimated."""
        return self._spread(2) if self.free[2] else None

    @cached_property
    def _matrix(self) -> Floats:
        return self.data.products(*np.exp(self.logs)[:, None])[0][0]

    def _spread(self, part: int) -> Spread:
        """Return a standard deviation with its interval by the profile likelihood.

        The interval holds the values at which the deviance, minimised over the other standard
        deviations, exceeds its minimum by at most the chi-squared quantile.
        """
        limit = float(self.data.deviance(*np.exp(self.logs)[:, None])[0])
        limit += float(chi2.ppf(COVERAGE, 1))
        middle = float(self.logs[np.isfinite(self.logs)].max())
        others = np.flatnonzero(self.free)
        others = others[others != part]

        def excess(log: float) -> float:
            """Return by how much the profile deviance exceeds the limit."""

            def deviance(values: Floats) -> Floats:
                logs = np.full((3, len(values)), -np.inf)
                logs[others], logs[part] = values.T, log
                return self.data.deviance(*np.exp(logs))

            return _minimum(deviance, np.full(len(others), middle))[1] - limit

        value = float(self.logs[part])
        inside = value if np.isfinite(value) else middle - LOG_RANGE
        top = inside
        while excess(top + 1.0) < 0:
            top += 1.0
            if top > middle + LOG_RANGE:
                raise AnalysisError(
                    "components: too few values for an upper limit of their standard deviation;"
                    " make more presses"
                )
        high: Any = brentq(excess, top, top + 1.0, xtol=LOG_TOLERANCE) if excess(top) < 0 else top
        low: Any = -np.inf
        if inside > middle - LOG_RANGE and excess(middle - LOG_RANGE) > 0:
            low = brentq(excess, middle - LOG_RANGE, inside, xtol=LOG_TOLERANCE)
        return Spread(*np.exp([value, low, high]).tolist())


def fit_nested(data: Nested, *, subgroups: bool, groups: bool) -> Components:
    """Estimate the three standard deviations and the regression coefficients.

    Args:
        subgroups: Whether to estimate a deviation of subgroups; else it is 0.
        groups: Whether to estimate a deviation of groups; else it is 0.

    Raises:
        AnalysisError: There are no more values than columns, or they have no spread.
    """
    degrees = len(data.values) - data.columns.shape[1]
    if degrees < 1:
        raise AnalysisError(
            f"components: {len(data.values)} values for {data.columns.shape[1]} coefficients leave"
            " no degree of freedom for a spread; make more presses"
        )
    free = np.flatnonzero([subgroups, groups])

    def profiled(values: Floats) -> tuple[Floats, Floats]:
        """Return the deviance and ln of the best residual deviation, from ln of ratios to it."""
        ratios = np.full((2, len(values)), -np.inf)
        ratios[free] = values.T
        matrix, determinant = data.products(np.ones(len(values)), *np.exp(ratios))
        squares, inner = data.unexplained(matrix)
        # So small a spread over the magnitude of the values is attributed to rounding.
        rounding = 1e-9 * np.sqrt(np.abs(matrix[:, -1, -1]) / degrees)
        residual = np.sqrt(np.maximum(squares, 0) / degrees)
        if not (residual > rounding).all():
            raise AnalysisError(
                "components: the values have no spread beyond what their regressors explain; give"
                " presses that were really made, each once"
            )
        return determinant + inner + 2 * degrees * np.log(residual), np.log(residual)

    best, least = _minimum(lambda v: profiled(v)[0], np.zeros(len(free)))
    for i in range(len(free)):
        without = best.copy()
        without[i] = -np.inf
        if profiled(without[None])[0][0] <= least + 1e-4:  # The two deviances count as equal
            best = without
    logs = np.full(3, -np.inf)
    logs[0] = profiled(best[None])[1][0]
    logs[1 + free] = logs[0] + best
    return Components(data, np.array([True, subgroups, groups]), logs)


def shared_by(found: Components, stds: Floats, levels: Sequence[Hashable]) -> Floats:
    """Return the standard uncertainties of the coefficients by an error that presses share.

    Args:
        stds: Standard uncertainty of each value by it, in the values' unit, shape (n,).
        levels: Values of equal levels have the same error, n of them.

    Returns:
        That of each level, signed as it changes the coefficients, shape (levels, k).
    """
    own = numbered(levels)
    each = [np.bincount(own, stds * row) for row in found.influence]
    return np.asarray(np.stack(each, 1), np.float64)


def numbered(levels: Sequence[Hashable]) -> NDArray[np.intp]:
    """Return the number of each level, from 0 in the order in which they first occur."""
    numbers = {level: number for number, level in enumerate(dict.fromkeys(levels))}
    return np.array([numbers[level] for level in levels], np.intp)


def _minimum(function: Callable[[Floats], Floats], middle: Floats) -> tuple[Floats, float]:
    """Return where a function of points, shape (points, arguments), is least, and its value there.

    It is searched within `LOG_RANGE` of the middle, on grids that become finer around the best
    point: of two minima the deeper one is found, and a function without a minimum ends at the edge.
    """
    if not len(middle):
        return middle, float(function(middle[None])[0])
    reach, points = LOG_RANGE, 21  # Values of each logarithm; they find the deeper of two minima
    while True:
        steps = [np.linspace(m - reach, m + reach, points) for m in middle]
        places = np.stack(np.meshgrid(*steps, indexing="ij"), -1).reshape(-1, len(middle))
        found = function(places)
        best = int(np.argmin(found))
        middle = places[best]
        reach, points = 2 * reach / (points - 1), 7  # Between the neighbours of the best so far
        if reach < LOG_TOLERANCE:
            return middle, float(found[best])
