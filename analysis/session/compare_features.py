"""Every feature of recorded presses beside the model's."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.integrate import trapezoid

from sautereau.analysis.model.choirs import ChoirPluck
from sautereau.analysis.model.predict import Prediction
from sautereau.analysis.press.features import UNITS, Features
from sautereau.analysis.session.compare import mean_interval, predicted_features
from sautereau.rig.schema import Rig

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
class ComparedFeature:
    """One feature over repeated presses beside the model's; in its unit."""

    name: str
    """Column of `press.features.UNITS`; later plucks have their number behind."""
    unit: str
    presses: int
    """Presses that have it."""
    measured: float
    """Mean over the presses."""
    low: float | None
    """Lower end of the 95 % interval of the mean; None for a single press."""
    high: float | None
    """Upper end of the 95 % interval of the mean; None for a single press."""
    interval: Literal["none", "student", "bootstrap"]
    """Whence the interval comes."""
    predicted: float


def compare_features(
    rows: Sequence[Features], rig: Rig, prediction: Prediction
) -> tuple[ComparedFeature, ...]:
    """Compare the features of repeated presses with those of a prediction.

    Args:
        rows: Of the presses.
        rig: The bench that was predicted.
        prediction: The model's press.

    Returns:
        What both have, pluck by pluck; nothing where no press has a pluck.
    """
    choirs = sorted(prediction.choirs, key=lambda choir: choir.release)
    found = []
    for number, choir in enumerate(choirs):
        predicted = pluck_features(rig, prediction, choir)
        plucks = [row.plucks[number] for row in rows if number < len(row.plucks)]
        for name in COMPARED:
            values = [v for p in plucks if (v := getattr(p, name)) is not None]
            if values:
                found.append(_compared(name, number, values, predicted[name]))
    return tuple(found)


def pluck_features(rig: Rig, prediction: Prediction, choir: ChoirPluck) -> dict[str, float]:
    """Return the features of one predicted pluck [SI], by the names of `COMPARED`."""
    pressing = np.flatnonzero(choir.string_force > 0)
    first, last = int(pressing[0]) - 1, int(pressing[-1])
    held = slice(first, last + 1)
    force, deflection = prediction.finger_force[held], prediction.deflection[held]
    slope, _ = predicted_features(prediction, choir)
    after = prediction.finger_force[min(last + 1, len(prediction.finger_force) - 1)]
    travel = deflection * rig.key.press_arm / rig.key.laser_arm
    return {
        "pluck_duration": choir.pluck_duration,
        "contact_rise": float(prediction.rise[first]),
        "release_rise": float(prediction.rise[last]),
        "held_deflection": float(deflection[-1] - deflection[0]),
        "contact_force": float(force[0]),
        "release_force": float(force[-1]),
        "force_drop": float(force[-1] - after),
        "force_slope": slope,
        "held_work": float(trapezoid(force, travel)),
    }


def _compared(name: str, number: int, values: Sequence[float], predicted: float) -> ComparedFeature:
    low = high = None
    interval: Literal["none", "student", "bootstrap"] = "none"
    if len(values) > 1:
        low, high, interval = mean_interval(values)
    return ComparedFeature(
        name=f"{name}_{number + 1}" if number else name,
        unit=UNITS[name],
        presses=len(values),
        measured=float(np.mean(values)),
        low=low,
        high=high,
        interval=interval,
        predicted=predicted,
    )
