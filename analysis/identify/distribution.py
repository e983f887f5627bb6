"""The distribution of the fitted values, within the bounds of the fit, and draws of it."""

from dataclasses import dataclass

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.trajectory.motion import Floats

CANDIDATES = 2**14
"""Number of candidates for draws. Of fits to the packaged rig, with 15 values of which seven are
hardly known within their ranges, 84 % or more are accepted."""


@dataclass(frozen=True)
class Distribution:
    """The normal distribution of all fitted values of the rig, within their bounds; SI."""

    names: tuple[str, ...]
    values: Floats
    """Most probable values, shape (values,)."""
    covariance: Floats
    """Total covariance without the bounds, shape (values, values)."""
    low: Floats
    """Lower bounds, shape (values,): assumed ranges, and physical limits such as a friction of 0;
    -inf without one."""
    high: Floats
    """Upper bounds, shape (values,); inf without one."""

    def drawn(self, count: int) -> Floats:
        """Return independent draws of the values, shape (count, values).

        Each value is drawn within its bounds, given the values before it; the joint draw is
        accepted with the probability of those bounds (Geweke 1991; Botev 2017, without tilting).
        The points are quasi-random (Sobol).

        Raises:
            AnalysisError: The bounds hardly contain any of the distribution.
        """
        from scipy.special import ndtr
        from scipy.stats import qmc, truncnorm

        stds = np.sqrt(np.diag(self.covariance))
        moving = np.flatnonzero(stds > 0)
        low, high = ((ends - self.values)[moving] / stds[moving] for ends in (self.low, self.high))
        order = np.argsort(ndtr(high) - ndtr(low))  # the most restricted first: more are accepted
        moving, low, high = moving[order], low[order], high[order]
        within = self.covariance[np.ix_(moving, moving)] / np.outer(stds[moving], stds[moving])
        sizes, directions = np.linalg.eigh(within)
        root = directions * np.sqrt(np.maximum(sizes, 0.0))
        factor = np.linalg.qr(root.T)[1].T  # Cholesky's, which exists for a singular matrix as well
        factor *= np.where(np.diag(factor) < 0, -1.0, 1.0)
        own = np.maximum(np.diag(factor), 1e-9)
        points = qmc.Sobol(len(moving) + 1, rng=np.random.default_rng(0)).random(CANDIDATES)
        normal, chance = np.zeros((CANDIDATES, len(moving))), np.ones(CANDIDATES)
        for k, row in enumerate(factor):
            given = normal[:, :k] @ row[:k]
            ends = (low[k] - given) / own[k], (high[k] - given) / own[k]
            normal[:, k] = truncnorm.ppf(points[:, k], *ends)
            chance *= ndtr(ends[1]) - ndtr(ends[0])
        accepted = normal[points[:, -1] * chance.max() < chance][:count]
        if len(accepted) < count:
            raise AnalysisError(
                f"fit: {len(accepted)} of {CANDIDATES} draws of its distribution are within the"
                f" bounds of its values, and {count} are needed; record more presses, or give"
                " priors"
            )
        draws = np.tile(self.values, (count, 1))
        draws[:, moving] += stds[moving] * (accepted @ factor.T)
        return np.clip(draws, self.low, self.high)  # of rounding
