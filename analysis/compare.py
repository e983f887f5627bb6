"""Recordings against the model: slope, magnitude and duration."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.errors import AnalysisError
from analysis.model.predict import Prediction
from analysis.phases import Phases


@dataclass(frozen=True)
class Departure:
    """How far the prediction departs from the measurement, over repeated presses."""

    value: float
    """1, mean over the presses of predicted / measured - 1."""
    low: float | None
    """1, lower end of the 95 % interval of the mean; None for a single press."""
    high: float | None
    """1, upper end of the 95 % interval of the mean; None for a single press."""


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
        magnitude_error=_departure([rise / (h.peak_force - h.contact_force) - 1 for h in held]),
        duration_error=_departure([prediction.contact_duration / h.duration - 1 for h in held]),
    )


def predicted_features(prediction: Prediction) -> tuple[float, float]:
    """Return slope [N/m] and rise [N] of the finger's force while the string is held.

    They are taken as the phases take them from a recording.
    """
    pressing = np.flatnonzero(prediction.string_force > 0)
    held = slice(pressing[0] - 1, pressing[-1] + 1)
    force, deflection = prediction.finger_force[held], prediction.deflection[held]
    even = np.linspace(deflection[0], deflection[-1], len(deflection))
    slope = np.polyfit(even, np.interp(even, deflection, force), 1)[0]
    return float(slope), float(force[-1] - force[0])


def _departure(values: list[float]) -> Departure:
    """Return the mean with Student's 95 % interval."""
    mean = float(np.mean(values))
    if len(values) < 2:
        return Departure(mean, None, None)
    from scipy.stats import t

    half = float(t.ppf(0.975, len(values) - 1) * np.std(values, ddof=1) / np.sqrt(len(values)))
    return Departure(mean, mean - half, mean + half)
