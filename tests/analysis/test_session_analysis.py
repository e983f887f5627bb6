"""One analysis of a session: what is pooled, what agrees, and the difference of two sets."""

import re
import shutil
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from scipy.stats import ttest_ind

import sautereau as st
from sautereau.analysis.campaign.run import run_campaign
from sautereau.analysis.errors import AnalysisError, ModelError
from sautereau.analysis.report.contents import gather
from sautereau.analysis.results.comparison import Comparison, pair_lines
from sautereau.analysis.session.analysed import analyse_file
from sautereau.analysis.session.conditions import analyse
from sautereau.analysis.session.difference import difference, side_by_side
from sautereau.analysis.session.pooled import pooled_features
from sautereau.analysis.text import WIDTH, wrapped
from sautereau.rig.instrument import Choir
from sautereau.rig.load import with_values
from sautereau.sim_backend.scene import load_scene


@pytest.fixture(scope="module")
def four(write_session, tmp_path_factory):
    """Four analysed presses of one condition, and their recordings."""
    folder = tmp_path_factory.mktemp("four")
    paths = write_session(folder, 4, session="one", started="2026-03-01T22:00:00+00:00")
    return folder, [analyse_file(path) for path in paths]


def varied(presses, **changes):
    """Return presses with another session, scene or date."""
    return [replace(press, session=replace(press.session, **changes)) for press in presses]


def on_rig(presses, rig):
    return [replace(one, press=replace(one.press, rig=rig)) for one in presses]


def test_report_comparison_and_table_have_the_same_digits(four, tmp_path):
    """All of them show what one function returns."""
    folder, presses = four
    found = Comparison(analyse(presses)).document
    session = st.open(folder)
    assert session.compare().document == found
    contents = gather([press.path for press in session], "elastica")
    assert Comparison(contents).document == found
    frame = session.features
    mean = found["conditions"][0]["features"]["release_force"]["measured"]
    assert frame["release_force"].mean() == pytest.approx(mean, rel=1e-15)
    campaign = run_campaign(folder, tmp_path / "table.parquet").campaign
    assert list(campaign.data["release_force"]) == list(frame["release_force"])
    assert session.compare().features.loc[(1, "release_force"), "mean"] == mean
    assert found["repeatability"]["presses"] == 4


def test_the_plots_show_a_prediction_for_the_measured_speed(four):
    presses = four[1]
    (condition,) = analyse(presses).conditions
    (first,) = analyse(presses[:1]).conditions
    found, pluck = condition.prediction, presses[0].phases.plucks[0]
    error = found.pluck_duration / pluck.pluck_duration - 1
    assert first.comparison.duration_error.value == pytest.approx(error)


@pytest.mark.parametrize("call", ["compare", "report"])
def test_an_unknown_level_is_refused_at_the_call(four, tmp_path, call):
    options = {"out": tmp_path / "report.html"} if call == "report" else {}
    with pytest.raises(ModelError, match=r"'xx' is unknown; known: auto, elastica, fe, rods"):
        getattr(st.open([press.press.path for press in four[1]]), call)(level="xx", **options)


def test_what_the_model_cannot_predict_is_not_compared(four):
    """A jack that stops while its string is held has no speed as a function of its rise."""
    presses = list(four[1])
    presses[1] = replace(presses[1], press=replace(presses[1].press, warnings=("a drift",)))
    path = presses[2].press.path.with_name("stopped.mcap")
    presses[2] = replace(presses[2], speeds=(), press=replace(presses[2].press, path=path))
    (condition,) = analyse(presses).conditions
    assert condition.comparison.presses == 3
    without = analyse([*presses[:2], presses[3]]).conditions[0]
    assert condition.features == without.features
    text = "\n".join(condition.warnings)
    assert "not compared: stopped.mcap: the jack stops or turns back" in text
    assert "results are doubtful in 1 of 3 presses" in text


def test_a_press_without_a_pluck_is_named_where_others_have_one(four):
    presses = list(four[1])
    silent = replace(presses[1].phases, plucks=())
    path = presses[1].press.path.with_name("silent.mcap")
    press = replace(presses[1].press, path=path)
    presses[1] = replace(presses[1], speeds=(), press=press, phases=silent)
    (condition,) = analyse(presses).conditions
    assert condition.comparison.presses == 3
    assert "not compared: silent.mcap: no pluck was found" in "\n".join(condition.warnings)


