"""A prediction, as plain values and as lines."""

import math
from typing import Any

from sautereau.analysis.model.choirs import ChoirPluck
from sautereau.analysis.model.predict import Prediction
from sautereau.analysis.model.string.string import first_mode_release_speed
from sautereau.rig.schema import Rig


def prediction_summary(rig: Rig, found: Prediction) -> dict[str, Any]:
    """Return a prediction's scalars as JSON would hold them; SI units, the first choir's first."""
    return {
        "contact": found.contact,
        "release": found.release,
        "pluck_duration": found.pluck_duration,
        "plectrum_force": found.plectrum_force,
        "release_lift": found.release_lift,
        "release_angle": found.release_angle,
        "peak_force": found.peak_force,
        "work": found.work,
        "v_osc": found.v_osc,
        "v_osc_first_mode": first_mode_release_speed(rig.string, found.release_lift),
        "released_string": _string(found.choirs[0]),
        "choirs": [
            {
                "contact": choir.contact,
                "release": choir.release,
                "plectrum_force": choir.plectrum_force,
                "release_lift": choir.release_lift,
                "work": choir.work,
                "gives_way": choir.released_at_fold,
            }
            for choir in found.choirs
        ],
    }


def prediction_lines(rig: Rig, found: Prediction) -> list[str]:
    """Return a prediction as text."""
    first_mode = first_mode_release_speed(rig.string, found.release_lift)
    lines = [f"rig {rig.name}, plectrum as {found.level}, jack at {rig.press.jack_speed:.4g} m/s"]
    for number, choir in enumerate(found.choirs, 1):
        name = f"string {number}: " if len(found.choirs) > 1 else ""
        gives_way = ", where the plectrum gives way" * choir.released_at_fold
        lines += [
            f"{name}contact {choir.contact * 1e3:.4g} ms, release {choir.release * 1e3:.4g} ms"
            f"{gives_way}: the string is held for {choir.pluck_duration * 1e3:.4g} ms",
            f"at release: {choir.plectrum_force:.4g} N, string lifted"
            f" {choir.release_lift * 1e3:.4g} mm, plectrum at"
            f" {math.degrees(choir.release_angle):.4g} deg",
        ]
    return [
        *lines,
        f"the finger pushes with up to {found.peak_force:.4g} N and works"
        f" {found.work * 1e6:.4g} uJ against plectrum and string",
        f"the string leaves at {found.v_osc:.4g} m/s (all modes; the first alone {first_mode:.4g})",
    ]


def _string(choir: ChoirPluck) -> dict[str, float | None]:
    """Return the string's initial condition; a speed that is infinite, at a fold, is None."""
    state = choir.released_string
    values = {
        "x": state.x,
        "z": state.z,
        "velocity_x": state.velocity_x,
        "velocity_z": state.velocity_z,
    }
    return {name: value if math.isfinite(value) else None for name, value in values.items()}
