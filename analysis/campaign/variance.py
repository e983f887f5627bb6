"""How much of a spread lies within groups, between them, and between groups of groups.

y = X b + group + subgroup + rest, with three independent normal deviations, for any numbers of
values in each. Estimated by restricted maximum likelihood (Patterson and Thompson 1971): for
balanced numbers and positive variances that is what the nested analysis of variance gives. The
covariance's inverse and determinant are closed forms of the sums over subgroups, so a hundred
thousand values cost no more than their subgroups.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.session.repeatability import COVERAGE, Spread
from sautereau.trajectory.motion import Floats

RATIO = 8.0
"""1, logarithm of the ratio of two standard deviations of which one counts as nothing."""
GRID = 21
"""Values of each logarithm among which the best is looked for at first: there may be two."""
CLOSER = 7
"""Values among which it is looked for again, each time between two neighbours of it."""
FINE = 1e-3
"""1, of a logarithm, to which it is found."""
SAME = 1e-4
"""1, difference of two deviances that are the same."""
TINY = 1e-9
"""1, spread over the values' size that is rounding."""


@dataclass(frozen=True)
class Nested:
    """Values in subgroups of groups; every group has subgroups of its own."""

    values: Floats
    """Shape (n,)."""
    columns: Floats
    """Of what the mean depends on; shape (n, k), a column of ones included."""
    groups: NDArray[np.intp]
    """Number of the group from 0; shape (n,)."""
    subgroups: NDArray[np.intp]
    """Number of the subgroup from 0, counted through all groups; shape (n,)."""

    @cached_property
    def _sums(self) -> "_Sums":
        joined = np.column_stack([self.columns, self.values])
        counts = np.bincount(self.subgroups)
        means = np.stack([np.bincount(self.subgroups, c) / counts for c in joined.T], 1)
        left = joined - means[self.subgroups]
        parents = np.empty(len(counts), np.intp)
        parents[self.subgroups] = self.groups
        order = np.argsort(parents, kind="stable")
        begins = np.flatnonzero(np.diff(parents[order], prepend=-1))
        middles = (
            np.add.reduceat(means[order], begins) / np.diff(begins, append=len(counts))[:, None]
        )
        about = means[order] - np.repeat(middles, np.diff(begins, append=len(counts)), axis=0)
        return _Sums(left.T @ left, counts[order], about, middles, begins)

    def products(self, rest: Floats, subgroup: Floats, group: Floats) -> tuple[Floats, Floats]:
        """Return A' V^-1 A with A = (X, y), and ln det V, for standard deviations that make V.

        With W = n / (rest^2 + n subgroup^2) of a subgroup, by Woodbury's identity twice.

        Args:
            rest: Shape (m,), as the others.
            subgroup: 0 for subgroups that do not differ.
            group: 0 for groups that do not differ.

        Returns:
            Arrays of shape (m, k + 1, k + 1) and (m,).
        """
        sums = self._sums
        n, about = sums.counts, sums.about
        rest2, between2, group2 = (np.square(x)[:, None] for x in (rest, subgroup, group))
        weights = n / (rest2 + n * between2)
        h = np.add.reduceat(weights, sums.begins, axis=1)
        shifts = np.add.reduceat(weights[:, :, None] * about, sums.begins, axis=1) / h[:, :, None]
        means = shifts + sums.middles
        squares = np.einsum("sk,sl->skl", about, about).reshape(len(n), -1)
        matrix = (weights @ squares).reshape(len(rest), *sums.within.shape)
        matrix += sums.within / rest2[:, :, None]
        matrix -= np.einsum("mg,mgk,mgl->mkl", h, shifts, shifts, optimize=True)
        shrunk = h / (1 + group2 * h)
        matrix += np.einsum("mg,mgk,mgl->mkl", shrunk, means, means, optimize=True)
        determinant = 2 * np.log(rest) * (n - 1).sum() + np.log(n / weights).sum(axis=1)
        return matrix, determinant + np.log1p(group2 * h).sum(axis=1)

    def left(self, matrix: Floats) -> tuple[Floats, Floats]:
        """Return the squares that the columns leave, and ln det of the columns' own part."""
        mean, known = matrix[:, :-1, :-1], matrix[:, :-1, -1:]
        told = np.linalg.solve(mean, known)
        left = matrix[:, -1, -1] - (known * told).sum(axis=(1, 2))
        return left, np.linalg.slogdet(mean)[1]

    def deviance(self, rest: Floats, subgroup: Floats, group: Floats) -> Floats:
        """Return -2 ln of the restricted likelihood but for a constant, as `products`."""
        matrix, determinant = self.products(rest, subgroup, group)
        left, inner = self.left(matrix)
        return np.asarray(determinant + inner + left, np.float64)


@dataclass(frozen=True)
class _Sums:
    """What of the values counts, subgroups in the order of their groups."""

    within: Floats
    """Products of columns and values about the means of their subgroups."""
    counts: NDArray[np.intp]
    """Values of each subgroup."""
    about: Floats
    """Means of the subgroups about the middle of their group, shape (subgroups, k + 1)."""
    middles: Floats
    """Of the groups, shape (groups, k + 1)."""
    begins: NDArray[np.intp]
    """First subgroup of each group."""


