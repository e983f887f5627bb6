"""A prediction as JSON and as text."""

import math
from typing import Any

from sautereau.analysis.model.predict import Prediction
from sautereau.analysis.model.string.string import first_mode_release_speed
from sautereau.analysis.summary.text import part_of
from sautereau.rig.quantities import QUANTITIES
from sautereau.rig.schema import Rig


def prediction_summary(rig: Rig, found: Prediction) -> dict[str, Any]:
    """Return a prediction's scalars as JSON; SI units, the first choir's first."""
    names = ("contact", "release", "pluck_duration", "release_force", "plectrum_force",
             "release_lift", "release_angle", "peak_force", "work", "v_osc")  # fmt: skip
    state = found.choirs[0].released_string  # at a fold a speed is infinite, and None here
    of_choir = ("contact", "release", "pluck_duration", "plectrum_force", "release_lift",
                "release_angle", "work")  # fmt: skip
    return {
        **part_of(found, *names),
        "v_osc_first_mode": first_mode_release_speed(rig.string, found.release_lift),
        "released_string": {
            name: speed if math.isfinite(speed := getattr(state, name)) else None
            for name in ("x", "z", "velocity_x", "velocity_z")
        },
        "choirs": [
            part_of(choir, *of_choir) | {"gives_way": choir.released_at_fold}
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
    first = " of string 1" * (len(found.choirs) > 1)
    return [
        *lines,
        f"finger: {_shown('release_force', found.release_force)}{first},"
        f" {_shown('peak_force', found.peak_force)}, {_shown('work', found.work)}",
        f"{QUANTITIES['v_osc'].label}{first}: {found.v_osc:.4g} m/s (all modes);"
        f" largest velocity of the first mode alone: {first_mode:.3g} m/s",
    ]


def _shown(name: str, value: float) -> str:
    """Return a quantity with its label, in the unit of texts."""
    quantity = QUANTITIES[name]
    scale, unit = quantity.displayed
    return f"{quantity.label} {value * scale:.4g} {unit}"
