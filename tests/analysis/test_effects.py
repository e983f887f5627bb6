"""Effects of factors: against closed forms, the own restricted likelihood, and known truth."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from scipy.stats import binom, f_oneway, ttest_ind

import sautereau as st
from sautereau.analysis.campaign.effects import fit_effects, in_order
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.phases.expected import expected
from sautereau.analysis.text import WIDTH, wrapped
from sautereau.commands.app import app
from sautereau.entrance.session import Session
from sautereau.rig.load import load_rig, with_values
from tests.budget import amount
from tests.presses import QUICK

RIG = load_rig()


def experiment(random, levels, speeds, repeats, set_ups, press=1.0, block=0.0, offset=0.0):
    """Return values with known effects, their levels and blocks, and the true differences."""
    overlaps = [f"{0.2 + 0.01 * k:.2f} mm" for k in range(levels)]
    fast = [f"{0.03 + 0.01 * k:.2f} m/s" for k in range(speeds)]
    factors = {"overlap": overlaps, "jack_speed": fast}
    design = st.design(factors, repeats, seed=int(random.integers(2**32)), set_ups=set_ups)
    rows = design.rows(RIG)
    by_hand = dict(
        zip(overlaps, random.normal(0, 10 ** random.uniform(-1, 1), levels), strict=True)
    )
    by_speed = dict(zip(fast, random.normal(0, 10 ** random.uniform(-1, 1), speeds), strict=True))
    blocks = np.array([row.block for row in rows]) - 1
    deviations = random.normal(0, block, blocks.max() + 1)
    values = offset + deviations[blocks] + random.normal(0, press, len(rows))
    values += [by_hand[r.levels["overlap"]] + by_speed[r.levels["jack_speed"]] for r in rows]
    true = {("overlap", name): v - by_hand[overlaps[0]] for name, v in by_hand.items()}
    true |= {("jack_speed", name): v - by_speed[fast[0]] for name, v in by_speed.items()}
    return values, {f: [r.levels[f] for r in rows] for f in factors}, blocks, true


def found_in(fit):
    return {(e.factor, e.level): e for factor in fit.factors for e in factor.effects}


@settings(deadline=None, max_examples=40)
@given(some.integers(0, 2**32), some.integers(2, 5), some.floats(-6, 6))
def test_two_levels_are_students_test_and_several_the_analysis_of_variance(seed, levels, power):
    random = np.random.default_rng(seed)
    scale = 10.0**power
    groups = [scale * random.normal(k, 1, 4 + k) for k in range(levels)]
    names = [f"{k}" for k in range(levels) for _ in groups[k]]
    fit = fit_effects(np.concatenate(groups), {"a": names}, np.zeros(len(names), np.intp))
    (factor,) = fit.factors
    assert factor.p_value == pytest.approx(f_oneway(*groups).pvalue, rel=1e-6, abs=1e-300)
    assert [m.value for m in factor.means] == pytest.approx([g.mean() for g in groups])
    if levels == 2:
        ends = ttest_ind(groups[1], groups[0]).confidence_interval()
        (effect,) = factor.effects
        assert (effect.low, effect.high) == pytest.approx((ends.low, ends.high), abs=1e-9 * scale)


@pytest.mark.parametrize("seed", range(6))
def test_the_mixed_model_is_that_of_statsmodels(seed):
    """Coefficients, their covariance and the deviations, to the searches' tolerances."""
    mixed = pytest.importorskip("statsmodels.regression.mixed_linear_model")
    random = np.random.default_rng(seed)
    scale = 10.0 ** random.integers(-8, 3)
    values, factors, blocks, _ = experiment(random, 3, 3, 2, 3, 1.0, 2.0, 5.0)
    fit = fit_effects(scale * values, factors, blocks)
    columns = [np.ones(len(values))]
    columns += [np.equal(own, x) for own in factors.values() for x in in_order(own)[1:]]
    other = mixed.MixedLM(values, np.array(columns, float).T, groups=blocks).fit(reml=True)
    assert fit.model == "mixed model"
    assert fit.press_std == pytest.approx(scale * other.scale**0.5, rel=2e-3)
    assert fit.block_std == pytest.approx(scale * float(other.cov_re[0, 0]) ** 0.5, rel=2e-3)
    effects = [e for factor in fit.factors for e in factor.effects]
    assert [e.value for e in effects] == pytest.approx(scale * other.fe_params[1:], rel=1e-2)
    assert [e.std for e in effects] == pytest.approx(scale * other.bse_fe[1:], rel=5e-3)


