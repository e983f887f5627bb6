"""Recordings against the model: slope, magnitude and duration."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.choirs import ChoirPluck
from sautereau.analysis.model.predict import Prediction
from sautereau.analysis.phases import Phases

MANY = 20
"""Presses from which on they are resampled: of fewer, Student's interval covers better."""
RESAMPLES = 9999
"""Of a bootstrap."""


@dataclass(frozen=True)
class Departure:
    """How far the prediction departs from the measurement, over repeated presses."""

    value: float
    """1, mean over the presses of predicted / measured - 1."""
    low: float | None
    """1, lower end of the 95 % interval of the mean; None for a single press."""
    high: float | None
    """1, upper end of the 95 % interval of the mean; None for a single press."""
    interval: Literal["none", "student", "bootstrap"] = "none"
    """Whence the interval comes: Student's t, or presses resampled (BCa) where they are many."""


@dataclass(frozen=True)
class Comparison:
    """The paper's three statements as numbers."""

    presses: int
    """Presses with a pluck."""
    slope_error: Departure
    """Of the force on the deflection while the string is held."""
    magnitude_error: Departure
    """Of the rise of the force from contact to release."""
    duration_error: Departure
    """Of the time the string is held."""


def compare(phases: Sequence[Phases], prediction: Prediction) -> Comparison:
    """Compare what was measured in repeated presses with a prediction.

    Raises:
        AnalysisError: No press has a pluck to compare.
    """
    held = [p.plucks[0] for p in phases if p.plucks]
    if not held:
        raise AnalysisError(
            f"none of the {len(phases)} presses has a pluck, so there is nothing to compare;"
            " look at the forces, and at the string and plectrum of that key"
        )
    slope, rise = predicted_features(prediction)
    return Comparison(
        presses=len(held),
        slope_error=_departure([slope / h.slope - 1 for h in held]),
        magnitude_error=_departure([rise / (h.release_force - h.contact_force) - 1 for h in held]),
        duration_error=_departure([prediction.pluck_duration / h.duration - 1 for h in held]),
    )


def predicted_features(
    prediction: Prediction, choir: ChoirPluck | None = None
) -> tuple[float, float]:
    """Return slope [N/m] and rise [N] of the finger's force while a string is held.

    They are taken as the phases take them from a recording.

    Args:
        prediction: The model's press.
        choir: Whose string; None for the first.
    """
    string_force = prediction.string_force if choir is None else choir.string_force
    pressing = np.flatnonzero(string_force > 0)
    held = slice(pressing[0] - 1, pressing[-1] + 1)
    force, deflection = prediction.finger_force[held], prediction.deflection[held]
    even = np.linspace(deflection[0], deflection[-1], len(deflection))
    slope = np.polyfit(even, np.interp(even, deflection, force), 1)[0]
    return float(slope), float(force[-1] - force[0])


def _departure(values: list[float]) -> Departure:
    """Return the mean with its 95 % interval."""
    mean = float(np.mean(values))
    if len(values) < 2:
        return Departure(mean, None, None)
    low, high, kind = mean_interval(values)
    return Departure(mean, low, high, kind)


def mean_interval(
    values: Sequence[float],
) -> tuple[float, float, Literal["student", "bootstrap"]]:
    """Return the ends of the 95 % interval of a mean, and whence they come.

    From `MANY` values on these are resampled with bias correction and acceleration (Efron
    1987), with a fixed seed; of 20 normal ones that covers 93 in 100. Of fewer it covers too
    little, and Student's t is taken.

    Args:
        values: Two or more, in any unit.
    """
    from scipy.stats import bootstrap, t

    count, mean = len(values), float(np.mean(values))
    if count >= MANY and np.ptp(values) > 0:
        found = bootstrap(
            (values,), np.mean, n_resamples=RESAMPLES, method="BCa", rng=np.random.default_rng(0)
        ).confidence_interval
        return float(found.low), float(found.high), "bootstrap"
    half = float(t.ppf(0.975, count - 1) * np.std(values, ddof=1) / np.sqrt(count))
    return mean - half, mean + half, "student"
