"""The press that a fit predicts, against closed forms and against the model's own derivatives."""

import json

import numpy as np
import pytest

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.identified import Distribution
from sautereau.analysis.identify.parameters import with_parameters
from sautereau.analysis.model.predict import predict
from sautereau.analysis.results.predicted import NAMES, predicted, read_distribution
from sautereau.rig.load import load_rig, with_values

RIG = with_values(load_rig(), {"plectrum.contact": "surface"})
OVERLAP, INERTIA = "plectrum.overlap", "key.inertia"


def distribution(overlap_std, more=0.0):
    values = np.array([RIG.plectrum.overlap, RIG.key.inertia])
    return Distribution((OVERLAP, INERTIA), values, np.diag([overlap_std, more]) ** 2)


def test_the_intervals_are_those_of_small_errors_by_the_models_derivatives():
    std = 2e-6
    made = predicted(RIG, distribution(std, 1e-6))
    beside = [
        predict(with_parameters(RIG, {OVERLAP: RIG.plectrum.overlap + d})) for d in (-std, std)
    ]
    for own in made.intervals:
        assert own.low < own.value < own.high
        if own.name in ("release_force", "work", "pluck_duration"):
            low, high = (getattr(p, own.name) for p in beside)
            slope = (high - low) / 2  # by one standard uncertainty
            assert own.std == pytest.approx(abs(slope), rel=0.05)
            assert own.high - own.low == pytest.approx(2 * 1.96 * abs(slope), rel=0.05)


def test_the_force_drop_is_the_strings_force_by_the_levers_of_jack_and_finger():
    made = {i.name: i for i in predicted(RIG, distribution(1e-6)).intervals}
    press = predict(RIG)
    string = press.string_force[press.string_force > 0][-1]
    lever = RIG.key.jack_arm / RIG.key.press_arm
    assert made["force_drop"].value == pytest.approx(string * lever, rel=0.01)


def test_correlated_errors_that_cancel_leave_a_narrow_interval():
    """More overlap and less stiffness: along their line the force at release does not change."""
    names = (OVERLAP, "plectrum.bending_stiffness")
    values = np.array([RIG.plectrum.overlap, RIG.plectrum.bending_stiffness])

    def force(factors):
        changed = dict(zip(names, (values * factors).tolist(), strict=True))
        return predict(with_parameters(RIG, changed)).release_force

    slopes = [(force([1 + a, 1 + b]) - force([1, 1])) / 1e-3 for a, b in ((1e-3, 0), (0, 1e-3))]
    along = np.array([slopes[1], -slopes[0]])
    along *= 0.02 / np.linalg.norm(along)
    joint = np.outer(along * values, along * values)
    free = predicted(RIG, Distribution(names, values, np.diag(np.diag(joint))))
    tied = predicted(RIG, Distribution(names, values, joint))
    assert tied.intervals[0].std < 0.1 * free.intervals[0].std


def test_what_is_undetermined_or_too_uncertain_is_refused():
    with pytest.raises(AnalysisError, match=r"key\.inertia"):
        predicted(RIG, distribution(1e-6), ["key.inertia"])
    with pytest.raises(AnalysisError, match="draws"):
        predicted(RIG, distribution(1e-2))


def test_a_friction_beyond_its_bounds_counts_as_at_the_bound():
    one = Distribution(("plectrum.friction",), np.array([0.0]), np.array([[0.1**2]]))
    made = predicted(RIG, one)
    assert len(made.draws) == 256
    assert made.intervals[0].low == pytest.approx(made.intervals[0].value)


def test_text_json_table_and_figure_have_every_quantity():
    made = predicted(RIG, distribution(2e-6))
    assert set(made.document["quantities"]) == set(NAMES)
    assert list(made.to_frame().index) == list(NAMES)
    assert "force drop" in str(made)
    assert len(made.plot().axes) == len(NAMES)
    low, high = made.document["quantities"]["work"]["ci95"]
    assert low < made.document["quantities"]["work"]["value"] < high


def test_a_file_of_identify_gives_the_same(tmp_path):
    own, path = distribution(2e-6), tmp_path / "fit.json"
    parts = {"names": own.names, "values": own.values.tolist(), "covariance": own.covariance}
    parts["covariance"] = own.covariance.tolist()
    path.write_text(json.dumps({"distribution": parts, "parameters": {INERTIA: {"std": None}}}))
    read, unknown = read_distribution(path)
    assert read.names == own.names
    assert unknown == [INERTIA]
    np.testing.assert_array_equal(read.covariance, own.covariance)
    path.write_text(json.dumps({"distribution": parts | {"values": [1.0]}, "parameters": {}}))
    with pytest.raises(AnalysisError, match="2 names"):
        read_distribution(path)
    path.write_text("{}")
    with pytest.raises(AnalysisError, match="identify"):
        read_distribution(path)
