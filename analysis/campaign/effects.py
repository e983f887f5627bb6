"""Effects of the factors of an experiment on one quantity, by a mixed model.

    y = X b + block + press

X has the levels of the factors (treatment coding) and, on request, products of two factors. The
deviations of blocks and presses are independent and normal. The model is estimated by restricted
maximum likelihood, and by least squares where a deviation of the blocks is not identifiable or
estimated as zero. A mean of a level is that over all levels of the others with
equal weights. Intervals are Student's; their degrees of freedom are those of the blocks for a
comparison between blocks, and those of the presses for one within blocks (containment). An error of
its fit, of known standard uncertainty, may be common to all presses of a level, and differ from
level to level: its variance is added, and the degrees of freedom are those of Welch and
Satterthwaite (JCGM 100, G.4).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.campaign.variance import Components, Nested, fit_nested, shared_by
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.session.repeatability import Spread, interval_of
from sautereau.trajectory.motion import Floats

ROUNDING = 1e-9  # Spread over magnitude that is attributed to rounding; relative tolerance of ranks


@dataclass(frozen=True)
class Effect(Spread):
    """A difference of means from that of the first level, in the quantity's unit."""

    factor: str
    """Name of the factor; of an interaction both, with ` x ` between them."""
    level: str
    """Level, or both levels of an interaction, with ` x ` between them."""
    std: float
    """Standard uncertainty."""
    level_std: float
    """The part of it by errors that presses of a level may share."""
    degrees: float
    """Degrees of freedom of the interval."""


@dataclass(frozen=True)
class LevelMean(Spread):
    """The mean at one level, over all levels of the other factors."""

    level: str
    presses: int


@dataclass(frozen=True)
class FactorEffects:
    """One factor, or the interaction of two."""

    of: tuple[str, ...]
    """Name of the factor, or of both."""
    means: tuple[LevelMean, ...]
    """One for each level; empty for an interaction."""
    effects: tuple[Effect, ...]
    """One for each level except the first. Those of an interaction are differences of the
    differences from the first levels."""
    p_value: float
    """Probability of a Wald F statistic at least as large if the factor has no effect."""

    @property
    def name(self) -> str:
        """Name of the factor; of an interaction both, with ` x ` between them."""
        return " x ".join(self.of)


@dataclass(frozen=True)
class FittedEffects:
    """The effects on one quantity, in its unit."""

    presses: int
    omitted: int
    """Presses without the quantity."""
    model: str
    """`mixed model` or `least squares`."""
    reason: str
    """Why it is not the mixed model; empty if it is."""
    press_std: float
    """Standard deviation of the presses within a block."""
    block_std: float | None
    """Standard deviation of the blocks; None if it is not identifiable."""
    factors: tuple[FactorEffects, ...]
    """In the order of the design, then the interactions."""
    residuals: Floats
    """Difference of each press from the mean of its combination; NaN for an omitted one."""