@pytest.mark.parametrize("factor", [0.75, 0.99])
def test_a_plectrum_changed_within_a_session_is_named(four, factor):
    """The mean of two plectra is that of none, whether the ranges contain it or not."""
    random = np.random.default_rng(0)
    force = 0.8 * (1 + 2e-4 * random.standard_normal(8)) * np.where(np.arange(8) > 4, factor, 1)
    made = changed(four, "release_force", force)
    (condition,) = analyse(made).conditions
    large = factor < 0.9  # beyond the sensors' uncertainty, which all presses share
    said = condition.comparison.unlike_rig if large else condition.warnings
    (text,) = (each for each in said if "release force" in each)
    assert "between 4.mcap and 5.mcap" in text
    assert condition.comparison.consistent is (not large)
    (alone,) = analyse(made[:5]).conditions
    assert not any("changes" in each for each in (*alone.comparison.unlike_rig, *alone.warnings))


def changed(four, name, values):
    """Return presses with these values of a feature, and the files `0.mcap` and so on."""
    made = []
    for number, value in enumerate(values):
        press = four[1][number % 4]
        path = press.press.path.with_name(f"{number}.mcap")
        features = {**press.features, name: float(value)}
        made.append(replace(press, press=replace(press.press, path=path), features=features))
    return made


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (1.94e-3 + 0.15e-3 * (np.arange(8) > 3), ("changes from 1.94", "3.mcap and 4.mcap")),
        (1.94e-3 + 0.36e-3 * (np.arange(8) % 2), ("varies from 1.9", "to 2.3")),
    ],
)
def test_another_rise_at_contact_within_a_session_is_named(four, values, words):
    """The clearance moves once, or two keys alternate, 5 um from press to press."""
    values = values + 5e-6 * np.random.default_rng(0).standard_normal(8)
    (condition,) = analyse(changed(four, "contact_rise", values)).conditions
    (text,) = (each for each in condition.comparison.unlike_rig if "rise at contact" in each)
    assert all(word in text for word in words)
    assert not condition.comparison.consistent


def test_a_drift_is_given_with_its_total(four):
    """A plectrum that loses 6 % of its force over 60 presses."""
    random, release = np.random.default_rng(0), 0.8 * (1 - 0.06 * np.arange(60) / 59)
    values = release + 2e-3 * random.standard_normal(60)
    found = analyse(changed(four, "release_force", values))
    (text,) = (each for each in found.conditions[0].comparison.unlike_rig if "drifts" in each)
    total, percent, low, high = (float(x) for x in re.findall(r"[+-][0-9.]+", text))
    assert total == pytest.approx(-0.048, rel=0.05)
    assert percent == pytest.approx(-6.2, abs=0.3)  # of the mean
    assert low < percent < high
    assert text in " ".join(Comparison(found).lines())


def test_equal_presses_have_no_change(four):
    """With the scatter of presses of the stand-in, of 200 sets."""
    random, said = np.random.default_rng(5), 0
    for _ in range(200):
        row = {"plucks": 1, "string": 1}
        rows = [row | {"contact_rise": v} for v in 2e-3 + 5e-6 * random.standard_normal(6)]
        features = pooled_features(rows, {}, {"contact_rise": 0.02})
        (one,) = (f for f in features if f.name == "contact_rise")
        said += bool(one.step or one.scatters or one.drifts)
    assert said <= 0.01 * 200 + 3 * np.sqrt(0.01 * 200)


def test_remarks_of_the_presses_are_counted_or_listed(four):
    press = four[1][0]
    remarked = replace(press, phases=replace(press.phases, remarks=("hum", "drift")))
    found = Comparison(analyse([remarked, *four[1][1:]]))
    of_others = sum(len(one.remarks) for one in (*four[1][1:], remarked))
    assert any(line == f"remark: {press.press.path}: hum" for line in found.lines())
    (said,) = (line for line in found.lines(remarks=False) if "remark" in line)
    assert said.startswith(f"{of_others} remarks")


def test_presses_without_an_arm_have_no_plan_to_repeat(four):
    imported = varied(four[1], controller="imported from a.csv", daq="imported from a.csv")
    (condition,) = analyse(imported).conditions
    assert condition.repeatability is None
    assert condition.comparison.presses == 4


def test_only_presses_of_one_rig_one_scene_and_one_day_are_pooled(four):
    _, presses = four
    rig = presses[0].press.rig
    other = with_values(rig, {"plectrum.thickness": "0.5 mm"})
    moved = with_values(rig, {"daq.address": "host:1"})
    scene = load_scene("ideal").model_dump_json()
    mixed = [
        *on_rig(presses[:1], moved),
        *on_rig(presses[:1], other),
        *varied(presses[:1], scene=scene, session="two"),
        *varied(presses[:1], started="2026-03-02T08:00:00+00:00", session="three"),
        *varied(presses[:1], started="2026-03-02T00:10:00+00:00"),  # after midnight
        *varied(presses[:1], started="2026-03-01T08:00:00+00:00", session="four"),
    ]
    found = analyse(mixed)
    assert [len(condition.presses) for condition in found.conditions] == [3, 1, 1, 1]
    first, *others = (set(condition.changed) for condition in found.conditions)
    assert first == set()
    assert others[0] == {"plectrum.thickness"}
    assert {"scene.finger", "scene.string"} <= others[1]
    assert others[2] == {"day"}
    assert found.conditions[0].warnings == ("presses of 2 sessions of one day are pooled",)


