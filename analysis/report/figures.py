"""The report's plots, drawn by plotly, with their captions and zoom buttons.

Plotly interprets texts as markup, so no text of a recording may appear in a plot.
"""

import base64
import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from sautereau.analysis.figures.palette import SERIES
from sautereau.analysis.phases import HeldString
from sautereau.analysis.phases.found import pluck_names, stretches
from sautereau.analysis.report.contents import (
    BESIDE,
    COLUMNS,
    Contents,
    PressRecord,
    Trace,
)
from sautereau.analysis.report.tables import Course
from sautereau.rig.quantities import QUANTITIES

TEMPLATE = {"data": {"scatter": [{"type": "scatter"}]}}  # Else plotly.js uses its own style
POWERS = {"exponentformat": "power"}  # In labels of ticks, not prefixes without a unit: `50µ`
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
        self._axes = ["", *map(str, range(2, len(titles) + 1))]  # Ends of the axes' names
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


def _packed(values: Sequence[Any] | np.ndarray) -> Any:
    """Return an array of floats as plotly.js reads their bytes, and other values as they are."""
    if not isinstance(values, np.ndarray):
        return values
    kind = values.dtype.newbyteorder("<")
    data = base64.b64encode(values.astype(kind).tobytes()).decode()
    return {"dtype": kind.str[1:], "bdata": data}


COLOURS = SERIES  # Colours of the conditions; if there is only one condition, of its presses
DASHES = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot")
"""Dashes of presses with the same colour."""
MODEL = "#5a6969"
SHADES = {
    "free": "rgba(120,120,120,0.08)",
    "string held": "rgba(230,159,0,0.22)",
    "string released": "rgba(86,180,233,0.18)",
}  # Colours of the phases by their names
SEVERAL = "rgba(213,94,0,0.34)"  # That of a phase in which several strings are held


def over_time(contents: Contents) -> Plot:
    """Draw deflection, speed and force of all presses over the time after the trigger."""
    titles = [QUANTITIES[column].title for column in COLUMNS]
    plot = Plot(titles, "time after the trigger (ms)", 240 * len(COLUMNS))  # px, of one row
    for index, condition in enumerate(contents.conditions):
        first = True
        for record in condition.presses:
            for row, (column, trace) in enumerate(record.traces.items()):
                plot.add(
                    **_press_line(contents, index, record, trace, QUANTITIES[column].displayed[0]),
                    showlegend=first and len(contents.conditions) > 1,
                    hovertemplate=_hover(record, "%{x:.3f} ms, %{y:.4g}"),
                    row=row,
                )
                first = False
            _mark_plucks(plot, record, _colour(contents, index, record))
    if len(contents.conditions) == 1:
        # The phases between the mean contacts and releases of each string in all presses.
        held = [_mean_times(p) for p in _plucks_by_string(contents.presses).values()]
        last = max(record.phases.bottom for record in contents.presses)
        for start, stop, name in stretches(held, 0.0, last) if held else ():
            plot.shade(start * 1e3, stop * 1e3, SHADES.get(name, SEVERAL), name)
    end = max(record.phases.bottom for record in contents.presses) * 1e3
    if end > 0:
        plot.set_x(range=[0, end])
    return plot


def force_on_deflection(contents: Contents) -> Plot:
    """Draw force over deflection from contact, of the presses and of the model."""
    strings = {each.comparison.string for each in contents.conditions if each.comparison}
    several = any(each.rig.more_choirs for each in contents.conditions)
    which = f" with string {' or '.join(map(str, sorted(strings)))}" if strings and several else ""
    plot = Plot([QUANTITIES["force"].title], f"key deflection from contact{which} (mm)", 420)
    for index, condition in enumerate(contents.conditions):
        first, string = True, condition.comparison.string if condition.comparison else 1
        for record in condition.presses:
            if string not in record.held:
                continue
            plot.add(
                **_press_line(contents, index, record, record.held[string], 1.0),
                showlegend=first,
                hovertemplate=_hover(record, "%{x:.4f} mm, %{y:.4g} N"),
            )
            first = False
        if condition.prediction is not None:
            plot.add(
                **_line(Trace(*condition.prediction.from_contact(BESIDE, string)), 1e3, 1.0),
                line={"color": MODEL, "width": 4, "dash": "dash"},
                name=f"model, condition {index + 1}" if len(contents.conditions) > 1 else "model",
                legendgroup=f"model {index}",
                hovertemplate="model: %{x:.4f} mm, %{y:.4g} N<extra></extra>",
            )
    return plot


