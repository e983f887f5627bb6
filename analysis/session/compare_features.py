"""Every feature of recorded presses beside the model's."""

from collections.abc import Sequence
from dataclasses import dataclass

from scipy.integrate import trapezoid

from sautereau.analysis.model.choirs import ChoirPluck
from sautereau.analysis.model.predict import Prediction
from sautereau.analysis.press.features import UNITS, Features
from sautereau.analysis.session.compare import Mean, held_steps, mean_of, predicted_features
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
    """Column of `press.features.UNITS`; those of the second pluck end in `_2`, and so on."""
    unit: str
    presses: int
    """Presses that have it."""
    measured: Mean
    predicted: float


def compare_features(
    rows: Sequence[Features], rig: Rig, prediction: Prediction
) -> tuple[ComparedFeature, ...]:
    """Compare the features of repeated presses with those of a prediction.

    Args:
        rows: Of the presses.
        rig: The predicted bench.
        prediction: The model's press.

    Returns:
        The features that both have, pluck by pluck; none where no press has a pluck.
    """
    choirs = sorted(prediction.choirs, key=lambda choir: choir.release)
    found = []
    for number, choir in enumerate(choirs, 1):
        predicted = pluck_features(rig, prediction, choir)
        plucks = [row.plucks[number - 1] for row in rows if number <= len(row.plucks)]
        for name in COMPARED:
            values = [v for p in plucks if (v := getattr(p, name)) is not None]
            if values:
                column = f"{name}_{number}" if number > 1 else name
                found.append(
                    ComparedFeature(
                        column, UNITS[name], len(values), mean_of(values), predicted[name]
                    )
                )
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
