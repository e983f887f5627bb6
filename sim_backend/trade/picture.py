"""A trade drawn: the work that precision costs."""

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sautereau.sim_backend.trade.points import Point, Trade

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEAST = 1e-10
"""s, error at which a point without one is drawn, for the axis is logarithmic."""


def plot_trade(trade: Trade, path: str | Path, peers: Sequence[Point] = ()) -> None:
    """Draw `trade_figure` into a file.

    Args:
        trade: What was measured.
        path: Where the picture goes; its suffix chooses the format.
        peers: Points of other engines, measured on the same scene and machine.
    """
    trade_figure(trade, peers).savefig(path, dpi=120)


def trade_figure(trade: Trade, peers: Sequence[Point] = ()) -> "Figure":
    """Return a figure of the error of events over the real-time factor, both logarithmic.

    One line is one way to simulate the scene with steps of several lengths; the grey line
    joins the points that no other beats. Points that failed are not drawn.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 6), layout="constrained")
    axes = figure.add_subplot()
    lines: dict[str, list[Point]] = defaultdict(list)
    for point in [*trade.points, *peers]:
        if not point.failed:
            lines[f"{point.engine}, {point.level}, {point.string}"].append(point)
    speeds, errors = _ends([point for points in lines.values() for point in points])
    axes.set(
        xscale="log",
        yscale="log",
        xlim=_around(speeds or [1.0]),
        ylim=_around([*errors, trade.wanted]),
        xlabel="simulated over real time (1)",
        ylabel="largest error of an event (s)",
        title=f"{trade.scene or 'scene'}\n{trade.machine}",
    )
    best = [trade.points[i] for i in trade.pareto]
    axes.plot(*_ends(best), color="0.8", linewidth=6, label="not beaten", zorder=1)
    for name, points in lines.items():
        axes.plot(*_ends(points), "o", markersize=5, label=name, zorder=2)
    if trade.recommended is not None:
        chosen = trade.points[trade.recommended]
        axes.plot(*_ends([chosen]), "o", markersize=14, fillstyle="none", color="black", zorder=3)
        axes.annotate(
            f"recommended: {chosen.engine}, {chosen.dt * 1e6:.4g} us",
            (chosen.real_time_factor or 1.0, max(chosen.error or 0.0, LEAST)),
            xytext=(0, 14),
            textcoords="offset points",
            ha="center",
        )
    axes.axhline(trade.wanted, color="0.5", linestyle=":", label="wanted")
    axes.grid(visible=True, which="both", alpha=0.2)
    axes.legend()
    return figure


def _ends(points: Sequence[Point]) -> tuple[list[float], list[float]]:
    return (
        [point.real_time_factor or 1.0 for point in points],
        [max(point.error or 0.0, LEAST) for point in points],
    )


def _around(values: Sequence[float]) -> tuple[float, float]:
    return min(values) / 3, 3 * max(values)