def released(force):
    """Return the features of a press with a pluck of string 1."""
    return {"plucks": 1, "string": 1, "release_force": force}


def test_drift_and_spread_of_a_known_series():
    random = np.random.default_rng(1)
    values = 0.7 + 0.01 * np.arange(8) + 1e-4 * random.standard_normal(8)
    (feature,) = pooled_features([released(v) for v in values.tolist()], {}, {})
    assert feature.std == pytest.approx(values.std(ddof=1))
    assert feature.drift.significant
    assert feature.drift.low < 0.01 < feature.drift.high
    assert feature.predicted is None


def test_an_interval_of_a_mean_contains_what_all_presses_share():
    """Equal presses: what is left is the gain of 2 %, and 30 mN that AC coupling hides."""
    rows = [released(1.5) | {"unseen_force": 0.03}] * 4
    (feature,) = (f for f in pooled_features(rows, {}, {"release_force": 0.02}) if f.name[0] == "r")
    std = np.hypot(0.02 * 1.5, 0.03)
    assert feature.measured.high - 1.5 == pytest.approx(1.96 * std, rel=1e-3)
    assert 1.5 - feature.measured.low == pytest.approx(1.96 * std, rel=1e-3)


def test_a_difference_has_welchs_interval():
    random = np.random.default_rng(2)
    a, b = random.normal(1.0, 0.1, 5), random.normal(0.8, 0.3, 9)
    first, second = (
        pooled_features([released(v) for v in values.tolist()], {}, {})[0] for values in (a, b)
    )
    found = difference(first, second)
    expected = ttest_ind(a, b, equal_var=False).confidence_interval(0.95)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high))
    assert found.value == pytest.approx(a.mean() - b.mean())
    alone = pooled_features([released(1.0)], {}, {})[0]
    assert (difference(first, alone).low, difference(first, alone).significant) == (None, False)
    same = pooled_features([released(1.0)] * 3, {}, {})[0]
    assert (difference(same, same).low, difference(same, same).high) == (0, 0)


def test_a_difference_has_what_the_fit_may_do_to_a_set_but_no_gains():
    """Equal presses: both sets' slopes have 3 and 4 N/m of the fit, and gains of 2 %."""
    first, second = (
        next(
            feature
            for feature in pooled_features(
                [released(1.5) | {"force_slope": 900.0, "force_slope_std": std}] * 3,
                {},
                {"force_slope": 0.02},
            )
            if feature.name == "force_slope"
        )
        for std in (3.0, 4.0)
    )
    found = difference(first, second)
    assert first.shared_std == pytest.approx(np.hypot(18, 3))
    assert found.high == pytest.approx(1.96 * 5, rel=1e-3)
    assert found.low == pytest.approx(-1.96 * 5, rel=1e-3)


def test_conditions_of_two_sets_are_paired_by_what_varies(four):
    _, presses = four
    rig = presses[0].press.rig
    fast = with_values(rig, {"press.jack_speed": "0.08 m/s"})
    thick = {"plectrum.thickness": "0.5 mm"}
    first = analyse([*presses[:2], *on_rig(presses[:2], fast)])
    second = analyse(
        [*on_rig(presses, with_values(fast, thick)), *on_rig(presses[:2], with_values(rig, thick))]
    )
    pairs = side_by_side(first, second)
    assert [pair.first.rig.press.jack_speed for pair in pairs] == [0.072, 0.08]
    assert [set(pair.changed) for pair in pairs] == [{"plectrum.thickness"}] * 2
    assert pair_lines(pairs[1])[0] == "press.jack_speed = 0.08 m/s:"
    assert "press.jack_speed = 0.072 m/s:" in Comparison(first).lines()
    other = analyse(on_rig(presses, with_values(rig, {"press.jack_speed": "0.06 m/s"})))
    with pytest.raises(AnalysisError, match=r"not pooled[\s\S]*jack_speed = 0\.08 m/s"):
        side_by_side(first, other)
    days = analyse([*presses, *varied(presses, session="b", started="2026-03-05")])
    with pytest.raises(AnalysisError, match="2026-03-01 and 2026-03-05 are not pooled"):
        side_by_side(days, first)
    (pair,) = side_by_side(analyse(presses), analyse(on_rig(presses, with_values(rig, thick))))
    assert set(pair.changed) == {"plectrum.thickness"}
    assert all(one.value == 0 for one in pair.differences)
    assert "plectrum.thickness: 480 µm and 500 µm" in pair_lines(pair)[0]


