"""Recordings against the model: slope, magnitude and duration, and every feature.

Each press is predicted for the speed that its jack had while the string was held. A compliant arm
loses 10 to 30 % of its speed then, and the key's inertia, slowed down, pushes in its place.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.choirs import ChoirPluck, choirs
from sautereau.analysis.model.predict import Prediction
from sautereau.analysis.phases import Phases
from sautereau.analysis.press.features import Row, column, work_along
from sautereau.analysis.press.string_start import predicted_start
from sautereau.analysis.session.budget import Budget, Contribution, budget
from sautereau.analysis.session.repeatability import NORMAL, student
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

ERRORS = ("slope_error", "magnitude_error", "duration_error")  # The errors of a comparison


@dataclass(frozen=True)
class Mean:
    """The mean of a quantity over repeated presses, in its unit."""

    value: float
    low: float | None
    """Lower end of the 95 % interval of the mean; None for a single press."""
    high: float | None
    """Upper end of the 95 % interval of the mean; None for a single press."""
    interval: Literal["none", "student", "bootstrap"]
    """Method of the interval: Student's t, or a bootstrap of many presses (BCa)."""


@dataclass(frozen=True)
class Comparison:
    """The paper's three statements as model errors [1], (model - measured) / measured.

    Their intervals contain the variation from press to press, and errors that all presses share:
    the gains of the sensors, and the standard uncertainties of contact, release and force slope.
    Those of the budget contain the ranges of the model's inputs as well.
    """

    presses: int
    """Presses with a pluck of the string."""
    string: int
    """Number of the string in the rig."""
    slope_error: Mean
    """Error of the slope of finger force against deflection while the string is held."""
    magnitude_error: Mean
    """Error of the increase of the finger force from contact to release."""
    duration_error: Mean
    """Error of the pluck duration."""
    stds: Mapping[str, float]
    """Standard uncertainty of each measured value, relative: of all presses together, or without
    the variation from press to press for a single one."""
    budget: Budget | None = None
    unlike_rig: tuple[str, ...] = ()
    """What in most presses is not as the rig states it, by factors that no range is to explain,
    and what changed between two presses."""

    def interval(self, name: str) -> tuple[float, float] | None:
        """Return the 95 % interval of an error with the model's inputs.

        That of a single press lacks the variation from press to press; without inputs it has none.
        """
        error = getattr(self, name)
        if self.budget and (self.budget.of_ranges or error.low is not None):
            return self.budget.intervals[name]
        return None if error.low is None else (error.low, error.high)

    @property
    def unexplained(self) -> list[str]:
        """Names of the errors whose interval does not contain 0."""
        ends = {name: self.interval(name) for name in self.stds}
        return [name for name, each in ends.items() if each and not each[0] <= 0 <= each[1]]

    @property
    def consistent(self) -> bool:
        """Whether the ranges that the rig states explain the errors, and all else is as it says."""
        return not (self.unexplained or self.unlike_rig)


