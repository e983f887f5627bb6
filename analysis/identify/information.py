"""The information matrix of a fit: what recordings and priors say about its parameters.

Everything about uncertainty follows from it: standard uncertainties, identifiable combinations (the
right singular vectors of the scaled Jacobian, whose singular values are the inverses of their
standard uncertainties), the effects of hidden parameters, and how certain a result would be if
something were measured or more presses were made.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify import parameters
from sautereau.trajectory.motion import Floats

IDENTIFIABLE = 0.025
"""A parameter is identifiable if its standard uncertainty, divided by its scale, is below this. The
ends of its 95 % interval are then at most 5 % of the scale from the value."""
MORE = 4  # Ratio by which the number of presses is increased in the advice to record more
USEFUL = 0.9  # A measurement is listed if it reduces the uncertainty to less than this fraction
_HOW = {
    parameters.FORCE_GAIN: "calibrate the force transducer, and give gain_std",
    parameters.VELOCITY_GAIN: "calibrate the vibrometer, and give gain_std",
    parameters.TIME: "measure the delays of force and velocity, and give delay_std",
    **dict.fromkeys(
        (parameters.SLIDING, parameters.LATE_SLIDING),
        "support the finger more stiffly along the key",
    ),
    **dict.fromkeys((parameters.DAMPER, parameters.DAMPER_LIFT), "raise the damper"),
    "key.front_arm": "measure the place of the pin, and give the lengths from it without ranges",
}  # How to measure or remove what a hidden parameter describes


@dataclass(frozen=True)
class Combination:
    """A combination of the scaled parameters."""

    weights: dict[str, float]
    """Weight of each parameter's scaled change. The squares sum to 1; small weights are omitted."""
    std: float | None
    """Total standard uncertainty of the combination, dimensionless; None if undetermined."""
    identifiable: bool
    """Whether the uncertainty is below `IDENTIFIABLE`."""

    def __str__(self) -> str:
        parts = [f"{'-' if w < 0 else '+'} {abs(w):.2f} {n}" for n, w in self.weights.items()]
        return " ".join(parts).removeprefix("+ ")


@dataclass(frozen=True)
class Measurement:
    """A measurement that would reduce the uncertainty of a result."""

    what: str
    """What to measure or to change."""
    std: float
    """Standard uncertainty of the result if what is measured were known exactly, SI."""


@dataclass(frozen=True)
class Uncertainty:
    """The uncertainty of one parameter; SI. Of what is expected, the mean of the instruments."""

    name: str
    unit: str
    value: float
    """Fitted value; of what is expected that of the rig."""
    std: float | None
    """Total standard uncertainty, the root of the sum of the squares of the next two; None if
    undetermined."""
    std_noise: float | None
    """Standard uncertainty from the noise of the recordings; None if undetermined."""
    std_inputs: float | None
    """Standard uncertainty from gains and delays of the sensors, from priors, and from the assumed
    ranges of the rig's numbers; None if undetermined."""
    needed: float
    """Standard uncertainty below which it is identifiable."""
    identifiable: bool
    """Whether its total uncertainty without its own prior is small enough; see `IDENTIFIABLE`."""


