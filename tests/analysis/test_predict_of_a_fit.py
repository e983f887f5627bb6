"""The press that a fit predicts, against closed forms and against the model's own derivatives."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest, norm, truncnorm

import sautereau as st
from benchmarks.simulated import acquired
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.identified import identify
from sautereau.analysis.identify.information import Distribution
from sautereau.analysis.identify.parameters import rig_values, with_parameters
from sautereau.analysis.loading.press import press_of
from sautereau.analysis.model.predict import predict
from sautereau.analysis.phases import find_phases
from sautereau.analysis.results.prediction import NAMES, predicted, read_distribution
from sautereau.commands.app import app
from sautereau.rig.document import rig_document
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.ranges import deviations, value_of
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.scene import load_scene
from tests.sessions import SessionWriter

RIG = with_values(load_rig(), {"plectrum.contact": "surface"})
OVERLAP, INERTIA = "plectrum.overlap", "key.inertia"


def of(names, values, covariance, low=-np.inf, high=np.inf):
    """Return a distribution with the same bounds for all values, or with those of each."""
    values = np.array(values, float)
    ends = (np.broadcast_to(end, values.shape).astype(float) for end in (low, high))
    return Distribution(tuple(names), values, np.array(covariance, float), *ends)


def distribution(overlap_std, more=0.0):
    values = [RIG.plectrum.overlap, RIG.key.inertia]
    return of((OVERLAP, INERTIA), values, np.diag([overlap_std, more]) ** 2)


@pytest.mark.parametrize(
    ("low", "high"), [(-1.0, 2.0), (0.0, np.inf), (-np.inf, 0.3), (-1e-3, 1e-3), (2.5, 4.0)]
)
def test_draws_of_one_value_are_those_of_a_truncated_normal_distribution(low, high):
    draws = of(["x"], [5.0], [[4.0]], 5 + 2 * low, 5 + 2 * high).drawn(4096)[:, 0]
    true = truncnorm(low, high, loc=5, scale=2)
    assert draws.mean() == pytest.approx(true.mean(), abs=0.02 * true.std())
    assert draws.std() == pytest.approx(true.std(), rel=0.02)
    assert kstest(draws, true.cdf).statistic < 0.01


@pytest.mark.parametrize("r", [-0.9, 0.0, 0.6, 0.98])
def test_draws_of_two_correlated_values_have_the_moments_of_a_quadrant(r):
    """Of standard normal values with the correlation r, both above 0 (Rosenbaum 1961)."""
    draws = of("xy", [0, 0], [[1, r], [r, 1]], 0.0).drawn(1024)
    inside = 1 / 4 + np.arcsin(r) / (2 * np.pi)
    mean = (1 + r) / np.sqrt(8 * np.pi) / inside
    square = 1 + r * np.sqrt(1 - r * r) / (2 * np.pi * inside)
    product = r + np.sqrt(1 - r * r) / (2 * np.pi * inside)
    assert (draws > 0).all()
    assert draws.mean(0) == pytest.approx([mean, mean], rel=0.05)
    assert (draws**2).mean(0) == pytest.approx([square, square], rel=0.08)
    assert draws.prod(1).mean() == pytest.approx(product, rel=0.08)


def test_draws_are_those_of_a_plain_normal_distribution_far_from_the_bounds():
    """Also where one value is exact, and where two are a single one."""
    spread = np.array([[2.0, 0, 0], [1, 1, 0], [0, 0, 0], [2, 2, 0]])
    own = of("abcd", [1, 2, 3, 4], spread @ spread.T, -40.0, 40.0)
    draws = own.drawn(2048)
    assert np.cov(draws.T) == pytest.approx(own.covariance, abs=0.1)
    np.testing.assert_array_equal(draws[:, 2], 3)
    assert draws[:, 3] - 4 == pytest.approx(2 * (draws[:, 1] - 2), abs=1e-6)
    np.testing.assert_array_equal(own.drawn(2048), draws)


def test_bounds_that_exclude_the_distribution_are_refused():
    """Two values that are one, of which one is above and the other below."""
    own = of("xy", [0, 0], [[1, 1], [1, 1]], [1, -np.inf], [np.inf, -1])
    with pytest.raises(AnalysisError, match="draws"):
        own.drawn(256)


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


@pytest.mark.slow
def test_the_force_drop_is_the_strings_force_by_the_levers_of_jack_and_finger():
    made = {i.name: i for i in predicted(RIG, distribution(1e-6)).intervals}
    press = predict(RIG)
    string = press.string_force[press.string_force > 0][-1]
    lever = RIG.key.jack_arm / RIG.key.press_arm
    assert made["force_drop"].value == pytest.approx(string * lever, rel=0.01)


@pytest.mark.slow
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
    free = predicted(RIG, of(names, values, np.diag(np.diag(joint))))
    tied = predicted(RIG, of(names, values, joint))
    assert tied.intervals[0].std < 0.1 * free.intervals[0].std


def test_what_is_undetermined_or_too_uncertain_is_refused():
    with pytest.raises(AnalysisError, match=r"key\.inertia"):
        predicted(RIG, distribution(1e-6), ["key.inertia"])
    with pytest.raises(AnalysisError, match="draws"):
        predicted(RIG, distribution(1e-2))


@pytest.mark.slow
def test_a_friction_is_drawn_above_0():
    """Friction raises the force at release: that of the fitted 0 is the least one."""
    made = predicted(RIG, of(["plectrum.friction"], [0.0], [[0.1**2]], 0.0, 0.5))
    force = made.intervals[0]
    assert len(made.draws) == 256
    assert force.value < made.draws[:, 0].min()
    rubbed = predict(with_parameters(RIG, {"plectrum.friction": 0.1 * norm.ppf(0.75)}))
    assert np.median(made.draws[:, 0]) == pytest.approx(rubbed.release_force, rel=0.01)


def test_text_json_table_and_figure_have_every_quantity():
    made = predicted(RIG, distribution(2e-6))
    assert set(made.document["quantities"]) == set(NAMES)
    assert list(made.to_frame().index) == list(NAMES)
    assert "force drop" in str(made)
    assert len(made.plot().axes) == len(NAMES)
    low, high = made.document["quantities"]["work"]["ci95"]
    assert low < made.document["quantities"]["work"]["value"] < high


def document(own, *omitted, std=1.0):
    parts = {n: np.asarray(p).tolist() for n, p in vars(own).items() if n not in omitted}
    return json.dumps({"distribution": parts, "parameters": {INERTIA: {"std": std}}})


def test_a_file_of_identify_gives_the_same(tmp_path):
    own, path = replace(distribution(2e-6), low=np.zeros(2), high=np.ones(2)), tmp_path / "fit.json"
    path.write_text(document(own, std=None))
    read, unknown, _ = read_distribution(path)
    assert read.names == own.names
    assert unknown == [INERTIA]
    for name in ("values", "covariance", "low", "high"):
        np.testing.assert_array_equal(getattr(read, name), getattr(own, name))
    for wrong in ({"values": np.ones(1)}, {"high": np.ones(3)}, {"covariance": np.ones((1, 2))}):
        path.write_text(document(replace(own, **wrong)))
        with pytest.raises(AnalysisError, match="2 names"):
            read_distribution(path)
    path.write_text(document(replace(own, high=np.zeros(2))))
    with pytest.raises(AnalysisError, match="bounds") as raised:
        read_distribution(path)
    assert all(name in str(raised.value) for name in own.names)
    path.write_text("{}")
    with pytest.raises(AnalysisError, match="identify"):
        read_distribution(path)


def test_a_file_without_bounds_has_the_natural_ones(tmp_path):
    own, path = of(["plectrum.friction", INERTIA], [0.1, 1e-3], np.eye(2)), tmp_path / "fit.json"
    path.write_text(document(own, "low", "high"))
    read, *_ = read_distribution(path)
    assert read.low.tolist() == [0.0, -np.inf]
    assert read.high.tolist() == [0.5, np.inf]


def test_a_fit_of_another_instrument_is_reported_by_what_differs(tmp_path):
    """What was fitted may differ, and so may the press."""
    changes = {"plectrum.overlap": "0.3 mm", "press.jack_speed": "0.1 m/s"}
    path, alike = tmp_path / "fit.json", with_values(RIG, changes)
    found = json.loads(document(distribution(2e-6), "low", "high"))

    def warnings(instrument):
        path.write_text(json.dumps(found | {"instrument": instrument}))
        return predicted(RIG, *read_distribution(path)).warnings

    assert warnings(rig_document(alike)) == ()
    other = with_values(alike, {"key.press_arm": "150 mm", "string.tension": "70 N"})
    (warning,) = warnings(rig_document(other))
    assert "key.press_arm '0.171 m' (fit: '0.15 m')" in warning
    assert "string.tension" in warning
    assert "overlap" not in warning
    (warning,) = warnings({})
    assert "earlier version" in warning


DRAWN = (
    *("plectrum.youngs_modulus", "plectrum.overlap", "plectrum.length", "plectrum.thickness"),
    *("key.inertia", "key.gravity_moment", "key.jack_arm", "key.jack_surface_height"),
    *("key.pivot_coulomb_friction", "key.pivot_viscous_friction", "string.tension"),
    *("jack.mass", "jack.register_friction"),
)
"""Numbers of the packaged rig with ranges, without the lengths that say where the finger is."""


@pytest.mark.slow
def test_intervals_contain_the_press_of_instruments_drawn_from_the_rigs_ranges():
    """12 fits of 3 presses. On the stand-in the fit is 3 and more of its standard uncertainties off
    the place of the balance pin on one of five instruments: 0.85 of 0.95 is required."""
    rig, scene, held = load_rig(), load_scene("paper"), []
    for seed in range(12):
        random, truth = np.random.default_rng([45, 4, seed]), {}
        for e in deviations(rig, DRAWN):
            off = truncnorm.rvs(e.low / e.std, e.high / e.std, scale=e.std, random_state=random)
            truth[e.name] = value_of(rig, e.name) + float(off)
        truth = rig_values(rig, truth)
        true = with_values(rig, truth)
        seen = observe(rig, scene.model_copy(update={"truth": truth, "step": 50e-6}))
        pressed = [press_of(acquired(rig, scene, seen, number)[0]) for number in range(3)]
        free = ["plectrum.bending_stiffness", "plectrum.overlap"]
        found = identify(pressed, list(map(find_phases, pressed)), free, starts=1)
        if not found.quality.fits:
            continue
        made, exact = predicted(rig, found.distribution), predict(true)
        assert len(made.draws) == 256
        own = [i for i in made.intervals if i.name != "force_drop"]
        held.append([i.low <= getattr(exact, i.name) <= i.high for i in own])
    assert len(held) >= 10
    assert np.mean(held) >= 0.85


@pytest.mark.slow
def test_a_fit_of_the_packaged_rig_predicts_on_the_command_line_as_in_python(tmp_path, capsys):
    rig, out = load_rig(), tmp_path / "presses"
    seen = observe(rig, load_scene("paper"))
    for number in (1, 2, 3):
        recorded, _ = acquired(rig, load_scene("paper"), seen, number)
        SessionWriter(recorded)(out, 1, first=number, noise=0.0)
    free, path = "plectrum.bending_stiffness,plectrum.overlap", tmp_path / "fit.json"

    def run(*words):
        status = app([*map(str, words), "--json"], exit_on_error=False, print_error=False)
        assert status == 0
        return capsys.readouterr().out

    path.write_text(run("identify", out, "--free", free, "--starts", 1))
    parts = json.loads(path.read_text())["distribution"]
    ends = dict(zip(parts["names"], zip(parts["low"], parts["high"], strict=True), strict=True))
    assert ends["jack.mass"] == rig.assumed["jack.mass"]
    assert ends["key.pivot_coulomb_friction"][0] == 0
    printed = json.loads(run("predict", "paper", "--fit", path))
    assert printed["warnings"] == []
    made = st.open(out).identify(free.split(","), starts=1).predict()
    assert printed["draws"] == len(made.draws) == 256
    for i in made.intervals:
        assert printed["quantities"][i.name]["ci95"] == pytest.approx([i.low, i.high], rel=1e-6)
