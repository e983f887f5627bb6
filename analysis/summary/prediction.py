"""A prediction as JSON and as text."""

import math
from typing import Any

from sautereau.analysis.model.choirs import ChoirPluck
from sautereau.analysis.model.predict import Prediction
from sautereau.analysis.model.string.string import first_mode_release_speed
from sautereau.rig.quantities import QUANTITIES
from sautereau.rig.schema import Rig


def prediction_summary(rig: Rig, found: Prediction) -> dict[str, Any]:
    """Return a prediction's scalars as JSON; SI units, the first choir's first."""
    names = ("contact", "release", "pluck_duration", "release_force", "plectrum_force",
             "release_lift", "release_angle", "peak_force", "work", "v_osc")  # fmt: skip
    of_choir = ("contact", "release", "plectrum_force", "release_lift", "work")
    return {
        **{name: getattr(found, name) for name in names},
        "v_osc_first_mode": first_mode_release_speed(rig.string, found.release_lift),
        "released_string": _string(found.choirs[0]),
        "choirs": [
            {name: getattr(choir, name) for name in of_choir}
            | {"gives_way": choir.released_at_fold}
            for choir in found.choirs
        ],
    }


def prediction_lines(rig: Rig, found: Prediction) -> list[str]:
    """Return a prediction as text."""
    first_mode = first_mode_release_speed(rig.string, found.release_lift)
    lines = [
        f"rig {rig.name}, plectrum model {found.level}, jack speed"
        f" {rig.press.jack_speed:.4g} m/s; times after the jack leaves rest:"
    ]
    for number, choir in enumerate(found.choirs, 1):
        name = f"string {number}: " if len(found.choirs) > 1 else ""
        early = (
            ", before the tip: the plectrum's deflection reaches its limit" * choir.released_at_fold
        )
        lines += [
            f"{name}contact {choir.contact * 1e3:.4g} ms, release {choir.release * 1e3:.4g} ms"
            f"{early}; {_shown('pluck_duration', choir.pluck_duration)}",
            *(
                f"  {_shown(quantity, getattr(choir, quantity))}"
                for quantity in ("plectrum_force", "release_lift", "release_angle")
            ),
        ]
    return [
        *lines,
        f"finger: {_shown('release_force', found.release_force)},"
        f" {_shown('peak_force', found.peak_force)}, {_shown('work', found.work)}",
        f"{QUANTITIES['v_osc'].label}: {found.v_osc:.4g} m/s (all modes),"
        f" {first_mode:.3g} m/s (first mode only)",
    ]


def _shown(name: str, value: float) -> str:
    """Return a quantity with its label, in the unit of texts."""
    quantity = QUANTITIES[name]
    scale, unit = quantity.displayed
    return f"{quantity.label} {value * scale:.4g} {unit}"


def _string(choir: ChoirPluck) -> dict[str, float | None]:
    """Return the string's initial condition; a speed that is infinite, at a fold, is None."""
    state = choir.released_string
    values = {name: getattr(state, name) for name in ("x", "z", "velocity_x", "velocity_z")}
    return {name: value if math.isfinite(value) else None for name, value in values.items()}
