"""The press of a photographed plectrum: its intervals from the ensemble and the material."""

import numpy as np
import pytest
from scipy.stats import t as student

from sautereau.analysis.model.predict import predict
from sautereau.analysis.results import prediction as predicted
from sautereau.analysis.results.prediction import OF_OUTLINE, members, of_outline
from sautereau.analysis.results.rig import Rig
from sautereau.rig.instrument import Outline, OutlineMember

LENGTH, THICKNESS = 4.5e-3, 0.48e-3


def member(factor, kind=OutlineMember, **more):
    half = factor * THICKNESS / 2
    return kind.model_construct(
        x=(0.0, 2e-3, LENGTH), top=(half,) * 3, bottom=(-half, -half, -0.7 * half), **more
    )


@pytest.fixture
def rig():
    values = Rig().values
    factors = (1 + 0.01 * np.random.default_rng(1).standard_normal(12)).tolist()
    outline = member(1.0, Outline, ensemble=tuple(map(member, factors)))
    return values.model_copy(update={"plectrum": values.plectrum.outlined(outline), "assumed": {}})


def test_the_interval_is_students_over_the_ensemble(rig):
    found = of_outline(rig, "elastica")
    values = [predict(own, "elastica").release_force for own in members(rig)]
    force = found.intervals[0]
    assert force.name == "release_force"
    assert force.value == predict(rig, "elastica").release_force
    half = student.ppf(0.975, 11) * np.std(values, ddof=1)
    assert force.high - force.value == pytest.approx(half, rel=1e-9)
    assert force.value - force.low == pytest.approx(half, rel=1e-9)
    assert force.photograph == pytest.approx(half, rel=1e-9)


def test_the_material_widens_it_to_the_ends_of_its_range(rig):
    modulus = rig.plectrum.youngs_modulus
    ends = (0.9 * modulus, 1.05 * modulus)
    wide = rig.model_copy(update={"assumed": {"plectrum.youngs_modulus": ends}})
    force = of_outline(wide, "elastica").intervals[0]
    at_ends = [
        predict(rig.replaced({"plectrum.youngs_modulus": end}), "elastica").release_force
        for end in ends
    ]
    for end, edge in zip(at_ends, (force.low, force.high), strict=True):
        assert abs(edge - force.value) == pytest.approx(
            np.hypot(end - force.value, force.photograph), rel=1e-9
        )
        assert abs(edge - force.value) > abs(end - force.value)


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_the_elements_interval_is_that_of_all_their_maps(rig):
    """A carved plectrum whose members differ in thickness, in the cut and in noise of the edges."""
    rng, x = np.random.default_rng(4), np.linspace(0, 1, 27)

    def edges(kind, size, **more):
        thick = THICKNESS * (1 + 0.01 * size * rng.standard_normal())
        depth = 0.15e-3 + 5e-6 * size * rng.standard_normal()
        cut = depth * np.clip((x - 0.4) / 0.6, 0, 1) ** 1.5
        noise = 5e-7 * size * rng.standard_normal((2, len(x)))
        top, bottom = thick / 2 + noise[0], cut - thick / 2 + noise[1]
        named = {"x": LENGTH * x, "top": top, "bottom": bottom}
        return kind.model_construct(**{n: tuple(v.tolist()) for n, v in named.items()}, **more)

    ensemble = tuple(edges(OutlineMember, 1.0) for _ in range(12))
    outline = edges(Outline, 0.0, ensemble=ensemble)
    rig = rig.model_copy(update={"plectrum": rig.plectrum.outlined(outline)})
    found = of_outline(rig, "fe")
    rows = [predicted.quantities(own, predict(own, "fe"), OF_OUTLINE) for own in members(rig)]
    halves = student.ppf(0.975, 11) * np.std(rows, axis=0, ddof=1)
    for own, half in zip(found.intervals, halves, strict=True):
        assert own.high - own.value == pytest.approx(half, rel=0.03), own.name


def test_results_have_a_table_json_and_a_figure(rig):
    found = of_outline(rig, "elastica")
    assert len(found.to_frame()) == len(OF_OUTLINE)
    assert found.document["quantities"]["force_drop"]["ci95"][0] < found.intervals[1].value
    assert "12 draws of the photographed outline" in str(found)
    assert len(found.plot().axes) == len(OF_OUTLINE)
    assert Rig(rig).predict(level="elastica").intervals(level="elastica") is not None


def test_without_an_ensemble_there_is_no_interval():
    assert Rig().predict().intervals() is None
    assert of_outline(Rig().values) is None
