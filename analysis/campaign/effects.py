"""Effects of the factors of an experiment on one quantity, by a mixed model.

    y = X b + block + press

X has the levels of the factors (treatment coding) and, on request, products of two factors. The
deviations of blocks and presses are independent and normal. The model is estimated by restricted
maximum likelihood (`statsmodels.MixedLM`), and by least squares where a deviation of the blocks is
not identifiable or estimated as zero. A mean of a level is that over all levels of the others with
equal weights. Intervals are Student's; their degrees of freedom are those of the blocks for a
comparison between blocks, and those of the presses for one within blocks (containment).
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.session.repeatability import COVERAGE, Spread
from sautereau.trajectory.motion import Floats

ROUNDING = 1e-9  # Spread over magnitude that is attributed to rounding; relative tolerance of ranks
SAME = 1e-3  # Ratio of the deviations of blocks and presses below which that of blocks counts as 0


@dataclass(frozen=True)
class Effect(Spread):
    """A difference of means from that of the first level, in the quantity's unit."""

    factor: str
    """Name of the factor; of an interaction both, with ` x ` between them."""
    level: str
    """Level, or both levels of an interaction, with ` x ` between them."""
    std: float
    """Standard uncertainty."""
    degrees: int
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
    interaction: bool = False,
    order: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> FittedEffects:
    """Estimate the effects of factors on a quantity.

    Args:
        values: One for each press, in the quantity's unit, shape (n,); NaN for none.
        factors: Level of each press by factor, n each.
        blocks: Number of the block of each press, shape (n,).
        interaction: Whether to estimate the interactions of every two factors.
        order: Levels in their order by factor; those of other factors are in that of `in_order`.

    Raises:
        AnalysisError: There are too few presses, or the effects cannot be separated.
    """
    known = np.flatnonzero(np.isfinite(values))
    own = {f: [levels[i] for i in known.tolist()] for f, levels in factors.items()}
    columns = _Columns.of(own, order, interaction)
    numbers = np.unique(blocks[known], return_inverse=True)[1]
    fit = _Fit.of(values[known], columns, numbers)
    found = [_of_factor(fit, name) for name in columns.levels]
    found += [_of_interaction(fit, *pair) for pair in columns.pairs]
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
    pairs: tuple[tuple[str, str], ...]
    """Factors with an interaction."""

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
        if not several:
            raise AnalysisError(
                "effects: no factor has two levels in these presses; press a design of several"
            )
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

    @cached_property
    def _grid(self) -> tuple[list[dict[str, str]], Floats]:
        """All combinations of levels, and their rows."""
        cells = [dict(zip(self.levels, c, strict=True)) for c in product(*self.levels.values())]
        return cells, self.rows({f: [cell[f] for cell in cells] for f in self.levels})

    def mean(self, at: Mapping[str, str]) -> Floats:
        """Return the combination of coefficients that is the mean at some levels."""
        cells, rows = self._grid
        return rows[[all(cell[f] == level for f, level in at.items()) for cell in cells]].mean(0)


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
    between: NDArray[np.bool_]
    """Which columns are constant within all blocks."""
    degrees: tuple[int, int]
    """Degrees of freedom of the presses and of the blocks."""
    press_std: float
    block_std: float | None
    reason: str

    @classmethod
    def of(cls, values: Floats, columns: _Columns, blocks: NDArray[np.intp]) -> "_Fit":
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
        if n - x.shape[1] < 1:
            raise AnalysisError(
                f"effects: {n} presses for {x.shape[1]} coefficients leave no degree of freedom for"
                " a spread; make more presses"
            )
        scale = float(values.std())
        if scale <= ROUNDING * float(np.abs(values).max()):
            raise AnalysisError(
                "effects: the values have no spread; give presses that were really made, each once"
            )
        y, found, reason = (values - values.mean()) / scale, None, ""
        if len(counts) == 1:
            reason = "all presses are of one block"
        elif of_blocks < 1:
            names = [f for f in columns.levels if between[_first(columns, f)]]
            reason = (
                "each level is in one block only, so that the effect of setting it up again is part"
                f" of the effect of {', '.join(names)}; make a second block of each (set_ups = 2)"
            )
        elif of_presses < 1:
            reason = "no block has several presses of one combination"
        else:
            found, reason = _mixed(y, x, blocks)
        degrees = of_presses, of_blocks
        if found is None:
            free = n - x.shape[1]
            known = len(counts) > 1 and of_blocks > 0 and of_presses > 0
            degrees = free, of_blocks if known else free
            b: Any = np.linalg.lstsq(x, y)[0]
            press = float(np.sqrt(((y - x @ b) ** 2).sum() / free))
            covariance: Any = press**2 * np.linalg.inv(x.T @ x)
            found = _Mixed(b, covariance, press, 0.0 if known else None)
        coefficients = found.coefficients * scale
        coefficients[0] += values.mean()
        return cls(
            columns, coefficients, found.covariance * scale**2, between, degrees,
            found.press * scale, None if found.block is None else found.block * scale, reason,
        )  # fmt: skip

    def spread(self, combination: Floats) -> tuple[tuple[float, float, float], float, int]:
        """Return value and interval of a combination of coefficients, its std and degrees."""
        from scipy.stats import t

        value = float(combination @ self.coefficients)
        std = float(np.sqrt(combination @ self.covariance @ combination))
        degrees = self.degrees[bool((combination[self.between] != 0).any())]
        reach = float(t.ppf((1 + COVERAGE) / 2, degrees)) * std
        return (value, value - reach, value + reach), std, degrees

    def effect(self, factor: str, level: str, combination: Floats) -> Effect:
        """Return a combination of coefficients as an effect."""
        ends, std, degrees = self.spread(_clean(combination))
        return Effect(*ends, factor, level, std, degrees)

    def p_value(self, combinations: Sequence[Floats], degrees: int) -> float:
        """Return the p value of the hypothesis that all combinations are 0."""
        from scipy.stats import f

        rows = np.array(combinations)
        b, covariance = rows @ self.coefficients, rows @ self.covariance @ rows.T
        return float(f.sf(b @ np.linalg.solve(covariance, b) / len(rows), len(rows), degrees))


