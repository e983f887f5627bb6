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
POWERS = {"exponentformat": "power"}
"""Labels of ticks have powers of ten, and not prefixes without a unit, such as `50µ`."""
TOP = 30  # px above the highest row: a line of text, which is its title
BOTTOM = 50  # px below the lowest row: labels of ticks, and the title of the horizontal axis


class Plot:
    """Rows of plots, one above another, over one horizontal axis."""

    def __init__(self, titles: Sequence[str], below: str, height: int):
        """Draw nothing yet.

        Args:
            titles: Of the vertical axes, from the top. They are above the rows, since plotly.js
                moves no title beside an axis when a zoom makes the labels of ticks longer.
            below: Title of the horizontal axis, under the lowest row.
            height: px, of all rows.
        """
        self._traces: list[dict[str, Any]] = []
        self._layout: dict[str, Any] = {
            "template": TEMPLATE,
            "shapes": [],
            "annotations": [],
            "height": height,
            "margin": {"l": 50, "r": 20, "t": TOP, "b": BOTTOM},
            "paper_bgcolor": "rgba(0,0,0,0)",
            "plot_bgcolor": "rgba(0,0,0,0)",
            "hovermode": "closest",
            "dragmode": "zoom",
            "legend": {
                "orientation": "h",
                "x": 0,
                "y": 1 + TOP / (height - TOP - BOTTOM),
                "yanchor": "bottom",
            },
        }
        self._axes = [_axis(row) for row in range(len(titles))]
        spacing = TOP / (height - TOP - BOTTOM)
        each = (1 - spacing * (len(titles) - 1)) / len(titles)
        for row, (axis, title) in enumerate(zip(self._axes, titles, strict=True), 1):
            bottom = (len(titles) - row) * (each + spacing)
            lowest = row == len(titles)
            above = {"matches": f"x{self._axes[-1]}", "showticklabels": False}
            labelled = {"title": {"text": below}, "automargin": True} if lowest else above
            self._layout[f"xaxis{axis}"] = {"anchor": f"y{axis}", **POWERS, **labelled}
            self._layout[f"yaxis{axis}"] = {
                "anchor": f"x{axis}", "domain": [bottom, bottom + each], "automargin": True,
                **POWERS,
            }  # fmt: skip
            self._layout["annotations"].append({
                "text": title, "font": {"size": 14}, "showarrow": False, "xref": "paper", "x": 0,
                "xanchor": "left", "yref": f"y{axis} domain", "y": 1, "yanchor": "bottom",
            })  # fmt: skip

    def add(self, x: Sequence[Any] | np.ndarray, y: Any, row: int = 0, **trace: Any) -> None:
        """Draw a trace of plotly in a row, counted from 0 at the top."""
        axes = {"xaxis": f"x{self._axes[row]}", "yaxis": f"y{self._axes[row]}"}
        self._traces.append({"type": "scatter", "x": _packed(x), "y": _packed(y), **axes, **trace})

    def shade(self, start: float, stop: float, colour: str, name: str) -> None:
        """Shade a part of the horizontal axis in all rows, with its name in the legend once."""
        new = all(shape["name"] != name for shape in self._layout["shapes"])
        self._layout["shapes"] += [
            {
                "type": "rect", "layer": "below", "fillcolor": colour, "line": {"width": 0},
                "xref": f"x{axis}", "x0": start, "x1": stop,
                "yref": f"y{axis} domain", "y0": 0, "y1": 1,
                "name": name, "legendgroup": name, "showlegend": new and axis == self._axes[0],
            }
            for axis in self._axes
        ]  # fmt: skip

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