def fit_effects(
    values: Floats,
    factors: Mapping[str, Sequence[str]],
    blocks: NDArray[np.intp],
    *,
    stds: Floats | None = None,
    interaction: bool = False,
    order: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> FittedEffects:
    """Estimate the effects of factors on a quantity.

    Args:
        values: One for each press, in the quantity's unit, shape (n,); NaN for none.
        factors: Level of each press by factor, n each.
        blocks: Number of the block of each press, shape (n,).
        stds: Standard uncertainty of each press by an error that all presses of a level may share,
            shape (n,); 0 by default.
        interaction: Whether to estimate the interactions of every two factors.
        order: Levels in their order by factor; those of other factors are in that of `in_order`.

    Raises:
        AnalysisError: There are too few presses, or the effects cannot be separated.
    """
    known = np.flatnonzero(np.isfinite(values))
    own = {f: [levels[i] for i in known.tolist()] for f, levels in factors.items()}
    if all(len(set(levels)) < 2 for levels in own.values()):
        raise AnalysisError(
            f"effects: {len(known)} of {len(values)} presses have this value, and no factor has two"
            " levels in these; press a design of several, and see `sautereau phases`"
        )
    columns = _Columns.of(own, order, interaction)
    numbers = np.unique(blocks[known], return_inverse=True)[1]
    fit = _Fit.of(
        values[known], columns, numbers, np.zeros(len(known)) if stds is None else stds[known]
    )
    found = [fit.effects_of(*own) for own in (*((f,) for f in columns.levels), *columns.pairs)]
    residuals = np.full(len(values), np.nan)
    residuals[known] = values[known] - columns.matrix @ fit.coefficients
    return FittedEffects(
        len(known),
        len(values) - len(known),
        "least squares" if fit.reason else "mixed model",
        fit.reason,
        fit.press_std,
        fit.block_std,
        tuple(found),
        residuals,
    )


@dataclass(frozen=True)
class _Columns:
    """The design matrix: its columns are 1, levels of factors, and products of these."""

    factors: Mapping[str, Sequence[str]]
    levels: Mapping[str, tuple[str, ...]]
    pairs: tuple[tuple[str, str], ...]  # Factors with an interaction

    @classmethod
    def of(
        cls,
        factors: Mapping[str, Sequence[str]],
        order: Mapping[str, Sequence[str]],
        interaction: bool,
    ) -> "_Columns":
        levels = {
            factor: tuple(level for level in order.get(factor, in_order(own)) if level in own)
            for factor, own in factors.items()
        }
        several = {factor: own for factor, own in levels.items() if len(own) > 1}
        pairs = tuple(combinations(several, 2)) if interaction else ()
        return cls({factor: factors[factor] for factor in several}, several, pairs)

    def rows(self, cells: Mapping[str, Sequence[str]]) -> Floats:
        """Return the rows of the design matrix for levels by factor."""
        coded = {
            factor: np.equal.outer(np.asarray(cells[factor]), np.asarray(own[1:])).astype(float)
            for factor, own in self.levels.items()
        }
        parts = [np.ones((len(next(iter(coded.values()))), 1)), *coded.values()]
        for a, b in self.pairs:
            parts.append(np.einsum("ni,nj->nij", coded[a], coded[b]).reshape(len(parts[0]), -1))
        return np.hstack(parts)

    @cached_property
    def matrix(self) -> Floats:
        """Row of each press."""
        return self.rows(self.factors)

    def mean(self, at: Mapping[str, str]) -> Floats:
        """Return the combination of coefficients that is the mean at some levels."""
        every = product(*([at[f]] if f in at else own for f, own in self.levels.items()))
        return self.rows(dict(zip(self.levels, zip(*every, strict=True), strict=True))).mean(0)


def in_order(levels: Sequence[str]) -> tuple[str, ...]:
    """Return different levels in the order of their numbers, or of their names."""

    def number(level: str) -> float:
        return float(level.partition(" ")[0])

    different = sorted(set(levels))
    try:
        return tuple(sorted(different, key=number))
    except ValueError:
        return tuple(different)


@dataclass(frozen=True)
class _Fit:
    """Coefficients with their covariance, in the quantity's unit."""

    columns: _Columns
    coefficients: Floats
    covariance: Floats
    components: Components
    stds: Floats  # Of each press, by an error that those of a level may share
    between: NDArray[np.bool_]  # Which columns are constant within all blocks
    degrees: tuple[int, int]  # Degrees of freedom of the presses and of the blocks
    press_std: float
    block_std: float | None
    reason: str

    @classmethod
    def of(
        cls, values: Floats, columns: _Columns, blocks: NDArray[np.intp], stds: Floats
    ) -> "_Fit":
        x, n = columns.matrix, len(values)
        if n and np.linalg.matrix_rank(x, ROUNDING * n) < x.shape[1]:
            raise AnalysisError(
                "effects: the levels of the factors always change together, or combinations of them"
                " are missing, so that their effects cannot be separated; press a design of all"
                " combinations" + (", or omit the interaction" if columns.pairs else "")
            )
        counts = np.bincount(blocks)
        means = np.stack([np.bincount(blocks, c) / counts for c in x.T], 1)
        between = np.abs(x - means[blocks]).max(axis=0) < ROUNDING
        of_blocks = len(counts) - int(np.linalg.matrix_rank(means[:, between]))
        of_presses = n - len(counts) - int((~between).sum())
        free = n - x.shape[1]
        if free < 1:
            raise AnalysisError(
                f"effects: {n} presses for {x.shape[1]} coefficients leave no degree of freedom for"
                " a spread; make more presses"
            )
        scale = float(values.std())
        if scale <= ROUNDING * float(np.abs(values).max()):
            raise AnalysisError(
                "effects: the values have no spread; give presses that were really made, each once"
            )
        y, reason, degrees = (values - values.mean()) / scale, "", (of_presses, of_blocks)
        if len(counts) == 1:
            reason = "all presses are of one block"
        elif of_blocks < 1:
            owners = [f for f, own in columns.levels.items() for _ in own[1:]]
            names = dict.fromkeys(f for f, one in zip(owners, between[1:], strict=False) if one)
            reason = (
                "each level is in one block only, so that the effect of setting it up again is part"
                f" of the effect of {', '.join(names)}; make a second block of each (set_ups = 2)"
            )
        elif of_presses < 1:
            reason = "no block has several presses of one combination"
        known = not reason
        found = fit_nested(Nested(y, x, blocks, blocks), subgroups=False, groups=known)
        press, block = np.exp(found.logs[[0, 2]]).tolist()
        # So small a deviation of the blocks, over that of the presses, counts as 0.
        if known and block <= 1e-3 * press:
            reason = "the blocks differ by no more than the presses within them"
            found = fit_nested(Nested(y, x, blocks, blocks), subgroups=False, groups=False)
            press, block = float(np.exp(found.logs[0])), 0.0
        if reason:
            degrees = free, of_blocks if known else free
        coefficients = found.coefficients * scale
        coefficients[0] += values.mean()
        return cls(
            columns, coefficients, found.covariance * scale**2, found, stds, between, degrees,
            press * scale, block * scale if known else None, reason,
        )  # fmt: skip

    def errors(self, rows: Floats, *factors: str) -> Floats:
        """Return the errors of combinations by those that presses of equal levels may share.

        Args:
            rows: Combinations of coefficients, shape (combinations, coefficients).

        Returns:
            Standard uncertainties, with signs, shape (combinations, levels).
        """
        levels = list(zip(*(self.columns.factors[f] for f in factors), strict=True))
        return rows @ shared_by(self.components, self.stds, levels).T

    def spread(
        self, row: Floats, errors: Floats
    ) -> tuple[tuple[float, float, float], float, float]:
        """Return value and interval of a combination of coefficients, its std and degrees."""
        variance = float(row @ self.covariance @ row)
        degrees = self.degrees[bool((row[self.between] != 0).any())]
        return interval_of(float(row @ self.coefficients), variance, errors, degrees)

    def effects_of(self, *factors: str) -> FactorEffects:
        """Return the differences from the first level of a factor, or of two their differences."""
        from scipy.stats import f

        columns, found, cells = self.columns, [], []
        levels = [columns.levels[factor] for factor in factors]
        for cell in product(*(own[1:] for own in levels)):
            row = np.zeros(len(self.coefficients))
            for taken in product((True, False), repeat=len(factors)):
                chosen = zip(factors, taken, cell, levels, strict=True)
                at = {name: level if own else every[0] for name, own, level, every in chosen}
                row += (-1) ** taken.count(False) * columns.mean(at)
            row[np.abs(row) < ROUNDING] = 0.0
            cells.append(" x ".join(cell))
            found.append(row)
        rows, name = np.array(found), " x ".join(factors)
        errors, effects = self.errors(rows, *factors), []
        for cell, row, own in zip(cells, rows, errors, strict=True):
            ends, std, degrees = self.spread(row, own)
            effects.append(Effect(*ends, name, cell, std, float(np.linalg.norm(own)), degrees))
        b, covariance = rows @ self.coefficients, rows @ self.covariance @ rows.T
        wald = b @ np.linalg.solve(covariance + errors @ errors.T, b) / len(rows)
        p_value = float(f.sf(wald, len(rows), min(effect.degrees for effect in effects)))
        means = []
        for level in levels[0] if len(factors) == 1 else ():
            row = columns.mean({name: level})
            (ends, *_), count = self.spread(row, self.errors(row, name)), columns.factors[name]
            means.append(LevelMean(*ends, level, list(count).count(level)))
        return FactorEffects(factors, tuple(means), tuple(effects), p_value)
