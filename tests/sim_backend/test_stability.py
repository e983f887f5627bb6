import pytest

from benchmarks import stability
from benchmarks.extreme_cases import grid
from benchmarks.stability import (
    judge,
    run_stability,
    stability_text,
    with_verdict,
)
from sautereau.rig.load import load_rig
from sautereau.rig.progress import progress_to
from tests.budget import slow

RIG = load_rig()
GRID = {(case.name, case.scene.engine): case for case in grid(RIG)}
QUICK = [
    case
    for name, engine in GRID
    if (case := GRID[name, engine]).scene.finger == "push" and "step 1 us" not in name
]
"""Cases that take a fraction of a second each."""


@pytest.mark.slow
def test_pushes_converge_or_are_refused_and_never_fail_silently():
    found = run_stability(RIG, QUICK[::20])
    assert not with_verdict(found, "failed"), stability_text(found)
    assert len(with_verdict(found, "converged")) > len(found) / 2


@pytest.mark.parametrize("part", ["bending", slow("play"), slow("modal string")])
def test_scenes_without_an_exact_solution_are_compared_with_shorter_steps(part):
    assert judge(RIG, GRID[f"push, {part}", "rigid"]).verdict == "converged"
    assert (f"push, {part}", "exact") not in GRID


@pytest.mark.parametrize("engine", ["rigid", "exact"])
def test_a_balanced_key_is_refused_with_the_reason(engine):
    cell = judge(RIG, GRID["key balanced", engine])
    assert cell.verdict == "refused"
    assert "gravity_moment" in cell.reason
    assert judge(RIG, GRID["key nearly balanced", engine]).verdict == "converged"


@pytest.mark.parametrize("engine", ["rigid", "exact"])
def test_a_key_thrown_over_is_refused(engine):
    cell = judge(RIG, GRID["key thrown past its stop", engine])
    assert cell.verdict == "refused"


def test_a_claim_that_is_not_kept_is_a_failure(monkeypatch):
    case = GRID["push of 1.2 N", "rigid"]
    truth = stability.reference(RIG, case.scene)
    truth.events.releases[0] = truth.events.releases[0].__class__(0.02, 0, 0.5)
    monkeypatch.setattr(stability, "reference", lambda rig, scene, drive: truth)
    cell = judge(RIG, case)
    assert (cell.verdict, cell.reason) == ("failed", "less accurate than claimed")


def test_an_untyped_error_is_a_failure(monkeypatch):
    def crash(*args):
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr(stability, "observe", crash)
    found = run_stability(RIG, [GRID["push of 1.2 N", "rigid"]])
    assert [cell.reason for cell in with_verdict(found, "failed")] == ["ZeroDivisionError: by zero"]


def test_no_number_is_a_failure(monkeypatch):
    def lost(*args):
        found = real(*args)
        found.motions.angular_velocity[3] = float("nan")
        return found

    real = stability.observe
    monkeypatch.setattr(stability, "observe", lost)
    cell = judge(RIG, GRID["push of 1.2 N", "rigid"])
    assert (cell.verdict, cell.reason) == ("failed", "angular_velocity is not finite")


def test_the_text_counts_every_case():
    shares = []
    cases = [GRID["push of 1.2 N", "rigid"], GRID["key balanced", "rigid"]]
    with progress_to(shares.append):
        found = run_stability(RIG, cases)
    assert stability_text(found)[-1] == "1 converged, 1 refused, 0 failed silently"
    assert shares == [0.5, 1.0]
