"""The press of a photographed plectrum: its intervals from the ensemble and the material."""

import numpy as np
import pytest
from scipy.stats import t as student

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.predict import predict
from sautereau.analysis.results import predicted
from sautereau.analysis.results.predicted import OF_OUTLINE, members, of_outline
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


def test_the_answer_is_the_same_in_several_processes(rig, monkeypatch):
    alone = of_outline(rig, "elastica")
    monkeypatch.setattr(predicted, "QUICK", -1.0)
    monkeypatch.setattr(predicted.os, "cpu_count", lambda: 2)
    both = of_outline(rig, "elastica")
    np.testing.assert_array_equal(alone.draws, both.draws)


def test_results_have_a_table_json_and_a_figure(rig):
    found = of_outline(rig, "elastica")
    assert len(found.to_frame()) == len(OF_OUTLINE)
    assert found.document["quantities"]["force_drop"]["ci95"][0] < found.intervals[1].value
    assert "12 draws of the photographed outline" in str(found)
    assert len(found.plot().axes) == len(OF_OUTLINE)
    assert Rig(rig).predict(level="elastica").intervals(level="elastica") is not None


def test_without_an_ensemble_there_is_no_interval():
    assert Rig().predict().intervals() is None
    with pytest.raises(AnalysisError, match="outline has no ensemble"):
        of_outline(Rig().values)
