"""The press that the model predicts."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sautereau.analysis.model import predict as model
from sautereau.analysis.model.choirs import string_names
from sautereau.analysis.model.string.string import first_mode_release_speed
from sautereau.analysis.results.result import Result, part_of, shown
from sautereau.rig.quantities import QUANTITIES
from sautereau.rig.schema import Rig

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from sautereau.analysis.results.predicted import Predicted

COLUMNS = {"rise": "m", "deflection": "m", "finger_force": "N", "string_force": "N"}
"""Columns of the table and their units."""


@dataclass(frozen=True, repr=False)
class Prediction(Result):
    """The model's press of a rig; `press` has all its arrays."""

    rig: Rig
    press: model.Prediction

    def __repr__(self) -> str:
        return (
            f"<Prediction for rig {self.rig.name}: pluck of"
            f" {self.press.pluck_duration * 1e3:.4g} ms, force at release"
            f" {self.press.release_force:.4g} N>"
        )

    @property
    def document(self) -> dict[str, Any]:
        """Durations, forces and speeds as JSON, SI: of string 1, and in `choirs` of each string."""
        found = self.press
        names = ("contact", "release", "pluck_duration", "release_force", "plectrum_force",
                 "release_lift", "release_angle", "peak_force", "work", "v_osc")  # fmt: skip
        state = found.choirs[0].released_string  # at a fold a speed is infinite, and None here
        of_choir = ("contact", "release", "pluck_duration", "plectrum_force", "release_lift",
                    "release_angle", "work")  # fmt: skip
        return {
            "string": 1,
            **part_of(found, *names),
            "level": found.level,
            "warnings": list(found.warnings),
            "v_osc_first_mode": first_mode_release_speed(self.rig.string, found.release_lift),
            "released_string": {
                name: speed if math.isfinite(speed := getattr(state, name)) else None
                for name in ("x", "z", "velocity_x", "velocity_z")
            },
            "choirs": [
                {"string": k, **part_of(choir, *of_choir), "gives_way": choir.released_at_fold}
                for k, choir in enumerate(found.choirs, 1)
            ],
        }

    @property
    def scalars(self) -> dict[str, Any]:
        """Durations, forces and speeds of the press, SI, by the names of the glossary."""
        return self.document

    def lines(self) -> list[str]:
        """Return the prediction as text."""
        found = self.press
        first_mode = first_mode_release_speed(self.rig.string, found.release_lift)
        lines = [
            f"rig {self.rig.name}, plectrum model {found.level}, jack speed"
            f" {self.rig.press.jack_speed:.4g} m/s; times after the jack leaves rest:"
        ]
        several, strings = len(found.choirs) > 1, string_names(self.rig)
        for string, choir in zip(strings, found.choirs, strict=True):
            name = f"{string}: " if several else ""
            early = (
                ", before the tip: the plectrum's deflection reaches its limit"
                * choir.released_at_fold
            )
            lines += [
                f"{name}contact {choir.contact * 1e3:.4g} ms, release {choir.release * 1e3:.4g} ms"
                f"{early}; {_shown('pluck_duration', choir.pluck_duration)}",
                *(
                    f"  {_shown(quantity, getattr(choir, quantity))}"
                    for quantity in ("plectrum_force", "release_lift", "release_angle")
                ),
            ]
        first = f" of {strings[0]}" * several
        return [
            *lines,
            f"finger: {_shown('release_force', found.release_force)}{first},"
            f" {_shown('peak_force', found.peak_force)}, {_shown('work', found.work)}",
            f"{QUANTITIES['v_osc'].label}{first}: {found.v_osc:.4g} m/s (all modes);"
            f" largest velocity of the first mode alone: {first_mode:.3g} m/s",
            *(f"warning: {warning}" for warning in found.warnings),
        ]

    def intervals(self, *, level: str = "auto") -> "Predicted | None":
        """Return the press with the intervals that a photographed outline causes; None without one.

        Args:
            level: Of the plectra, as in the prediction.

        Raises:
            AnalysisError: Less than nine of ten outlines of the ensemble have a pluck.
        """
        from sautereau.analysis.results.predicted import of_outline

        return of_outline(self.rig, level)

    def to_frame(self) -> "pd.DataFrame":
        """Return the motion and the forces over the time in s after the jack leaves rest."""
        import pandas as pd

        columns = {name: getattr(self.press, name) for name in COLUMNS}
        frame = pd.DataFrame(columns, pd.Index(self.press.time, name="time"))
        frame.attrs = {"units": {"time": "s", **COLUMNS}, "level": self.press.level}
        return frame

    def plot(self) -> "Figure":
        """Return a figure of the pluck by every plectrum model."""
        from sautereau.analysis.figures.pluck import pluck_figure
        from sautereau.analysis.model.plectrum.levels import AUTO, LEVELS

        return shown(pluck_figure(self.rig, [n for n in LEVELS.names() if n != AUTO]))


def _shown(name: str, value: float) -> str:
    """Return a quantity with its label, in the unit of texts."""
    quantity = QUANTITIES[name]
    scale, unit = quantity.displayed
    return f"{quantity.label} {value * scale:.4g} {unit}"
