"""Extreme scenes: each is simulated as accurately as the engine claims, or refused."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from benchmarks.extreme_cases import Case, grid, random_cases
from benchmarks.figures import Figure
from sautereau.analysis.text import table
from sautereau.rig.errors import SautereauError
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.progress import tracked
from sautereau.rig.schema import Rig
from sautereau.sim_backend.physics.drive import Drive, drive_of
from sautereau.sim_backend.physics.observation import (
    Errors,
    Observation,
    errors,
    observe,
    reference,
)
from sautereau.sim_backend.scene import Scene
from sautereau.sim_backend.trade.select import reached, select_solver

RANDOM = 40  # Random cases of the complete map
FINER = 32
"""Dimensionless, by which the steps are shorter that replace a missing exact solution: four times
as short as the shortest ones from which a claim is estimated."""
Verdict = Literal["converged", "refused", "failed"]


@dataclass(frozen=True)
class Cell:
    """The outcome of a case."""

    case: Case
    verdict: Verdict
    claim: Errors | None = None
    """The claimed error; None for a case that was refused."""
    error: Errors | None = None
    """The error found."""
    reason: str = ""
    """Why the case was refused or has failed."""


def run() -> list[Figure]:
    """Print the map of all cases; return how many are accurate, refused, or failed in silence."""
    found = run_stability(load_rig())
    print("\n".join(stability_text(found)))
    of, accurate, refused, failed = (
        float(len(cells))
        for cells in (found, *(with_verdict(found, v) for v in ("converged", "refused", "failed")))
    )
    return [
        Figure("cases as accurate as claimed", accurate, "1", "all cases", of),
        Figure("cases refused with the reason", refused, "1", "all cases", of),
        Figure("cases that failed without an error", failed, "1", "limit", 0.0),
    ]


def run_stability(rig: Rig, cases: Iterable[Case] | None = None) -> list[Cell]:
    """Run cases through their engines and compare each with the reference solution.

    A scene without one, such as one with a modal string, is compared with much shorter steps.

    Args:
        rig: The bench from which the cases differ.
        cases: None for the complete grid and `RANDOM` random ones.
    """
    chosen = [*grid(rig), *random_cases(rig, RANDOM)] if cases is None else list(cases)
    return [judge(rig, case) for case in tracked(chosen)]


def judge(rig: Rig, case: Case) -> Cell:
    """Run one case and return its outcome."""
    try:
        bench = with_values(rig, case.values)
        drive = drive_of(bench, case.scene)
        selected = select_solver(bench, case.scene, drive)
        found = observe(bench, selected.scene, drive)
    except SautereauError as error:
        return Cell(case, "refused", reason=str(error))
    except Exception as error:  # noqa: BLE001 - an untyped error is what this map looks for
        return Cell(case, "failed", reason=f"{type(error).__name__}: {error}")
    claim = selected.errors
    if not math.isfinite(claim.time):
        return Cell(case, "refused", reason=reached(claim))
    fault = _fault(found)
    if fault:
        return Cell(case, "failed", claim, reason=fault)
    try:
        error = errors(found, _truth(bench, selected.scene, drive))
    except SautereauError as refusal:
        reason = f"simulated, but refused by the finest steps: {refusal}"
        return Cell(case, "failed", claim, reason=reason)
    if error.time <= claim.time and error.force <= claim.force:
        return Cell(case, "converged", claim, error)
    return Cell(case, "failed", claim, error, "less accurate than claimed")


def _truth(bench: Rig, scene: Scene, drive: Drive) -> Observation:
    """Return the exact solution; of a scene that has none, that of much shorter steps."""
    if scene.solvable:
        return reference(bench, scene, drive)
    step = scene.step or bench.controller.sample_period
    return observe(bench, scene.model_copy(update={"step": step / FINER}), drive)


def with_verdict(cells: Sequence[Cell], verdict: Verdict) -> list[Cell]:
    """Return the cells of a verdict; a failed one has a larger error than claimed."""
    return [cell for cell in cells if cell.verdict == verdict]


def stability_text(cells: Sequence[Cell]) -> list[str]:
    """Return the lines of a map: one for each case, and how many of each verdict."""
    heads = [
        ("", "", "", "error", "claimed", "force", "claimed"),
        ("case", "engine", "verdict", "(us)", "(us)", "(%)", "(%)"),
    ]
    lines = table([*heads, *map(_cells, cells)], left=range(3), gap=1)
    lines += [f"{c.case.name}, {c.case.scene.engine}: {c.reason}" for c in cells if c.reason]
    counts = [len(with_verdict(cells, each)) for each in get_args(Verdict)]
    lines.append("{} converged, {} refused, {} failed silently".format(*counts))
    return lines


def _fault(found: Observation) -> str:
    """Return the reason why an observation is no motion; empty where it is one."""
    motions = found.motions
    for name, values in vars(motions).items():
        if not np.isfinite(values).all():
            return f"{name} is not finite"
    if not (np.diff(motions.time) >= 0).all():
        return "time decreases"
    return ""


def _cells(cell: Cell) -> tuple[str, ...]:
    """Return a case for the table, without the reason of its verdict."""
    head = (cell.case.name, cell.case.scene.engine, cell.verdict)
    if cell.claim is None or cell.error is None:
        return *head, "-", "-", "-", "-"
    times = (f"{1e6 * each.time:.2g}" for each in (cell.error, cell.claim))
    forces = (f"{100 * each.force:.2g}" for each in (cell.error, cell.claim))
    return *head, *times, *forces
