"""Predictions over a grid of values of the rig."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from sautereau.analysis.figures.palette import DASHES, SERIES
from sautereau.analysis.model.batch import DERIVED, PredictionBatch, predict_many
from sautereau.analysis.model.pluck.paths import Status
from sautereau.analysis.results.result import Shown, drawing, shown
from sautereau.rig.document import full_key
from sautereau.rig.errors import RigError, require
from sautereau.rig.faults import unit_of
from sautereau.rig.quantities import DISPLAYED, QUANTITIES
from sautereau.rig.schema import Rig
from sautereau.rig.units import parse_quantity, readable_quantity
from sautereau.trajectory.motion import Floats

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

SHOWN = ("pluck_duration", "peak_force", "v_osc")  # Quantities of the figure


@dataclass(frozen=True, repr=False)
class Sweep(Shown):
    """The model's scalars over a grid of values."""

    rig: Rig
    values: Mapping[str, Floats]
    """SI, by dotted key, each of shape (its number of values,)."""
    batch: PredictionBatch
    """Arrays of the grid's shape, the values in their order."""

    def __repr__(self) -> str:
        sizes = ", ".join(f"{key} ({len(values)})" for key, values in self.values.items())
        return f"<Sweep of rig {self.rig.name} over {sizes}>"

    def to_frame(self) -> "pd.DataFrame":
        """Return one row for each point of the grid; NaN where the model has no pluck."""
        import pandas as pd

        index = pd.MultiIndex.from_product([*self.values.values()], names=list(self.values))
        columns = {f.name: getattr(self.batch, f.name).ravel() for f in fields(self.batch)}
        columns["status"] = [Status(value).name for value in columns["status"]]
        frame = pd.DataFrame(columns, index)
        units = {name: QUANTITIES[name].unit for name in columns if name in QUANTITIES}
        units |= {key: _unit(key) for key in self.values}
        frame.attrs = {"units": units}
        return frame

    def to_xarray(self) -> Any:
        """Return an xarray Dataset with one dimension for each value.

        Raises:
            MissingExtraError: xarray is not installed.
        """
        require("xarray", "to_xarray", "xarray")
        import xarray as xr  # pyright: ignore[reportMissingImports]

        data = xr.Dataset.from_dataframe(self.to_frame())
        for name, unit in self.to_frame().attrs["units"].items():
            data[name].attrs["units"] = unit
        return data

    def plot(self) -> "Figure":
        """Return a figure over the first value, with a line for each of the others."""
        figure = drawing(12, 4.5)
        (key, along), *others = self.values.items()
        texts = (
            [f"{key} {readable_quantity(value, _unit(key))}" for value in values.tolist()]
            for key, values in others
        )
        labels = [", ".join(own) for own in product(*texts)]
        factor, name_of_unit = DISPLAYED.get(unit := _unit(key), (1.0, unit))
        panels = figure.subplots(1, len(SHOWN))
        for axes, name in zip(panels, SHOWN, strict=True):
            scale, _ = QUANTITIES[name].displayed
            over = getattr(self.batch, name).reshape(len(along), -1) * scale
            for line, (values, label) in enumerate(zip(over.T, labels, strict=True)):
                style = {"color": SERIES[line % len(SERIES)], "ls": DASHES[line % len(DASHES)]}
                axes.plot(along * factor, values, label=label, **style)
            axes.set(xlabel=f"{key} ({name_of_unit})", ylabel=QUANTITIES[name].title)
            axes.grid(alpha=0.3)
        # The legend has room for 24 lines.
        if 1 < len(labels) <= 24:
            handles, _ = panels[0].get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=9)
        figure.suptitle(repr(self).strip("<>"))
        return shown(figure)


def sweep(rig: Rig, values: Mapping[str, Any]) -> Sweep:
    """Predict the presses of a grid of values; see `Rig.sweep`."""
    if not values:
        raise RigError('sweep: no value varies; give one, such as overlap=["0.2 mm", "0.3 mm"]')
    known = {full_key(name) if name not in DERIVED else name: v for name, v in values.items()}
    axes = {key: _axis(rig, key, value) for key, value in known.items()}
    grid = dict(zip(axes, np.meshgrid(*axes.values(), indexing="ij"), strict=True))
    return Sweep(rig, axes, predict_many(rig, grid))


def _unit(key: str) -> str:
    return unit_of(Rig, key.split(".")) or ""


def _axis(rig: Rig, key: str, value: Any) -> Floats:
    """Return the values of one key [SI], shape (values,)."""
    if value is ...:
        if key not in rig.assumed:
            raise RigError(f"sweep: {key} has no assumed range in the rig; give its values")
        return np.linspace(*rig.assumed[key], 25)
    unit = _unit(key) or "1"
    several = value if np.ndim(value) else [value]
    try:
        found = [parse_quantity(v, unit) if isinstance(v, str) else float(v) for v in several]
        return np.array(found)
    except (TypeError, ValueError) as error:
        raise RigError(f"sweep: {key}: {error}; give quantities in {unit}") from error
