"""The result of a work-precision study: its points, as JSON, as text and as a plot."""

import math
import statistics
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from matplotlib.figure import Figure

from sautereau.analysis.figures.palette import MARKERS, SERIES
from sautereau.analysis.text import counted, table
from sautereau.sim_backend.parts import Accuracy

HEADS = (
    ("", "", "", "", "step", "error", "force", "build", "run", "spread", "x real"),
    ("", "engine", "plectrum", "string", "(us)",
     "(us)", "error (%)", "(ms)", "(ms)", "(%)", "time"),
)  # fmt: skip
"""Heads of the table of points: its first column marks the Pareto-optimal ones."""
MARGIN = 0.1  # Fraction of a speed below which measured speeds count as equal
LEAST = 1e-10  # s, error at which a point without one is drawn, for the axis is logarithmic


@dataclass(frozen=True)
class Point:
    """A scene simulated one way: its error and its speed."""

    scene: str
    """Description of the scene."""
    dt: float
    """s, of a step."""
    engine: str
    level: str
    """Plectrum bending model."""
    string: str
    error: float | None = None
    """s, largest of all events; None where the point failed."""
    force_error: float | None = None
    """Dimensionless, of the largest force; None where the point failed."""
    real_time_factor: float | None = None
    """Dimensionless, simulated over real time, to build and to run; None where it failed."""
    failed: str = ""
    """Reason of the failure: events missing or additional, or the engine's error."""
    build_time: float | None = None
    """s, to build the world, the median of repeats; None where it failed."""
    run_time: float | None = None
    """s, to run the drive, the median of repeats; None where it failed."""
    spread: float | None = None
    """Dimensionless, interquartile range of the repeats' times over their median."""


@dataclass(frozen=True)
class Trade:
    """Errors and speeds of the ways to simulate a scene, on one machine."""

    scene: str
    """Description of the scene."""
    machine: str
    """On which they were measured."""
    truth: str
    """What the points are compared with."""
    requested: Accuracy
    """Largest error for which a point is recommended."""
    points: tuple[Point, ...]
    pareto: tuple[int, ...]
    """Indices of the Pareto-optimal points, the most accurate first."""
    recommended: int | None
    """Index of the point to use, see `recommended`; None if none is accurate enough."""
    compile_time: float = 0.0
    """s, by which the exact engine's first run took longer than later ones: it was compiled, or
    loaded from the cache of an earlier compilation."""
    same: int = 0
    """Number of steps that are omitted because the engine takes the same ones without them."""
    cached: bool = False
    """Whether it was measured before."""

    @property
    def busy(self) -> float | None:
        """Median of the points' spreads above which the machine is too busy; None below it."""
        spreads = [point.spread for point in self.points if point.spread is not None]
        found = statistics.median(spreads) if spreads else 0.0
        return found if found > 0.2 else None


def pareto_front(errors: Sequence[float], speeds: Sequence[float], margin: float = 0) -> list[int]:
    """Return the indices of the Pareto-optimal points, the most accurate first.

    Of equal points only the first is one.

    Args:
        errors: Finite, to be small.
        speeds: Positive and finite, to be large.
        margin: Fraction by which a less accurate point must be faster.
    """
    order = sorted(range(len(errors)), key=lambda i: (errors[i], -speeds[i], i))
    kept: list[int] = []
    for i in order:
        if not kept or speeds[i] > (1 + margin) * speeds[kept[-1]]:
            kept.append(i)
    return kept


