"""The press that the model predicts."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sautereau.analysis.model import predict as model
from sautereau.analysis.summary.prediction import prediction_lines, prediction_summary
from sautereau.entrance.shown import Shown, shown
from sautereau.rig.schema import Rig

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

COLUMNS = {"rise": "m", "deflection": "m", "finger_force": "N", "string_force": "N"}
"""Columns of the table and their units."""


@dataclass(frozen=True, repr=False)
class Prediction(Shown):
    """The model's press of a rig; `press` has all its arrays."""

    rig: Rig
    press: model.Prediction

    def __repr__(self) -> str:
        return (
            f"<Prediction for rig {self.rig.name}: pluck of"
            f" {self.press.pluck_duration * 1e3:.4g} ms, force at release"
            f" {self.press.release_force:.4g} N>"
        )

    def __str__(self) -> str:
        return "\n".join(prediction_lines(self.rig, self.press))

    @property
    def scalars(self) -> dict[str, Any]:
        """Durations, forces and speeds of the press, SI, by the names of the glossary."""
        return prediction_summary(self.rig, self.press)

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
        from sautereau.analysis.model.plectrum.levels import LEVELS

        return shown(pluck_figure(self.rig, LEVELS.names()))