def _first(columns: _Columns, factor: str) -> int:
    """Return the first column of a factor."""
    before = list(columns.levels).index(factor)
    return 1 + sum(len(own) - 1 for own in list(columns.levels.values())[:before])


def _clean(combination: Floats) -> Floats:
    """Return a combination of coefficients without what is rounding."""
    return np.where(np.abs(combination) < ROUNDING, 0.0, combination)


class _Mixed(NamedTuple):
    """Coefficients with their covariance, and the standard deviations of presses and blocks."""

    coefficients: Floats
    covariance: Floats
    press: float
    block: float | None


def _mixed(y: Floats, x: Floats, blocks: NDArray[np.intp]) -> tuple[_Mixed | None, str]:
    """Return the mixed model, or why there is none.

    The likelihood is largest without a deviation of blocks, or the search for its maximum fails.
    """
    from sautereau.rig.errors import require

    require("ordinal", "effects", "statsmodels")
    from statsmodels.regression.mixed_linear_model import MixedLM

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # at a boundary it warns, which is found below
        try:
            found: Any = MixedLM(y, x, groups=blocks).fit(reml=True)
        except (np.linalg.LinAlgError, ValueError) as error:
            return None, f"the mixed model is singular ({error})"
    press = float(np.sqrt(found.scale))
    block = float(np.sqrt(max(float(np.asarray(found.cov_re)[0, 0]), 0.0)))
    covariance = np.asarray(found.cov_params())[: x.shape[1], : x.shape[1]]
    if block <= SAME * press:
        return None, "the blocks differ by no more than the presses within them"
    if not (found.converged and np.isfinite(covariance).all()):
        return None, "the search for the largest likelihood of the mixed model fails"
    return _Mixed(np.asarray(found.fe_params), covariance, press, block), ""


def _of_factor(fit: _Fit, name: str) -> FactorEffects:
    columns = fit.columns
    first, *others = columns.levels[name]
    counts = {level: list(columns.factors[name]).count(level) for level in columns.levels[name]}
    means = [
        LevelMean(*fit.spread(columns.mean({name: level}))[0], level, count)
        for level, count in counts.items()
    ]
    rows = [_clean(columns.mean({name: level}) - columns.mean({name: first})) for level in others]
    effects = [fit.effect(name, level, row) for level, row in zip(others, rows, strict=True)]
    p_value = fit.p_value(rows, effects[0].degrees)
    return FactorEffects((name,), tuple(means), tuple(effects), p_value)


def _of_interaction(fit: _Fit, a: str, b: str) -> FactorEffects:
    columns, name = fit.columns, f"{a} x {b}"
    first_a, *others_a = columns.levels[a]
    first_b, *others_b = columns.levels[b]
    effects, rows = [], []
    for one, other in product(others_a, others_b):
        cells = [columns.mean({a: i, b: j}) for i in (one, first_a) for j in (other, first_b)]
        rows.append(_clean(cells[0] - cells[1] - cells[2] + cells[3]))
        effects.append(fit.effect(name, f"{one} x {other}", rows[-1]))
    return FactorEffects((a, b), (), tuple(effects), fit.p_value(rows, effects[0].degrees))