def compare(
    phases: Sequence[Phases],
    predictions: Sequence[Prediction],
    gains: Mapping[str, float] | None = None,
) -> Comparison:
    """Compare the plucks of one string in repeated presses with predictions.

    It is the first string of the rig that has plucks.

    Args:
        predictions: Prediction of each press for the measured speed of its jack.
        gains: Relative standard uncertainties of features (`gain_stds`); 0 where missing.

    Raises:
        AnalysisError: No press has a pluck to compare.
    """
    string = compared_string(phases)
    if string > (strings := min(len(each.choirs) for each in predictions)):
        raise AnalysisError(
            f"string {string} was plucked, and the model has {strings}; compare with a rig that has"
            " the string"
        )
    both = zip(phases, predictions, strict=True)
    held = [(h, p, p.choirs[string - 1]) for f, p in both if (h := f.of_string(string))]
    predicted = [(h, *predicted_features(p, own)) for h, p, own in held]
    gains = gains or {}
    instants = [math.hypot(h.contact_std, h.release_std) / h.pluck_duration for h, _, _ in held]

    # The model is given the measured speed.
    duration_std = math.hypot(gains.get("held_speed", 0.0), float(np.mean(instants)))
    ratios = (
        [slope / h.force_slope for h, slope, _ in predicted],
        [rise / h.force_rise for h, _, rise in predicted],
        [own.pluck_duration / h.pluck_duration for h, _, own in held],
    )
    slope_std = float(np.mean([h.force_slope_std / abs(h.force_slope) for h, _, _ in held]))
    shared = (
        math.hypot(gains.get("force_slope", 0.0), slope_std),
        math.hypot(gains.get("release_force", 0.0), slope_std),
        duration_std,
    )
    found, stds = {}, {}
    for name, own, std in zip(ERRORS, ratios, shared, strict=True):
        mean = mean_of([ratio - 1 for ratio in own])
        found[name] = error = with_shared(mean, std * (1 + mean.value))
        if error.low is not None and error.high is not None:
            std = (error.high - error.low) / 2 / NORMAL / abs(1 + error.value)
        stds[name] = std
    return Comparison(len(held), string, **found, stds=stds)


def listed_contributions(found: Comparison) -> list[Contribution]:
    """Return the contributions that matter to any error; none without ranges."""
    every = found.budget.contributions if found.budget else ()
    # Smaller parts of a variance are not listed.
    return [c for c in every if max(c.fractions.values()) >= 0.02] if every[1:] else []


def with_budget(
    found: Comparison, rig: Rig, predict: Callable[[Rig], Prediction], bending: float = 0.0
) -> Comparison:
    """Return a comparison with its uncertainty budget; further arguments as of `budget`.

    Args:
        predict: Returns the prediction of a press for a rig.
    """

    def values(of: Rig) -> dict[str, float]:
        prediction = predict(of)
        own = prediction.choirs[found.string - 1]
        values = *predicted_features(prediction, own), own.pluck_duration
        return dict(zip(found.stds, values, strict=True))

    errors = {name: getattr(found, name).value for name in found.stds}
    return replace(found, budget=budget(rig, values, errors, found.stds, bending, found.string))


def compared_string(phases: Sequence[Phases]) -> int:
    """Return the number of the first string of the rig that has plucks in repeated presses.

    Raises:
        AnalysisError: No press has a pluck of a string of the rig.
    """
    plucks = [held for found in phases for held in found.plucks]
    if strings := [held.string for held in plucks if held.string]:
        return min(strings)
    raise AnalysisError(
        f"none of the {len(phases)} presses has a pluck{' whose string is known' * bool(plucks)},"
        " so there is nothing to compare; check the forces, and the strings and plectra of that key"
    )


def with_shared(mean: Mean, std: float) -> Mean:
    """Return a mean whose interval contains an error that all presses share.

    Args:
        std: Its standard uncertainty, in the mean's unit.
    """
    if mean.low is None or mean.high is None:
        return mean
    low, high = (math.hypot(end - mean.value, NORMAL * std) for end in (mean.low, mean.high))
    return replace(mean, low=mean.value - low, high=mean.value + high)


def predicted_features(
    prediction: Prediction, choir: ChoirPluck | None = None
) -> tuple[float, float]:
    """Return slope [N/m] and rise [N] of the finger force while a string is held.

    They are computed as the phases compute them from a recording.

    Args:
        choir: Whose string; None for that of the rig's first choir.
    """
    held = held_steps(prediction if choir is None else choir)
    force, deflection = prediction.finger_force[held], prediction.deflection[held]
    even = np.linspace(deflection[0], deflection[-1], len(deflection))
    # As `growth` of a force that does not ring: of a parabola over even steps.
    slope = float(np.polyfit(even, np.interp(even, deflection, force), 1)[0])
    return slope, slope * float(deflection[-1] - deflection[0])


def held_steps(pluck: Prediction | ChoirPluck) -> slice:
    """Return the steps of a prediction from contact to the last one before release."""
    pressing = np.flatnonzero(pluck.string_force > 0)
    return slice(int(pressing[0]) - 1, int(pressing[-1]) + 1)