def recommended(points: Sequence[Point], requested: Accuracy, margin: float = 0) -> int | None:
    """Return the index of the point to use for an error of at most the requested one.

    The most accurate one is, unless a less accurate one is faster by more than the margin. Simpler
    models than those of the scene must be twice as fast.

    Args:
        points: The first one has the models of the scene.
        requested: Of events or of forces.
        margin: Fraction of a speed below which measured speeds count as equal.
    """
    own: list[int] = []
    simpler: list[int] = []
    for i, point in enumerate(points):
        if _excess(point, requested) <= 1:
            same = (point.level, point.string) == (points[0].level, points[0].string)
            (own if same else simpler).append(i)
    best, other = (_fastest(points, some, requested, margin) for some in (own, simpler))
    if best is None or other is None:
        return other if best is None else best
    # Simpler models save no computing in the engine, but may in a modal string.
    return other if _speed(points[other]) > 2.0 * _speed(points[best]) else best


def _fastest(
    points: Sequence[Point], of: Sequence[int], requested: Accuracy, margin: float
) -> int | None:
    errors = [_excess(points[i], requested) for i in of]
    front = pareto_front(errors, [_speed(points[i]) for i in of], margin)
    return of[front[-1]] if front else None


def _excess(point: Point, requested: Accuracy) -> float:
    """Return the error of a point over the requested one; infinite where it failed."""
    if point.error is None or point.force_error is None:
        return math.inf
    return requested.excess(point.error, point.force_error)


def _speed(point: Point) -> float:
    return point.real_time_factor or 0.0


def trade_document(trade: Trade) -> dict[str, Any]:
    """Return the JSON object of a study; errors in s and dimensionless, null where one failed."""
    points = [
        asdict(point) | {"failed": bool(point.failed), "reason": point.failed or None}
        for point in trade.points
    ]
    return {
        "scene": trade.scene,
        "machine": trade.machine,
        "truth": trade.truth,
        "requested_error": trade.requested.time,
        "requested_force_error": trade.requested.force,
        "compile_time": trade.compile_time,
        "points": points,
        "pareto": [points[i] for i in trade.pareto],
        "recommended": None if trade.recommended is None else points[trade.recommended],
    }


def trade_text(trade: Trade) -> list[str]:
    """Return the lines of a study: points, Pareto-optimal ones marked, and a recommendation."""
    lines = [f"{trade.scene or 'scene'}: error against {trade.truth}"]
    ranks = [(p.error is None, p.error or 0.0, -_speed(p)) for p in trade.points]
    order = sorted(range(len(ranks)), key=ranks.__getitem__)
    marks = dict.fromkeys(trade.pareto, "*") | {trade.recommended: ">"}
    rows = [(marks.get(i, ""), *_cells(trade.points[i])) for i in order]
    lines += table([*HEADS, *rows], left=range(4), gap=1)
    lines += [
        f"{p.engine}, {p.level}, {p.string}, {p.dt * 1e6:.4g} us: failed: {p.failed}"
        for p in (trade.points[i] for i in order)
        if p.failed
    ]
    lines.append(
        "* Pareto-optimal: no other is both faster and more accurate; speeds that differ by less"
        f" than {100 * MARGIN:.0f} % count as equal"
    )
    if trade.same:
        lines.append(
            f"{counted(trade.same, 'step')} omitted: the engine divides them itself, and takes the"
            " same steps as with the one shown"
        )
    if trade.recommended is None:
        lines.append(f"none is accurate to {trade.requested}: use the first of the table")
    else:
        lines.append(
            f"> recommended for {trade.requested}: the most accurate, unless another is clearly"
            " faster; in the scene file:"
        )
        lines += _settings(trade.points[trade.recommended])
    if trade.compile_time > 0.5:  # s
        lines.append(
            f"the exact engine's first run took {trade.compile_time:.2g} s longer: it was compiled,"
            " once on this machine"
        )
    if trade.busy is not None:
        lines.append(
            f"times of one way varied by {100 * trade.busy:.0f} %: other programs kept this machine"
            " busy; measure again with --fresh when it is idle"
        )
    again = "; measured before, --fresh measures again" if trade.cached else ""
    lines.append(f"on {trade.machine}{again}")
    return lines