def over_session(contents: Contents, columns: Sequence[Course]) -> Plot:
    """Draw a few features from press to press, with their standard uncertainties."""
    plot = Plot([column.title for column in columns], "press", 190 * len(columns))
    numbers = [record.number for record in contents.presses]
    for row, column in enumerate(columns):
        plot.add(
            x=numbers,
            y=column.values,
            error_y={"array": column.stds, "thickness": 1, "width": 3},
            mode="markers",
            marker={"color": COLOURS[0], "size": 7},
            showlegend=False,
            hovertemplate="press %{x}: %{y:.6g} ± %{error_y.array:.2g}<extra></extra>",
            row=row,
        )
    plot.set_x(tick0=numbers[0], dtick=-(-len(numbers) // 10))  # integers
    return plot


def _hover(record: PressRecord, text: str) -> str:
    return f"press {record.number}: {text}<extra></extra>"


def _press_line(
    contents: Contents, index: int, record: PressRecord, trace: Trace, y_scale: float
) -> dict[str, Any]:
    """Return the line of one press."""
    place = (record.number - 1) // (len(COLOURS) if len(contents.conditions) == 1 else 1)
    dash = DASHES[place % len(DASHES)]
    return {
        **_line(trace, 1e3, y_scale),
        "line": {"color": _colour(contents, index, record), "width": 1, "dash": dash},
        "opacity": 0.6,
        "meta": record.number,
        "name": f"condition {index + 1}" if len(contents.conditions) > 1 else "presses",
        "legendgroup": str(index),
    }


def _colour(contents: Contents, index: int, record: PressRecord) -> str:
    """Return the colour of a press: that of its condition, its own where there is one."""
    place = record.number - 1 if len(contents.conditions) == 1 else index
    return COLOURS[place % len(COLOURS)]


def _line(trace: Trace, x_scale: float, y_scale: float) -> dict[str, Any]:
    return {
        "x": (trace.x * x_scale).astype(np.float32),
        "y": (trace.y * y_scale).astype(np.float32),
        "mode": "lines",
    }


def _mark_plucks(plot: Plot, record: PressRecord, colour: str) -> None:
    """Mark contacts and releases of a press on its force."""
    if "force" not in record.traces or not record.phases.plucks:
        return
    force, plucks = record.traces["force"], record.phases.plucks
    several = len(plucks) > 1 or record.press.rig.more_choirs
    names = [f", {name}" if several else "" for name in pluck_names(plucks)]
    times = [time for held in plucks for time in (held.contact, held.release)]
    plot.add(
        x=[time * 1e3 for time in times],
        y=np.interp(times, force.x, force.y),
        mode="markers",
        marker={"color": colour, "size": 7, "symbol": ["circle-open", "x-thin-open"] * len(plucks)},
        text=[what + name for name in names for what in ("contact", "release")],
        opacity=0.6,
        meta=record.number,
        showlegend=False,
        hovertemplate=_hover(record, "%{text} at %{x:.3f} ms"),
        row=COLUMNS.index("force"),
    )


def _plucks_by_string(presses: Sequence[PressRecord]) -> dict[int, list[HeldString]]:
    """Return the plucks of all presses by the number of their string; 0 for an unknown one."""
    found: dict[int, list[HeldString]] = {}
    for record in presses:
        for held in record.phases.plucks:
            found.setdefault(held.string or 0, []).append(held)
    return dict(sorted(found.items()))


def _mean_times(held: Sequence[HeldString]) -> tuple[float, float]:
    """Return mean contact and mean release, s after the trigger."""
    return float(np.mean([h.contact for h in held])), float(np.mean([h.release for h in held]))


def zooms(contents: Contents) -> list[tuple[str, str]]:
    """Return text and range (start and end in ms, as JSON) of the plot over time's buttons.

    The first one is its initial range; the template adds those that do not depend on the presses.
    """
    held = [pluck for record in contents.presses for pluck in record.phases.plucks]
    bottom = max(record.phases.bottom for record in contents.presses)
    found = [("Key going down", 0.0, bottom)] if bottom > 0 else []
    if held:
        contacts, releases = [pluck.contact for pluck in held], [pluck.release for pluck in held]
        contact, release = (min(contacts), max(contacts)), (min(releases), max(releases))
        margin = 0.2 * (release[1] - contact[0])
        found += [
            ("String held", contact[0] - margin, release[1] + margin),
            ("Contact", contact[0] - 2e-3, contact[1] + 2e-3),
            ("Release", release[0] - 1e-3, release[1] + 1e-3),
        ]
    return [(text, json.dumps([start * 1e3, stop * 1e3])) for text, start, stop in found]


def about_time(contents: Contents) -> str:
    """Return the caption of the plot over time, which also serves as its text alternative."""
    presses = contents.presses
    drawn = sum(bool(record.traces) for record in presses)
    plucks = _plucks_by_string(presses)
    held = sum(bool(record.phases.plucks) for record in presses)
    text = (
        f"Key deflection at the laser, jack speed and finger force of {drawn} of {len(presses)}"
        " presses over the time after the trigger."
    )
    text += f" {held} of the presses have a pluck;" if held else ""
    several = len(plucks) > 1 or any(record.press.rig.more_choirs for record in presses)
    for string, own in plucks.items():
        contact, release = _mean_times(own)
        name = f" string {string}:" if string else " unknown string:"
        text += (
            f"{name if several else ''} mean contact at {contact * 1e3:.3f} ms (open circles),"
            f" mean release at {release * 1e3:.3f} ms (crosses)."
        )
    if len(contents.conditions) == 1 and held:
        text += " The shading separates the phases at these means"
        text += ", darker where several strings are held." if several else "."
    return (
        f"{text} Each trace is decimated to at most {contents.points + 2} samples, the minimum and"
        " the maximum of equal intervals, so that all peaks are kept. The features were computed"
        f" from all samples, {contents.rate:g} per second."
    )


def about_force(contents: Contents) -> str:
    """Return the caption of the plot of force over deflection."""
    drawn = sum(bool(record.held) for record in contents.presses)
    models = sum(condition.prediction is not None for condition in contents.conditions)
    return (
        f"Finger force over the key deflection at the laser from contact, of {drawn} presses"
        f"{' and of the model (dashed)' if models else ''}; traces are decimated as above."
    )