def test_between_blocks_a_balanced_difference_is_students_of_the_blocks_means():
    """Closed form: a split-plot design compares the means of blocks."""
    values, factors, blocks, _ = experiment(np.random.default_rng(3), 2, 3, 2, 4, 1.0, 5.0)
    effect = fit_effects(values, factors, blocks).factors[0].effects[0]
    of_block = {b: factors["overlap"][int(np.argmax(blocks == b))] for b in set(blocks.tolist())}
    first, second = in_order(factors["overlap"])
    means = [
        [values[blocks == b].mean() for b in of_block if of_block[b] == level]
        for level in (second, first)
    ]
    ends = ttest_ind(*means).confidence_interval()
    assert (effect.low, effect.high) == pytest.approx((ends.low, ends.high), rel=1e-3)
    assert effect.degrees == 6


def inside(n, seed, **ranges):
    """Return the fraction of true differences in their intervals, of each factor."""
    counts = {"overlap": [], "jack_speed": []}
    for k in range(n):
        random = np.random.default_rng([seed, k])
        sizes = random.integers(2, 5), random.integers(2, 5), random.integers(2, 6)
        deviations = 10 ** random.uniform(-1, 1), 10 ** random.uniform(-1, 1)
        values, factors, blocks, true = experiment(
            random, *sizes, int(random.integers(2, 4)), *deviations, random.normal(0, 100)
        )
        scale = 10.0 ** random.uniform(-9, 3)
        for key, effect in found_in(fit_effects(scale * values, factors, blocks)).items():
            counts[key[0]].append(effect.low <= scale * true[key] <= effect.high)
    return counts


def test_known_effects_are_inside_their_intervals():
    """At least as many as 95 % intervals hold in all but 1 of 1000 studies."""
    for found in inside(25, 1).values():
        assert sum(found) >= binom.ppf(1e-3, len(found), 0.95)


@pytest.mark.slow
def test_coverage_of_the_intervals():
    """Within blocks 95 %; between few blocks never less, as a deviation of zero is conservative."""
    found = inside(amount(300, 600), 2)
    within, between = (np.mean(found[name]) for name in ("jack_speed", "overlap"))
    assert 0.93 < within < 0.97
    assert 0.93 < between < 0.995


def test_the_speed_of_the_jack_has_no_effect_on_a_force_drop(tmp_path):
    """A finger that takes up the weight of a key before it moves; the true effect is 0."""
    slow = RIG.press.model_copy(update={"run_up_acceleration": None, "run_up_jerk": None})
    values = QUICK | {"plectrum.thickness": "0.52 mm"}
    rig = with_values(RIG.model_copy(update={"press": slow}), values)
    design = st.design({"press.jack_speed": ["0.05 m/s", "0.09 m/s"]}, 2, seed=2)
    with st.stand_in(rig, seed=5) as bench:
        found = bench.press(design, out=tmp_path, warm_up=0).effects(["force_drop"])
    truth = expected(rig).forces[0]
    assert found.values["force_drop"] == pytest.approx(np.full(4, truth), rel=0.015)
    ((effect,),) = (factor.effects for factor in found.fitted["force_drop"].factors)
    assert effect.low < 0 < effect.high
    assert effect.high - effect.low < 0.1 * truth