@dataclass(frozen=True)
class Components:
    """What `fit_nested` finds; standard deviations in the unit of the values."""

    data: Nested
    moving: NDArray[np.bool_]
    """Which of rest, subgroups and groups may differ."""
    logs: Floats
    """ln of their standard deviations; -inf for none."""

    @cached_property
    def covariance(self) -> Floats:
        """Of the columns' coefficients, shape (k, k)."""
        return np.asarray(np.linalg.inv(self._matrix[:-1, :-1]), np.float64)

    @cached_property
    def mean(self) -> Floats:
        """The columns' coefficients, shape (k,)."""
        return self.covariance @ self._matrix[:-1, -1]

    @cached_property
    def rest(self) -> Spread:
        """Within subgroups."""
        return self._spread(0)

    @cached_property
    def subgroup(self) -> Spread | None:
        """Between subgroups of a group; None where they may not differ."""
        return self._spread(1) if self.moving[1] else None

    @cached_property
    def group(self) -> Spread | None:
        """Between groups; None where they may not differ."""
        return self._spread(2) if self.moving[2] else None

    @property
    def _matrix(self) -> Floats:
        return self.data.products(*np.exp(self.logs)[:, None])[0][0]

    def _spread(self, part: int) -> Spread:
        """Return a standard deviation with the interval in which its likelihood is not too small.

        That is the profile's: the others are at their best for each value.
        """
        from scipy.optimize import brentq
        from scipy.stats import chi2

        limit = float(self.data.deviance(*np.exp(self.logs)[:, None])[0])
        limit += float(chi2.ppf(COVERAGE, 1))
        middle = float(self.logs[np.isfinite(self.logs)].max())
        others = np.flatnonzero(self.moving)
        others = others[others != part]

        def excess(log: float) -> float:
            """Return by how much the deviance is above the limit."""

            def deviance(values: Floats) -> Floats:
                logs = np.full((3, len(values)), -np.inf)
                logs[others], logs[part] = values.T, log
                return self.data.deviance(*np.exp(logs))

            return _least(deviance, np.full(len(others), middle))[1] - limit

        value = float(self.logs[part])
        inside = value if np.isfinite(value) else middle - RATIO
        top = inside
        while excess(top + 1.0) < 0:
            top += 1.0
            if top > middle + RATIO:
                raise AnalysisError(
                    "components: the values are too few to bound how far they spread; press more"
                    " often"
                )
        high: Any = brentq(excess, top, top + 1.0, xtol=FINE) if excess(top) < 0 else top
        low: Any = -np.inf
        if inside > middle - RATIO and excess(middle - RATIO) > 0:
            low = brentq(excess, middle - RATIO, inside, xtol=FINE)
        return Spread(*np.exp([value, low, high]).tolist())


def fit_nested(data: Nested, *, subgroups: bool, groups: bool) -> Components:
    """Estimate the three standard deviations, and what the mean depends on.

    The intervals are those of 95 % by the profile of the restricted likelihood.

    Args:
        data: Values and where they belong.
        subgroups: Whether subgroups may differ; else they are taken not to.
        groups: Whether groups may differ.

    Raises:
        AnalysisError: There are no more values than columns, or they have no spread.
    """
    free = len(data.values) - data.columns.shape[1]
    if free < 1:
        raise AnalysisError(
            f"components: {len(data.values)} values for {data.columns.shape[1]} coefficients leave"
            " no spread to tell; press more often"
        )
    moving = np.flatnonzero([subgroups, groups])

    def profiled(values: Floats) -> tuple[Floats, Floats]:
        """Return the deviance and ln of the rest's best deviation, at the others' over it."""
        ratios = np.full((2, len(values)), -np.inf)
        ratios[moving] = values.T
        matrix, determinant = data.products(np.ones(len(values)), *np.exp(ratios))
        left, inner = data.left(matrix)
        least = TINY * np.sqrt(np.abs(matrix[:, -1, -1]) / free)
        rest = np.sqrt(np.maximum(left, 0) / free)
        if not (rest > least).all():
            raise AnalysisError(
                "components: the values have no spread beyond what they depend on; give presses"
                " that were really made, each once"
            )
        return determinant + inner + 2 * free * np.log(rest), np.log(rest)

    best, least = _least(lambda v: profiled(v)[0], np.zeros(len(moving)))
    for i in range(len(moving)):
        without = best.copy()
        without[i] = -np.inf
        if profiled(without[None])[0][0] <= least + SAME:
            best = without
    logs = np.full(3, -np.inf)
    logs[0] = profiled(best[None])[1][0]
    logs[1 + moving] = logs[0] + best
    return Components(data, np.array([True, subgroups, groups]), logs)


def _least(function: Callable[[Floats], Floats], middle: Floats) -> tuple[Floats, float]:
    """Return where a function of arrays (points, arguments) is least, within `RATIO`, and what.

    The best on a grid is looked for again on a closer one, so that of two valleys the deeper
    one is found, and one without end does no harm.
    """
    if not len(middle):
        return middle, float(function(middle[None])[0])
    reach, points = RATIO, GRID
    while True:
        steps = [np.linspace(m - reach, m + reach, points) for m in middle]
        places = np.stack(np.meshgrid(*steps, indexing="ij"), -1).reshape(-1, len(middle))
        found = function(places)
        best = int(np.argmin(found))
        middle = places[best]
        reach, points = 2 * reach / (points - 1), CLOSER
        if reach < FINE:
            return middle, float(found[best])
