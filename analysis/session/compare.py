"""Recordings against the model: slope, magnitude and duration, and every feature."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.integrate import trapezoid

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.choirs import ChoirPluck
from sautereau.analysis.model.predict import Prediction
from sautereau.analysis.phases import Phases
from sautereau.analysis.press.features import UNITS, Row, column
from sautereau.rig.schema import Rig

MANY = 20
"""Presses from which on the interval is a bootstrap's: of fewer, Student's covers better."""
RESAMPLES = 9999
"""Of a bootstrap."""
COMPARED = (
    "pluck_duration",
    "contact_rise",
    "release_rise",
    "held_deflection",
    "contact_force",
    "release_force",
    "force_drop",
    "force_slope",
    "held_work",
)
"""Features of a pluck that the model predicts; forces are counted from those at rest."""


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
    """The paper's three statements as model errors [1], (model - measured) / measured."""

    presses: int
    """Presses with a pluck."""
    slope_error: Mean
    """Of the finger force on the deflection while the string is held."""
    magnitude_error: Mean
    """Of the rise of the finger force from contact to release."""
    duration_error: Mean
    """Of the pluck duration."""


def compare(phases: Sequence[Phases], prediction: Prediction) -> Comparison:
    """Compare the first pluck of repeated presses with a prediction.

    Raises:
        AnalysisError: No press has a pluck to compare.
    """
    held = [p.plucks[0] for p in phases if p.plucks]
    if not held:
        raise AnalysisError(
            f"none of the {len(phases)} presses has a pluck, so there is nothing to compare;"
            " check the forces, and the string and plectrum of that key"
        )
    slope, rise = predicted_features(prediction)
    duration = prediction.pluck_duration
    return Comparison(
        presses=len(held),
        slope_error=mean_of([slope / h.force_slope - 1 for h in held]),
        magnitude_error=mean_of([rise / (h.release_force - h.contact_force) - 1 for h in held]),
        duration_error=mean_of([duration / h.pluck_duration - 1 for h in held]),
    )


def predicted_features(
    prediction: Prediction, choir: ChoirPluck | None = None
) -> tuple[float, float]:
    """Return slope [N/m] and rise [N] of the finger force while a string is held.

    They are computed as the phases compute them from a recording.

    Args:
        prediction: The model's press.
        choir: Whose string; None for the first.
    """
    held = held_steps(prediction if choir is None else choir)
    force, deflection = prediction.finger_force[held], prediction.deflection[held]
    even = np.linspace(deflection[0], deflection[-1], len(deflection))
    slope = np.polyfit(even, np.interp(even, deflection, force), 1)[0]
    return float(slope), float(force[-1] - force[0])


def held_steps(pluck: Prediction | ChoirPluck) -> slice:
    """Return the steps of a prediction from contact to the last one before release."""
    pressing = np.flatnonzero(pluck.string_force > 0)
    return slice(int(pressing[0]) - 1, int(pressing[-1]) + 1)


def mean_of(values: Sequence[float]) -> Mean:
    """Return the mean of repeated presses with its 95 % interval.

    From `MANY` presses on they are resampled with bias correction and acceleration (Efron
    1987), with a fixed seed; of 20 normal ones that covers 93 in 100. Of fewer it covers too
    little, and Student's t is used. A single press has no interval.

    Args:
        values: One or more, in any unit.
    """
    from scipy.stats import bootstrap, t

    count, mean = len(values), float(np.mean(values))
    if count < 2:
        return Mean(mean, None, None, "none")
    if count >= MANY and np.ptp(values) > 0:
        found = bootstrap(
            (values,), np.mean, n_resamples=RESAMPLES, method="BCa", rng=np.random.default_rng(0)
        ).confidence_interval
        return Mean(mean, float(found.low), float(found.high), "bootstrap")
    half = float(t.ppf(0.975, count - 1) * np.std(values, ddof=1) / np.sqrt(count))
    return Mean(mean, mean - half, mean + half, "student")


@dataclass(frozen=True)
class ComparedFeature:
    """One feature over repeated presses beside the model's; in its unit."""

    name: str
    """Column of `sautereau.analysis.press.features`."""
    unit: str
    presses: int
    """Presses that have it."""
    measured: Mean
    predicted: float


def compare_features(
    rows: Sequence[Row], rig: Rig, prediction: Prediction
) -> tuple[ComparedFeature, ...]:
    """Compare the features of repeated presses with those of a prediction.

    Args:
        rows: Features of the presses.
        rig: The predicted bench.
        prediction: The model's press.

    Returns:
        The features that both have, pluck by pluck; none where no press has a pluck.
    """
    choirs = sorted(prediction.choirs, key=lambda choir: choir.release)
    found = []
    for number, choir in enumerate(choirs, 1):
        predicted = pluck_features(rig, prediction, choir)
        for name in COMPARED:
            key = column(name, number)
            values = [value for row in rows if isinstance(value := row.get(key), float)]
            if values:
                mean = mean_of(values)
                found.append(ComparedFeature(key, UNITS[name], len(values), mean, predicted[name]))
    return tuple(found)


def pluck_features(rig: Rig, prediction: Prediction, choir: ChoirPluck) -> dict[str, float]:
    """Return the features of one predicted pluck [SI], by the names of `COMPARED`."""
    held = held_steps(choir)
    force, deflection = prediction.finger_force[held], prediction.deflection[held]
    slope, _ = predicted_features(prediction, choir)
    after = prediction.finger_force[min(held.stop, len(prediction.finger_force) - 1)]
    travel = deflection * rig.key.press_arm / rig.key.laser_arm
    rise = prediction.rise[held]
    return {
        "pluck_duration": choir.pluck_duration,
        "contact_rise": float(rise[0]),
        "release_rise": float(rise[-1]),
        "held_deflection": float(deflection[-1] - deflection[0]),
        "contact_force": float(force[0]),
        "release_force": float(force[-1]),
        "force_drop": float(force[-1] - after),
        "force_slope": slope,
        "held_work": float(trapezoid(force, travel)),
    }