def mean_of(values: Sequence[float]) -> Mean:
    """Return the mean of repeated presses with its 95 % interval.

    From 20 presses on they are resampled, with a fixed seed; of 20 normal ones that covers
    93 in 100. Of fewer it covers too little, and Student's t is used. A single press has no
    interval.

    Args:
        values: One or more, in any unit.
    """
    count, mean = len(values), float(np.mean(values))
    if count < 2:
        return Mean(mean, None, None, "none")
    if count >= 20 and np.ptp(values) > 0:
        return Mean(mean, *_resampled(np.asarray(values)), "bootstrap")
    half = float(student(count - 1) * np.std(values, ddof=1) / np.sqrt(count))
    return Mean(mean, mean - half, mean + half, "student")


def _resampled(values: Floats) -> tuple[float, float]:
    """Return the 95 % interval of a mean, with bias correction and acceleration.

    B. Efron and R. J. Tibshirani, An Introduction to the Bootstrap (1993), section 14.3. The
    means without one value each, of the acceleration there, differ as the values themselves.
    `scipy.stats.bootstrap` gives the same, but takes 0.5 s to load.
    """
    from scipy.special import ndtr, ndtri

    samples = np.random.default_rng(0).integers(0, len(values), (9999, len(values)))
    means = np.sort(values[samples].mean(axis=1))
    mean = values.mean()
    below = np.mean([means.searchsorted(mean, side) for side in ("left", "right")]) / len(means)
    deviation = values - mean
    acceleration = (deviation**3).sum() / (deviation**2).sum() ** 1.5 / 6
    bias = ndtri(below)
    reach = bias + ndtri([0.025, 0.975])
    low, high = np.quantile(means, ndtr(bias + reach / (1 - acceleration * reach)))
    return float(low), float(high)


def predicted_means(
    rows: Sequence[Row], rig: Rig, predictions: Sequence[Sequence[Prediction]]
) -> dict[str, float]:
    """Return the model's features of repeated presses, each the mean over the presses that have it.

    Args:
        predictions: Of each press, a prediction for each pluck, for the speed that the jack had
            until its release. Plucks without a prediction are not compared.

    Returns:
        By the columns of `sautereau.analysis.press.features.by_string`, SI; those of `COMPARED`
        that both have.
    """
    found: dict[str, list[float]] = {}
    for row, own in zip(rows, predictions, strict=True):
        for pluck, prediction in enumerate(own, 1):
            string = row.get(column("string", pluck))
            if not isinstance(string, int) or string > len(prediction.choirs):
                continue
            values = pluck_features(rig, prediction, prediction.choirs[string - 1])
            for name, value in values.items():
                if isinstance(row.get(column(name, pluck)), float):
                    found.setdefault(column(name, string), []).append(value)
    return {name: float(np.mean(values)) for name, values in found.items()}


def pluck_features(rig: Rig, prediction: Prediction, choir: ChoirPluck) -> dict[str, float]:
    """Return the features of one predicted pluck [SI], by `COMPARED` and `OF_START`."""
    held = held_steps(choir)
    force, deflection = prediction.finger_force[held], prediction.deflection[held]
    slope, _ = predicted_features(prediction, choir)
    after = prediction.finger_force[min(held.stop, len(prediction.finger_force) - 1)]
    travel = deflection * rig.key.press_arm / rig.key.laser_arm
    rise = prediction.rise[held]
    number = next(k for k, own in enumerate(prediction.choirs) if own is choir)
    string = choirs(rig)[number].string
    return {
        **predicted_start(string, choir, prediction.time),
        "pluck_duration": choir.pluck_duration,
        "contact_rise": float(rise[0]),
        "release_rise": float(rise[-1]),
        "held_deflection": float(deflection[-1] - deflection[0]),
        "contact_force": float(force[0]),
        "release_force": float(force[-1]),
        "force_drop": float(force[-1] - after),
        "force_slope": slope,
        "held_work": work_along(travel, force),
    }