@settings(deadline=None, max_examples=20)
@given(some.integers(0, 2**32), some.floats(-6, 6))
def test_errors_that_levels_share_are_added_to_the_intervals(seed, power):
    """Closed form: the quadratic mean of scatter and both levels' errors; of four cells for two."""
    random = np.random.default_rng(seed)
    scale = 10.0**power
    a, b = np.repeat(["1", "2"], 8), np.tile(["1", "2"], 8)
    values, factors, one = scale * random.normal(size=16), {"a": a, "b": b}, np.zeros(16, np.intp)
    sizes = (scale * random.gamma(1, 1, 4)).tolist()
    of_cell = dict(zip(product("12", repeat=2), sizes, strict=True))
    stds = np.array([of_cell[cell] for cell in zip(a, b, strict=True)])
    lists = {name: own.tolist() for name, own in factors.items()}
    alone = fit_effects(values, lists, one, interaction=True)
    fit = fit_effects(values, lists, one, stds=stds, interaction=True)
    for name, own in factors.items():
        effect = found_in(fit)[name, "2"]
        assert effect.level_std == pytest.approx(np.hypot(*(stds[own == k].mean() for k in "12")))
    expected = np.linalg.norm([*of_cell.values()])
    assert found_in(fit)["a x b", "2 x 2"].level_std == pytest.approx(expected)
    for key, effect in found_in(fit).items():
        before = found_in(alone)[key]
        assert before.level_std == 0
        assert effect.value == before.value
        assert effect.std == pytest.approx(np.hypot(before.std, effect.level_std))
        assert effect.high - effect.low > 2 * 1.959 * effect.std
    for factor in fit.factors:  # one level beside the first: the same as its interval
        (effect,) = factor.effects
        assert (factor.p_value < 0.05) == (not effect.low <= 0 <= effect.high)


def test_a_shared_error_without_an_effect_is_not_significant():
    """Levels whose presses share an error of known size: 95 % of intervals contain no effect."""
    random, inside = np.random.default_rng(8), {"with": [], "without": []}
    for _ in range(300):
        sizes = 10 ** random.uniform(-1, 1, 2)
        errors = random.normal(0, sizes)
        values = np.repeat(errors, 4) + random.normal(0, 0.3, 8)
        for what, stds in (("with", np.repeat(sizes, 4)), ("without", None)):
            levels = {"a": list("11112222")}
            fit = fit_effects(values, levels, np.zeros(8, np.intp), stds=stds)
            (effect,) = fit.factors[0].effects
            inside[what].append(effect.low <= 0 <= effect.high)
    assert 0.92 < np.mean(inside["with"]) < 0.985
    assert np.mean(inside["without"]) < 0.7


@settings(deadline=None, max_examples=20)
@given(some.integers(0, 2**32))
def test_an_interaction_is_the_difference_of_differences(seed):
    random = np.random.default_rng(seed)
    a, b = np.repeat(["1", "2"], 6), np.tile(["1", "2", "3"], 4)
    values = random.normal(size=12)
    factors = {"a": a.tolist(), "b": b.tolist()}
    fit = fit_effects(values, factors, np.zeros(12, np.intp), interaction=True)
    cell = {(i, j): values[(a == i) & (b == j)].mean() for i in "12" for j in "123"}
    expected = [cell["2", j] - cell["2", "1"] - cell["1", j] + cell["1", "1"] for j in "23"]
    crossed = fit.factors[-1]
    assert [e.value for e in crossed.effects] == pytest.approx(expected)
    assert [e.level for e in crossed.effects] == ["2 x 2", "2 x 3"]
    assert np.abs(fit.residuals).max() < 10


def test_least_squares_has_a_stated_reason():
    random = np.random.default_rng(0)
    values, factors, blocks, _ = experiment(random, 3, 2, 3, 1)
    for own, reason in ((blocks, "second block of each"), (0 * blocks, "all presses")):
        fit = fit_effects(values, factors, own)
        assert fit.model == "least squares"
        assert reason in fit.reason
        assert fit.block_std is None
    values, factors, blocks, _ = experiment(random, 2, 2, 40, 2)
    values -= np.array([values[blocks == b].mean() for b in range(4)])[blocks]
    fit = fit_effects(values, factors, blocks)
    assert (fit.block_std, "no more than the presses" in fit.reason) == (0.0, True)
    assert fit.factors[0].effects[0].degrees == 2