@dataclass(frozen=True)
class Information:
    """What recordings and priors say about the scaled parameters of a fit."""

    names: Sequence[str]
    """Names of all parameters."""
    data: Floats
    """Derivatives of independent residuals by the scaled parameters, shape (n, parameters)."""
    prior: Floats
    """Derivatives of the priors, shape (priors, parameters)."""
    lacking: Floats
    """Uncertainty of the scaled parameters that no residual shows, shape (parameters,)."""

    @cached_property
    def _bayes(self) -> tuple[Floats, NDArray[np.bool_]]:
        """Covariance of data and priors, and which parameters are determined."""
        _, singular, directions = np.linalg.svd(
            np.vstack([self.data, self.prior]), full_matrices=False
        )
        # Smaller singular values, over the largest one, are of undetermined combinations.
        seen = singular > 1e-7 * max(float(singular[0]), 1e-300)
        kept = directions[seen] / singular[seen, None]
        return kept.T @ kept, np.all(np.abs(directions[~seen]) < 1e-3, axis=0)

    @cached_property
    def covariance(self) -> Floats:
        """Total covariance, of data and priors, and of what is lacking."""
        return self._bayes[0] + np.outer(self.lacking, self.lacking)

    @cached_property
    def stds(self) -> Floats:
        """Total standard uncertainties, infinite if undetermined; shape (parameters,)."""
        return np.where(self._bayes[1], np.sqrt(np.diag(self.covariance)), np.inf)

    @cached_property
    def noise_stds(self) -> Floats:
        """The noise's part of them, with what is lacking; shape (parameters,)."""
        covariance, _ = self._bayes
        return np.hypot(np.linalg.norm(self.data @ covariance, axis=0), self.lacking)

    @cached_property
    def correlation(self) -> Floats:
        """Total correlation coefficients; 0 with an undetermined parameter."""
        stds = self.stds
        deviations = np.outer(stds, stds)
        within = np.isfinite(deviations) & (deviations > 0)
        return np.divide(self.covariance, deviations, out=np.eye(len(stds)), where=within)

    def by(self, number: int) -> Floats:
        """Return the change of all parameters by that of one of them: its regression on the others.

        It does not depend on the prior of that one.
        """
        covariance, _ = self._bayes
        return covariance[number] / covariance[number, number]

    def std(self, number: int, known: Sequence[int] = (), presses: float = 1.0) -> float:
        """Return the total standard uncertainty of a parameter; infinite if undetermined.

        Its own prior does not count.

        Args:
            number: Number of the parameter.
            known: Numbers of the parameters that are known exactly.
            presses: Ratio of the number of presses to that of the recorded ones.
        """
        kept = [k for k in range(len(self.names)) if k not in known]
        prior = self.prior[self.prior[:, number] == 0]
        return float(
            Information(
                [self.names[k] for k in kept],
                np.sqrt(presses) * self.data[:, kept],
                prior[:, kept],
                self.lacking[kept],
            ).stds[kept.index(number)]
        )

    def measurements(self, number: int, scale: float) -> tuple[Measurement, ...]:
        """Return the measurements that would reduce a parameter's uncertainty most, best first.

        Args:
            number: Number of the parameter.
            scale: SI, scale of the parameter.
        """
        now = self.std(number)
        known = {how: [k for k in own if k != number] for how, own in self.measurable().items()}
        found = [Measurement(how, self.std(number, own) * scale) for how, own in known.items()]
        more = self.std(number, presses=MORE)
        found.append(Measurement(f"record {MORE} times as many presses", more * scale))
        found = [each for each in found if each.std < USEFUL * now * scale]
        return tuple(sorted(found, key=lambda each: each.std)[:2])  # The best two

    def measurable(self) -> dict[str, list[int]]:
        """Return the numbers of the parameters that a measurement would give, by what to do."""
        found: dict[str, list[int]] = {}
        for k, name in enumerate(self.names):
            how = (
                f"measure {name}, free it, and give it by --prior"
                if parameters.is_name(name)
                else None
            )
            if name.startswith(parameters.MODE) or name == parameters.CLOTH:
                how = "record presses at another speed as well"
            elif name.startswith(parameters.OF_STRING[0].partition("{")[0]):
                how = "press with the other registers off"
            if how := _HOW.get(name, how):
                found.setdefault(how, []).append(k)
        return found

    def combinations(self, shown: Sequence[int]) -> tuple[Combination, ...]:
        """Return combinations of some parameters, those best determined by the data first.

        Args:
            shown: Their numbers. Their own priors do not count, those of all others do.
        """
        hidden = [k for k in range(len(self.names)) if k not in shown]
        own = np.vstack([self.data, self.prior[np.all(self.prior[:, shown] == 0, axis=1)]])
        base, _ = np.linalg.qr(own[:, hidden])
        rows = own[:, shown] - base @ (base.T @ own[:, shown])
        _, singular, directions = np.linalg.svd(rows, full_matrices=False)
        found = []
        for value, direction in zip(singular, directions, strict=True):
            order = np.argsort(-np.abs(direction)).tolist()
            direction = direction * np.sign(direction[order[0]])
            listed = [k for k in order if abs(direction[k]) >= 0.1]  # Its main parts
            weights = {self.names[int(shown[k])]: float(direction[k]) for k in listed}
            seen = value > 1e-9 * max(float(singular[0]), 1e-300)
            std = 1 / float(value) if seen else None
            found.append(Combination(weights, std, std is not None and std < IDENTIFIABLE))
        return tuple(found)


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
