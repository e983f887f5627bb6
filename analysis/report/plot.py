"""A plot of the report, as plotly.js draws it.

Plotly's Python objects are not used: to load them and to check every trace took 0.5 s of a page.
"""

import base64
import json
from collections.abc import Sequence
from typing import Any

import numpy as np

TEMPLATE = {"data": {"scatter": [{"type": "scatter"}]}}
"""Without a template, plotly.js uses its own style."""


class Plot:
    """Rows of plots, one above another, over one horizontal axis."""

    def __init__(self, titles: Sequence[str], below: str, height: int, spacing: float = 0.0):
        """Draw nothing yet.

        Args:
            titles: Of the vertical axes, from the top.
            below: Title of the horizontal axis, under the lowest row.
            height: px, of all rows.
            spacing: Between two rows, dimensionless, fraction of the height.
        """
        self._traces: list[dict[str, Any]] = []
        self._layout: dict[str, Any] = {
            "template": TEMPLATE,
            "shapes": [],
            "annotations": [],
            "height": height,
            "margin": {"l": 70, "r": 20, "t": 30, "b": 50},
            "paper_bgcolor": "rgba(0,0,0,0)",
            "plot_bgcolor": "rgba(0,0,0,0)",
            "hovermode": "closest",
            "dragmode": "zoom",
            "legend": {"orientation": "h", "y": 1.08},
        }
        self._axes = [_axis(row) for row in range(len(titles))]
        each = (1 - spacing * (len(titles) - 1)) / len(titles)
        for row, (axis, title) in enumerate(zip(self._axes, titles, strict=True), 1):
            bottom = (len(titles) - row) * (each + spacing)
            lowest = row == len(titles)
            above = {"matches": f"x{self._axes[-1]}", "showticklabels": False}
            labelled = {"title": {"text": below}} if lowest else above
            self._layout[f"xaxis{axis}"] = {"anchor": f"y{axis}", **labelled}
            self._layout[f"yaxis{axis}"] = {
                "anchor": f"x{axis}", "domain": [bottom, bottom + each], "title": {"text": title},
            }  # fmt: skip

    def add(self, x: Sequence[Any] | np.ndarray, y: Any, row: int = 0, **trace: Any) -> None:
        """Draw a trace of plotly in a row, counted from 0 at the top."""
        axes = {"xaxis": f"x{self._axes[row]}", "yaxis": f"y{self._axes[row]}"}
        self._traces.append({"type": "scatter", "x": _packed(x), "y": _packed(y), **axes, **trace})

    def shade(self, start: float, stop: float, colour: str, name: str) -> None:
        """Shade a part of the horizontal axis in all rows, with its name above them."""
        self._layout["shapes"] += [
            {
                "type": "rect", "layer": "below", "fillcolor": colour, "line": {"width": 0},
                "xref": f"x{axis}", "x0": start, "x1": stop,
                "yref": f"y{axis} domain", "y0": 0, "y1": 1,
            }
            for axis in self._axes
        ]  # fmt: skip
        self._layout["annotations"].append({
            "text": name, "showarrow": False, "xref": "x", "x": (start + stop) / 2,
            "yref": "y domain", "y": 1.0, "yanchor": "bottom",
        })  # fmt: skip

    def set_x(self, **settings: Any) -> None:
        """Set the same of the horizontal axis of every row."""
        for axis in self._axes:
            self._layout[f"xaxis{axis}"] |= settings

    def to_json(self) -> str:
        """Return the plot as JSON."""
        drawn = {"data": self._traces, "layout": self._layout}
        return json.dumps(drawn, separators=(",", ":"), allow_nan=False)


def _axis(row: int) -> str:
    """Return the end of the names of a row's axes."""
    return str(row + 1) if row else ""


def _packed(values: Sequence[Any] | np.ndarray) -> Any:
    """Return an array of floats as plotly.js reads their bytes, and other values as they are."""
    if not isinstance(values, np.ndarray):
        return values
    kind = values.dtype.newbyteorder("<")
    data = base64.b64encode(values.astype(kind).tobytes()).decode()
    return {"dtype": kind.str[1:], "bdata": data}