def test_what_cannot_be_separated_is_refused():
    names = ["1", "1", "2", "2"]
    values, one = np.array([1.0, 2.0, 3.0, 5.0]), np.zeros(4, np.intp)
    for factors, interaction, words in (
        ({"a": names, "b": names}, False, "change together"),
        ({"a": ["1"] * 4}, False, "no factor has two levels"),
        ({"a": ["1", "2", "3", "4"]}, False, "no degree of freedom"),
        ({"a": names, "b": ["1", "2", "2", "2"]}, True, "omit the interaction"),
    ):
        with pytest.raises(AnalysisError, match=words):
            fit_effects(values, factors, one, interaction=interaction)
    with pytest.raises(AnalysisError, match="0 of 4 presses have this value"):
        fit_effects(np.full(4, np.nan), {"a": names}, one)
    with pytest.raises(AnalysisError, match="no spread"):
        fit_effects(np.ones(4), {"a": names}, one)


@pytest.fixture(scope="module")
def presses(write_session, tmp_path_factory):
    """Presses of a design whose force is 5 % larger at the level `thick`."""
    folder, paths = tmp_path_factory.mktemp("design"), []
    factors = {"plectrum": {"thick": {}, "thin": {}}, "hold": ["point", "normal"]}
    rows = st.design(factors, block="plectrum", seed=1, set_ups=2).rows(RIG)
    for number, row in enumerate(rows, 1):
        scale = 1.05 if row.levels["plectrum"] == "thick" else 1.0
        paths += write_session(
            folder, 1, first=number, scale=scale, levels=row.levels, block=row.block
        )
    return paths


@pytest.mark.slow
def test_of_recordings_in_python_and_as_a_command(presses, tmp_path, monkeypatch, capfd):
    found = Session(presses).effects(["release_force", "force_slope"])
    effect = found_in(found.fitted["release_force"])["plectrum", "thin"]
    means = found.fitted["release_force"].factors[0].means
    assert effect.low <= means[0].value * (1 / 1.05 - 1) <= effect.high
    assert max(map(len, wrapped(str(found)).split("\n"))) <= WIDTH
    assert found.document["factors"] == {"plectrum": ["thick", "thin"], "hold": ["normal", "point"]}
    frame = found.to_frame()
    assert frame.loc[("release_force", "plectrum", "thin"), "value"] == effect.value
    monkeypatch.chdir(tmp_path)
    words = ["effects", *map(str, presses), "--of", "release_force", "--plot", "e.png"]
    assert app([*words, "--interaction"], exit_on_error=False) == 0
    assert "plectrum x hold, p" in capfd.readouterr().out
    assert (tmp_path / "e.png").stat().st_size > 10_000


def test_folders_of_imported_presses_are_blocks(write_session, tmp_path):
    """Two set-ups of each plectrum, 0.1 N apart, leave its effect within that distance."""
    paths = []
    for folder, thickness, scale in (
        ("a", "0.47 mm", 1.0),
        ("b", "0.47 mm", 1.1),
        ("c", "0.52 mm", 1.1),
        ("d", "0.52 mm", 1.0),
    ):
        rig = with_values(RIG, {"plectrum.thickness": thickness})
        paths += write_session(tmp_path / folder, 2, rig=rig, scale=scale)
    found = Session(paths).effects(["release_force"])
    assert found.blocks.tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    assert found.order["plectrum.thickness"] == ("0.00047 m", "0.00052 m")
    (effect,) = found_in(found.fitted["release_force"]).values()
    assert effect.low < -0.1 < 0.1 < effect.high


def test_presses_without_factors_and_unknown_features(presses, write_session, tmp_path):
    with pytest.raises(AnalysisError, match="do not differ"):
        Session(write_session(tmp_path, 2)).effects()
    with pytest.raises(AnalysisError, match="release_farce: no such feature"):
        Session(presses).effects(["release_farce"])
    with pytest.raises(AnalysisError, match="different factors"):
        Session([*presses, *write_session(tmp_path / "other", 1)]).effects()
