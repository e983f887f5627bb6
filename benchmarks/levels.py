"""Levels of the plectrum: error and time of the paper's pluck."""

import numpy as np
from scipy.integrate import solve_bvp

from benchmarks.figures import Figure, check, median_time
from sautereau.analysis.model.plectrum.base import PlectrumMap
from sautereau.analysis.model.plectrum.levels import plectrum_map
from sautereau.analysis.model.plectrum.rods import Rods
from sautereau.analysis.model.pluck.pluck import Pluck, solve_pluck
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig

EXACT = "elastica"  # The exact level, reference of the others
BATCH = 401  # Points of an array that is evaluated in one call
SAME = 1e-8  # Dimensionless tolerance between two exact solutions of the elastica


LIMITS = {"rods (5)": 1.0, "rods": 0.1, "rods (80)": 0.01, "beam": 25.0, "two-beam": 25.0}
LIMITS |= {"fe": 1.0}
"""%, of plectrum force, pluck duration and string lift, of the levels besides the exact one."""
COSTS = (
    ("one point of the map", 1e6, "us"),
    (f"{BATCH} points in one call", 1e6, "us"),
    ("a complete pluck", 1e3, "ms"),
)
"""What is timed at every level, with its scale from s and its unit."""
Cost = tuple[float, float, float]  # Median times [s] of `COSTS`


def run() -> list[Figure]:
    """Return every level's errors against the exact level, and all times."""
    rig = load_rig()
    exact_level = plectrum_map(rig.plectrum, EXACT)
    exact, cost = _measured(rig, exact_level)
    figures = _beside_a_solver(rig, exact_level, exact, cost)
    for name, limit in LIMITS.items():
        level, _, count = name.rstrip(")").partition(" (")
        plectrum = rig.plectrum
        bent = Rods(plectrum, int(count)) if count else plectrum_map(plectrum, level)
        pluck, own = _measured(rig, bent)
        figures += _errors(name, limit, pluck, exact)
        for (what, scale, unit), spent, peer in zip(COSTS, own, cost, strict=True):
            figures.append(Figure(f"{name}: {what}", spent * scale, unit, EXACT, peer * scale))
    return figures


def _beside_a_solver(rig: Rig, plectrum: PlectrumMap, pluck: Pluck, cost: Cost) -> list[Figure]:
    """Return the exact level's own error and time beside a general boundary-value solver."""
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
        check(solved.success, f"SciPy: {solved.message}")
        return solved.y[:, -1]

    theta, _, x, z = solve()
    bend = plectrum.bend(s, force)
    error = max(abs(bend.x - s * x), abs(bend.z - s * z), s * abs(bend.theta - theta)) / s
    name = "scipy solve_bvp"
    spent = median_time(solve)
    return [
        Figure(f"{EXACT}: difference from {name}, of the length", error, "1", "limit", SAME),
        *(
            Figure(f"{EXACT}: {what}", own * scale, unit, f"{name}, one point", spent * scale)
            for (what, scale, unit), own in zip(COSTS, cost, strict=True)
        ),
    ]


def _measured(rig: Rig, plectrum: PlectrumMap) -> tuple[Pluck, Cost]:
    """Return the pluck of a level and what it costs; the map is built before, once."""
    pluck = _pluck(rig, plectrum)
    s, force = pluck.position[-1], pluck.force[-1]
    many = np.linspace(0, force, BATCH)
    return pluck, (
        median_time(lambda: plectrum.bend(s, force)),
        median_time(lambda: plectrum.bend(s, many)),
        median_time(lambda: _pluck(rig, plectrum)),
    )


def _pluck(rig: Rig, plectrum: PlectrumMap) -> Pluck:
    return solve_pluck(plectrum, rig.string.static_stiffness, rig.plectrum.overlap)


def _errors(level: str, limit: float, pluck: Pluck, exact: Pluck) -> list[Figure]:
    """Return how far [%] the pluck's results lie above the exact ones, or below."""
    found = {
        "plectrum force": (pluck.force[-1], exact.force[-1]),
        "pluck duration": (pluck.release_height, exact.release_height),
        "string lift": (pluck.lift[-1], exact.lift[-1]),
    }
    figures = []
    for what, (value, truth) in found.items():
        error = float(value / truth - 1) * 100
        figures.append(Figure(f"{level}: error of {what}", error, "%", "limit", limit))
    return figures
