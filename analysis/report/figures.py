"""The report's pictures, as plotly draws them.

They hold numbers and our own words only: plotly reads its texts as markup, so nothing that
stands in a recording may go in.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from sautereau.analysis.report.contents import BESIDE, Condition, Contents, PressRecord, Trace

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

COLOURS = ("#3b82c4", "#d97706", "#2f9e69", "#b0599b", "#c2410c", "#0e9aa7", "#8a7a1f", "#71717a")
"""Of the conditions: told apart on light and on dark, and by most who see colours otherwise."""
MODEL = "#e11d48"
SHADES = ("rgba(120,120,120,0.06)", "rgba(59,130,196,0.14)", "rgba(120,120,120,0.06)")
"""Of the three phases."""
ROWS = (
    ("deflection", 1e3, "deflection (mm)"),
    ("jack_speed", 1.0, "jack speed (m/s)"),
    ("force", 1.0, "finger force (N)"),
)
"""Columns over time, their scale, and what stands at the axis."""
HEIGHT = 240
"""px, of one row."""


def over_time(contents: Contents) -> "Figure":
    """Draw every press over the others: deflection, speed and force from the trigger on."""
    from plotly.subplots import make_subplots

    figure = make_subplots(len(ROWS), 1, shared_xaxes=True, vertical_spacing=0.03)
    for index, condition in enumerate(contents.conditions):
        colour = COLOURS[index % len(COLOURS)]
        first = True
        for record in condition.presses:
            for row, (column, scale, _) in enumerate(ROWS, 1):
                if column not in record.traces:
                    continue
                trace = record.traces[column]
                figure.add_scatter(
                    **_line(trace, 1e3, scale),
                    line={"color": colour, "width": 1},
                    opacity=0.6,
                    meta=record.number,
                    name=_condition_name(index),
                    legendgroup=str(index),
                    showlegend=first and len(contents.conditions) > 1,
                    hovertemplate=_hover(record, "%{x:.3f} ms, %{y:.4g}"),
                    row=row,
                    col=1,
                )
                first = False
            _mark_plucks(figure, record, colour)
    if len(contents.conditions) == 1:
        _shade(figure, contents.conditions[0])
    for row, (_, _, label) in enumerate(ROWS, 1):
        figure.update_yaxes(title_text=label, row=row, col=1)
    end = max(record.phases.bottom for record in contents.presses) * 1e3
    figure.update_xaxes(title_text="time from the trigger (ms)", row=len(ROWS), col=1)
    if end > 0:
        figure.update_xaxes(range=[0, end])
    return _finished(figure, HEIGHT * len(ROWS))


def force_on_deflection(contents: Contents) -> "Figure":
    """Draw force on deflection from contact on, with what the model says."""
    from plotly.graph_objects import Figure

    figure = Figure()
    for index, condition in enumerate(contents.conditions):
        colour = COLOURS[index % len(COLOURS)]
        first = True
        for record in condition.presses:
            if record.held is None:
                continue
            figure.add_scatter(
                **_line(record.held, 1e3, 1.0),
                line={"color": colour, "width": 1},
                opacity=0.6,
                meta=record.number,
                name=_condition_name(index) if len(contents.conditions) > 1 else "presses",
                legendgroup=str(index),
                showlegend=first,
                hovertemplate=_hover(record, "%{x:.4f} mm, %{y:.4g} N"),
            )
            first = False
        if condition.prediction is not None:
            figure.add_scatter(
                **_line(Trace(*condition.prediction.from_contact(BESIDE)), 1e3, 1.0),
                line={"color": MODEL, "width": 2, "dash": "dash"},
                name=f"model{_of_condition(contents, index)}",
                legendgroup=f"model {index}",
                hovertemplate="model: %{x:.4f} mm, %{y:.4g} N<extra></extra>",
            )
    figure.update_xaxes(title_text="deflection under the laser from contact (mm)")
    figure.update_yaxes(title_text="finger force (N)")
    return _finished(figure, 420)


def over_session(contents: Contents, columns: Sequence[tuple[str, list[Any]]]) -> "Figure":
    """Draw how a few features go from press to press.

    Args:
        contents: The presses.
        columns: What stands at each axis, and a value or None of every press.
    """
    from plotly.subplots import make_subplots

    figure = make_subplots(1, len(columns), horizontal_spacing=0.08)
    numbers = [record.number for record in contents.presses]
    for col, (label, values) in enumerate(columns, 1):
        figure.add_scatter(
            x=numbers,
            y=values,
            mode="markers",
            marker={"color": COLOURS[0], "size": 7},
            showlegend=False,
            hovertemplate="press %{x}: %{y:.6g}<extra></extra>",
            row=1,
            col=col,
        )
        figure.update_yaxes(title_text=label, row=1, col=col)
        figure.update_xaxes(title_text="press", row=1, col=col)
    return _finished(figure, 280)


def _hover(record: PressRecord, told: str) -> str:
    return f"press {record.number}: {told}<extra></extra>"


def _line(trace: Trace, x_scale: float, y_scale: float) -> dict[str, Any]:
    return {
        "x": (trace.x * x_scale).astype(np.float32),
        "y": (trace.y * y_scale).astype(np.float32),
        "mode": "lines",
    }


def _mark_plucks(figure: "Figure", record: PressRecord, colour: str) -> None:
    """Mark where a press met and let go its strings, on its force."""
    if "force" not in record.traces or not record.phases.plucks:
        return
    force = record.traces["force"]
    plucks = record.phases.plucks
    times = [time for held in plucks for time in (held.contact, held.release)]
    figure.add_scatter(
        x=[time * 1e3 for time in times],
        y=np.interp(times, force.x, force.y),
        mode="markers",
        marker={
            "color": colour,
            "size": 7,
            "symbol": ["circle-open", "x-thin-open"] * len(plucks),
        },
        text=["contact", "release"] * len(plucks),
        opacity=0.6,
        meta=record.number,
        showlegend=False,
        hovertemplate=_hover(record, "%{text} at %{x:.3f} ms"),
        row=len(ROWS),
        col=1,
    )


def _shade(figure: "Figure", condition: Condition) -> None:
    """Shade the three phases, parted where they are on the mean of all presses."""
    held = [r.phases.plucks[0] for r in condition.presses if r.phases.plucks]
    if not held:
        return
    contact, release = (
        float(np.mean([getattr(p, n) for p in held])) for n in ("contact", "release")
    )
    end = max(record.phases.bottom for record in condition.presses)
    edges = [0.0, contact, release, end]
    for start, stop, colour in zip(edges[:-1], edges[1:], SHADES, strict=True):
        figure.add_vrect(
            x0=start * 1e3, x1=stop * 1e3, fillcolor=colour, line_width=0, layer="below"
        )
    names = ("free", "string held", "string released")
    for start, stop, name in zip(edges[:-1], edges[1:], names, strict=True):
        figure.add_annotation(
            x=(start + stop) / 2 * 1e3, y=1.0, yref="y domain", yanchor="bottom", text=name,
            showarrow=False, row=1, col=1,
        )  # fmt: skip


def _condition_name(index: int) -> str:
    return f"condition {index + 1}"


def _of_condition(contents: Contents, index: int) -> str:
    return f", {_condition_name(index)}" if len(contents.conditions) > 1 else ""


def _finished(figure: "Figure", height: int) -> "Figure":
    figure.update_layout(
        template="none",
        height=height,
        margin={"l": 70, "r": 20, "t": 30, "b": 50},
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
        hovermode="closest",
        dragmode="zoom",
        legend={"orientation": "h", "y": 1.08},
    )
    return figure
