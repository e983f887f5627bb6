"""Levels of the plectrum: error and time of the paper's pluck."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_bvp

from benchmarks.figures import Figure, median_time
from sautereau.analysis.model.plectrum.base import PlectrumMap
from sautereau.analysis.model.plectrum.levels import plectrum_map
from sautereau.analysis.model.plectrum.rods import Rods
from sautereau.analysis.model.pluck.pluck import Pluck, solve_pluck
from sautereau.rig.instrument import Plectrum
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig

DEAREST = "elastica"
"""The exact level that the others are held against."""
BATCH = 401
"""Points of an array that is mapped at once."""
SAME = 1e-8
"""1, within which two exact solutions of the elastica are one."""


@dataclass(frozen=True)
class Row:
    """A level, and the largest error that it may have here."""

    name: str
    limit: float
    """%, of release force, contact duration and string lift."""
    build: Callable[[Plectrum], PlectrumMap] | None = None
    """Of a level that is not built as its name says."""

    def map(self, plectrum: Plectrum) -> PlectrumMap:
        """Return the level's map."""
        return self.build(plectrum) if self.build else plectrum_map(plectrum, self.name)


ROWS = (
    Row("rods (5)", 1.0, lambda plectrum: Rods(plectrum, 5)),
    Row("rods", 0.1),
    Row("rods (80)", 0.01, lambda plectrum: Rods(plectrum, 80)),
    Row("beam", 25.0),
    Row("two-beam", 25.0),
    Row("fe", 1.0),
)
"""Levels of the table beside the dearest."""


@dataclass(frozen=True)
class Cost:
    """Median times of one level [s]."""

    point: float
    """Of the map at one point."""
    batch: float
    """Of the map at `BATCH` points at once."""
    pluck: float
    """Of a whole pluck."""


def run() -> list[Figure]:
    """Return every level's errors against the dearest level, and its times beside it."""
    rig = load_rig()
    dearest = plectrum_map(rig.plectrum, DEAREST)
    exact, cost = _measured(rig, dearest)
    figures = _beside_a_solver(rig, dearest, exact, cost)
    for row in ROWS:
        pluck, own = _measured(rig, row.map(rig.plectrum))
        figures += [*_errors(rig, row, pluck, exact), *_times(row.name, own, cost)]
    return figures


def _beside_a_solver(rig: Rig, plectrum: PlectrumMap, pluck: Pluck, cost: Cost) -> list[Figure]:
    """Return the dearest level's own error and time beside a general boundary-value solver."""
    s, force = plectrum.length, pluck.force[-1]
    q = force * s**2 / rig.plectrum.bending_stiffness
    along = np.linspace(0, 1, 11)

    def solve():
        # theta'' = q cos(theta - theta(1)), theta(0) = theta'(1) = 0, in units of s.
        solved = solve_bvp(
            lambda _, y, tip: [y[1], q * np.cos(y[0] - tip[0]), np.cos(y[0]), np.sin(y[0])],
            lambda clamp, end, tip: [clamp[0], clamp[2], clamp[3], end[0] - tip[0], end[1]],
            along,
            np.vstack([-q / 2 * along, -q / 2 + 0 * along, along, 0 * along]),
            p=[-q / 2],
            tol=1e-9,
            max_nodes=20_000,
        )
        assert solved.success
        return solved.y[:, -1]

    theta, _, x, z = solve()
    bend = plectrum.bend(s, force)
    error = max(abs(bend.x - s * x), abs(bend.z - s * z), s * abs(bend.theta - theta)) / s
    assert error < SAME
    name = "scipy solve_bvp"
    spent = median_time(solve)
    return [
        Figure(f"{DEAREST}: difference from {name}, of the length", error, "1", "limit", SAME),
        Figure(f"{DEAREST}: one point of the map", cost.point * 1e6, "us", name, spent * 1e6),
        Figure(f"{DEAREST}: {BATCH} points at once", cost.batch * 1e6, "us", name, spent * 1e6),
        Figure(
            f"{DEAREST}: a complete pluck",
            cost.pluck * 1e3,
            "ms",
            f"{name}, one point",
            spent * 1e3,
        ),
    ]


def _measured(rig: Rig, plectrum: PlectrumMap) -> tuple[Pluck, Cost]:
    """Return the pluck of a level and what it costs; the map is built before, once."""
    pluck = _pluck(rig, plectrum)
    s, force = pluck.position[-1], pluck.force[-1]
    many = np.linspace(0, force, BATCH)
    return pluck, Cost(
        point=median_time(lambda: plectrum.bend(s, force)),
        batch=median_time(lambda: plectrum.bend(s, many)),
        pluck=median_time(lambda: _pluck(rig, plectrum)),
    )


def _pluck(rig: Rig, plectrum: PlectrumMap) -> Pluck:
    return solve_pluck(plectrum, rig.string.static_stiffness, rig.plectrum.overlap)


def _errors(rig: Rig, row: Row, pluck: Pluck, exact: Pluck) -> list[Figure]:
    """Return how far [%] the pluck's results lie above the exact ones, or below."""
    found = {
        "release force": (pluck.force[-1], exact.force[-1]),
        "pluck duration": (
            pluck.release_height / rig.press.jack_speed,
            exact.release_height / rig.press.jack_speed,
        ),
        "string lift": (pluck.lift[-1], exact.lift[-1]),
    }
    figures = []
    for what, (value, truth) in found.items():
        error = float(value / truth - 1) * 100
        assert abs(error) < row.limit, f"{row.name}: {what} is wrong by {error:.3g} %"
        figures.append(Figure(f"{row.name}: error of {what}", error, "%", "limit", row.limit))
    return figures


def _times(level: str, cost: Cost, peer: Cost) -> list[Figure]:
    return [
        Figure(f"{level}: one point of the map", cost.point * 1e6, "us", DEAREST, peer.point * 1e6),
        Figure(
            f"{level}: {BATCH} points at once", cost.batch * 1e6, "us", DEAREST, peer.batch * 1e6
        ),
        Figure(f"{level}: a complete pluck", cost.pluck * 1e3, "ms", DEAREST, peer.pluck * 1e3),
    ]