def _settings(point: Point) -> list[str]:
    """Return the lines of a scene file that choose a point."""
    # Rounded upwards: a step that is shorter by its last digit would make one step more.
    step = math.ceil(point.dt * 1e10 - 1e-3) / 1e4
    return [
        f'  engine = "{point.engine}"',
        f'  plectrum = "{point.level}"',
        f'  string = "{point.string}"',
        f'  step = "{step:.10g} us"',
    ]


def _cells(point: Point) -> tuple[str, ...]:
    """Return a point for the table, with "failed" in place of its error."""
    what = (point.engine, point.level, point.string, f"{point.dt * 1e6:.4g}")
    if point.error is None or point.force_error is None or point.real_time_factor is None:
        return *what, "failed", *"-----"
    build, run = 1e3 * (point.build_time or 0.0), 1e3 * (point.run_time or 0.0)
    errors = f"{point.error * 1e6:.3g}", f"{100 * point.force_error:.2g}"
    spread = f"{100 * (point.spread or 0.0):.0f}"
    return *what, *errors, f"{build:.3g}", f"{run:.3g}", spread, f"{point.real_time_factor:.3g}"


def trade_figure(trade: Trade) -> Figure:
    """Return the work-precision diagram: error over real-time factor, logarithmic.

    The error is that of forces where an accuracy of forces was requested, else that of events. One
    colour is one way to simulate the scene with steps of several lengths, one marker is one engine;
    the grey line joins the Pareto-optimal points. Points that failed are not drawn.
    """
    figure = Figure(figsize=(9, 6), layout="constrained")
    axes = figure.add_subplot()
    lines: dict[str, list[Point]] = defaultdict(list)
    for point in trade.points:
        if not point.failed:
            lines[f"{point.engine}, {point.level}, {point.string}"].append(point)
    of_force = trade.requested.time is None
    requested = (trade.requested.force if of_force else trade.requested.time) or LEAST

    def places(points: Sequence[Point]) -> tuple[list[float], list[float]]:
        errors = [(point.force_error if of_force else point.error) or 0.0 for point in points]
        return [point.real_time_factor or 1.0 for point in points], [max(e, LEAST) for e in errors]

    speeds, errors = places([point for points in lines.values() for point in points])
    what = "force (1)" if of_force else "event (s)"
    axes.set(
        xscale="log",
        yscale="log",
        xlim=_limits(speeds or [1.0]),
        ylim=_limits([*errors, requested]),
        xlabel="simulated over real time (1)",
        ylabel=f"largest error of {'a' if of_force else 'an'} {what}, smaller ones at {LEAST:g}",
        title=f"{trade.scene or 'scene'}\n{trade.machine}",
    )
    best = places([trade.points[i] for i in trade.pareto])
    axes.plot(*best, color="0.8", linewidth=6, label="Pareto-optimal", zorder=1)
    engines = list(dict.fromkeys(points[0].engine for points in lines.values()))
    for i, (name, points) in enumerate(lines.items()):
        marker = MARKERS[engines.index(points[0].engine) % len(MARKERS)]
        style = {"color": SERIES[i % len(SERIES)], "label": name, "zorder": 2}
        axes.plot(*places(points), marker, markersize=6, **style)
    if trade.recommended is not None:
        chosen = trade.points[trade.recommended]
        (x,), (y,) = places([chosen])
        axes.plot(x, y, "o", markersize=14, fillstyle="none", color="black", zorder=3)
        text = f"recommended: {chosen.engine}, {chosen.dt * 1e6:.4g} us"
        axes.annotate(text, (x, y), (0, 14), textcoords="offset points", ha="center")
    axes.axhline(requested, color="0.5", linestyle=":", label=f"requested: {trade.requested}")
    axes.grid(visible=True, which="both", alpha=0.2)
    axes.legend()
    return figure


def _limits(values: Sequence[float]) -> tuple[float, float]:
    return min(values) / 3, 3 * max(values)