def test_a_string_that_another_set_lacks_is_one_difference(four):
    """Each of its 30 values was one, `None` in the other set, and an empty name was no word."""
    _, presses = four
    rig = presses[0].press.rig
    second = Choir(jack_arm="235 mm", jack=rig.jack, plectrum=rig.plectrum, string=rig.string)
    named = with_values(rig, {"string.name": "8' back"})
    double = named.model_copy(update={"more_choirs": (second,)})
    (pair,) = side_by_side(analyse(presses), analyse(on_rig(presses, double)))
    assert set(pair.changed) == {"string.name", "more_choirs"}
    line = pair_lines(pair)[0]
    assert "string.name: none and 8' back; more_choirs: none and given" in line
    assert max(map(len, wrapped(line).splitlines())) <= WIDTH
    both = analyse([*presses, *on_rig(presses, double)])
    assert both.label(both.conditions[1]) == "string.name = 8' back, more_choirs = given"


def test_sessions_open_from_folders_patterns_lists_and_tables(four, tmp_path):
    folder, _ = four
    both = st.open(folder).compare(folder)
    assert repr(both) == "<Comparison of 4 presses against 4 presses, 1 condition>"
    run_campaign(folder, tmp_path / "table.parquet")
    for what in (folder, f"{folder}/*.mcap", sorted(folder.glob("*.mcap")), [folder]):
        assert [press.path.name for press in st.open(what)][:1] == ["press-0001.mcap"]
        assert len(st.open(what)) == 4
    assert len(st.open(tmp_path / "table.parquet", folder=folder)) == 4
    for what in (tmp_path, "none-*.mcap", tmp_path / "table.parquet"):
        with pytest.raises(AnalysisError, match="give recordings"):
            st.open(what)
    with pytest.raises(AnalysisError, match="no recording was given"):
        st.open([])
    assert st.open(folder)[1:3][0].info.press == 2


def test_a_watched_folder_gives_each_recording_once(four, tmp_path):
    folder, _ = four
    names = iter(sorted(folder.glob("*.mcap")))

    def arrive(seconds):
        assert seconds > 0
        shutil.copy(next(names), tmp_path)
        (tmp_path / "press-0009.mcap").write_bytes(b"cut short")

    found = [(len(s), len(s.warnings)) for s in islice(st.watch(tmp_path, arrive), 3)]
    assert found == [(1, 1), (2, 1), (3, 1)]
    with pytest.raises(AnalysisError, match="there is no such folder; give the folder"):
        st.watch(tmp_path / "none")
    with pytest.raises(AnalysisError, match="this is not a folder; give the folder"):
        st.watch(tmp_path / "press-0009.mcap")


@pytest.mark.slow
def test_many_conditions_are_one_bounded_picture(four):
    """The plot of a design: also of 60 conditions it is at most 12 inches by 10."""
    presses, rig = four[1], four[1][0].press.rig
    changed = [with_values(rig, {"jack.mass": f"{6 + 0.1 * k} g"}) for k in range(60)]
    found = Comparison(analyse([one for own in changed for one in on_rig(presses[:1], own)]))
    figure = found.plot()
    width, height = figure.get_size_inches()
    assert width <= 12
    assert height <= 10
    assert "60 presses in 60 conditions, the first 40 of them" in figure.get_suptitle()
    labels = [label.get_text() for label in figure.axes[1].get_yticklabels()]
    assert labels[:2] == ["6 g", "6.1 g"]
    assert len(found.plot(2).axes) < len(Comparison(analyse(presses)).plot().axes) + 1


def test_a_rig_of_another_instrument_is_named(four):
    """Not one whose values may be equal by the ranges of both rigs."""
    presses, own = four[1], four[1][0].press.rig
    other = with_values(own, {"key.press_arm": "100 mm", "string.tension": "150 N"})
    (condition,) = analyse(presses, rig=other.model_copy(update={"name": "spinet"})).conditions
    (said,) = condition.comparison.unlike_rig
    for words in ("spinet is not", "2 values of key, string", "key.press_arm = 100 mm, recorded"):
        assert words in said
    assert not condition.comparison.consistent
    low, high = own.assumed["plectrum.overlap"]
    near = with_values(own, {"plectrum.overlap": f"{0.9 * high + 0.1 * low} m"})
    (condition,) = analyse(presses, rig=near).conditions
    assert condition.comparison.unlike_rig == ()


@pytest.mark.slow
def test_processes_read_the_same(four):
    folder, presses = four
    read, faults = st.open(folder).readable(processes=2)
    assert (faults, [p.analysed.features for p in read]) == ([], [p.features for p in presses])
