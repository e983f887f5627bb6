"""The tabled elastica and the compiled solve that reads it."""

import sys

import numpy as np
import pytest

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.elastica import Elastica
from sautereau.analysis.model.pluck import compiled
from sautereau.analysis.model.pluck.pluck import solve_pluck
from sautereau.analysis.model.pluck.table import TabledElastica, table


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.5])
def test_the_table_is_the_elastica(paper, friction):
    exact = Elastica(paper.plectrum.model_copy(update={"friction": friction}))
    tabled = TabledElastica(exact)
    random = np.random.default_rng(0)
    s = random.uniform(0.01, 1, 500) * exact.length
    force = random.uniform(0, 1, 500) * exact.force_limit(s)
    for found, expected in zip(tabled.bend(s, force), exact.bend(s, force), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11 * np.abs(expected).max())


@pytest.fixture(params=[True, False], ids=["compiled", "python"])
def contact_solver(request, monkeypatch):
    if request.param:
        pytest.importorskip("numba")
    else:
        monkeypatch.setattr(compiled, "compiled_solve", lambda: compiled.solve_contact)
    return compiled.contact_solver


@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_the_compiled_solve_walks_along_the_pluck(paper, contact_solver, friction):
    plectrum = paper.plectrum.model_copy(update={"friction": friction})
    stiffness = paper.string.static_stiffness
    pluck = solve_pluck(Elastica(plectrum), stiffness, plectrum.overlap)
    solve = contact_solver(
        table(friction), plectrum.length, plectrum.bending_stiffness, plectrum.overlap
    )
    start = pluck.stretches[-1]
    s, force = pluck.position[start], pluck.force[start]
    for i in range(start, len(pluck.height)):
        s, force, status = solve(pluck.height[i], s, force, stiffness)
        assert status == compiled.SOLVED
        assert s == pytest.approx(pluck.position[i], rel=1e-10)
        assert force == pytest.approx(pluck.force[i], rel=1e-9, abs=1e-12)
    s, _, status = solve(pluck.release_height * 1.001, s, force, stiffness)
    assert status == compiled.SOLVED
    assert s > plectrum.length


def test_the_compiled_solve_says_when_the_contact_is_lost(paper, contact_solver):
    """Past a fold there is no equilibrium to find."""
    pluck = solve_pluck(Elastica(paper.plectrum), 300.0, 3.5e-3)
    assert pluck.gives_way
    p = paper.plectrum
    solve = contact_solver(table(0.0), p.length, p.bending_stiffness, 3.5e-3)
    found = solve(pluck.release_height * 1.01, pluck.position[-1], pluck.force[-1], 300.0)
    assert found.status == compiled.LOST


def test_without_numba_the_compiled_solve_says_what_to_do(monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)
    compiled.compiled_solve.cache_clear()
    with pytest.raises(ModelError, match=r"sautereau\[fast\]', or use solve_pluck"):
        compiled.contact_solver(table(0.0), 1.0, 1.0, 0.1)
