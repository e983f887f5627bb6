"""A spinet of two strings: whatever shows, pairs, pools or fits plucks knows whose they are.

String 2 is touched second. As the rig has it, it is released first; with other overlaps, second.
"""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.spinet import SPINET, SPINET_TEXT
from sautereau.analysis.campaign.row import plectrum_id, row_of
from sautereau.analysis.campaign.table import empty_campaign
from sautereau.analysis.campaign.touch import find_touch
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.figures.comparison import comparison_figure
from sautereau.analysis.figures.phases import phases_figure
from sautereau.analysis.identify.identified import identify
from sautereau.analysis.identify.parameters import check_names
from sautereau.analysis.model.choirs import choirs
from sautereau.analysis.model.predict import predict
from sautereau.analysis.phases import find_phases
from sautereau.analysis.phases.found import stretches
from sautereau.analysis.press.features import by_string, features
from sautereau.analysis.press.replay import replay
from sautereau.analysis.report import figures
from sautereau.analysis.report.build import About, build_report
from sautereau.analysis.report.contents import gather
from sautereau.analysis.report.slow_motion import readings
from sautereau.analysis.results.comparison import Comparison
from sautereau.analysis.results.prediction import Prediction
from sautereau.analysis.results.press import HEADER, press_line, press_summary
from sautereau.analysis.session.analysed import analyse_recording
from sautereau.analysis.session.conditions import analyse
from sautereau.analysis.text import concise
from sautereau.daq.file.recorded import Block
from sautereau.daq.file.recording import Recording
from sautereau.rig.errors import RigError
from sautereau.rig.load import parse_rig, with_values
from tests.spinet import recorded_spinet, spinet_press

REVERSED = {"plectrum.overlap": "0.28 mm", "more_choirs.0.plectrum.overlap": "0.3 mm"}
"""Of a spinet whose string 1 is released first, within what the rig is known to."""


@pytest.fixture(scope="module")
def recordings():
    """Return four presses, of which two have the other order of releases."""
    return [recorded_spinet(seed, **(REVERSED if seed % 2 else {})) for seed in range(4)]


@pytest.fixture(scope="module")
def analysed(recordings):
    return [analyse_recording(recorded) for recorded, _ in recordings]


@pytest.fixture(scope="module")
def written(recordings, tmp_path_factory):
    """Return the paths of the presses' files."""
    folder, paths = tmp_path_factory.mktemp("spinet"), []
    for number, (one, _) in enumerate(recordings):
        path = folder / f"press-{number}.mcap"
        with Recording(path, one.rig, session=one.session, rate=one.rate) as recording:
            volts = [one.volts[channel.name] for channel in one.rig.daq.channels]
            recording.write_block(Block(one.first_sample, np.stack(volts)))
        paths.append(path)
    return paths


def test_every_pluck_has_its_string_in_either_order_of_releases(recordings, analysed):
    orders = []
    for (_, truth), found in zip(recordings, analysed, strict=True):
        assert [held.string for held in found.phases.plucks] == [string for string, *_ in truth]
        for held, (_, contact, release) in zip(found.phases.plucks, truth, strict=True):
            assert held.string_probability > 0.95
            assert held.contact == pytest.approx(contact, abs=0.5e-3)
            assert held.release == pytest.approx(release, abs=0.2e-3)
        first, second = found.phases.plucks
        # The string that is released last is held while the other one is released.
        said = [text for text in found.phases.remarks if "force slope" in text]
        (own,) = (text for text in said if text.startswith(f"string {second.string}: "))
        assert f"string {first.string} is released" in own
        orders.append([held.string for held in found.phases.plucks])
    assert orders == [[2, 1], [1, 2]] * 2


def test_json_and_text_name_the_string(analysed):
    press, phases = analysed[0].press, analysed[0].phases
    plucks = press_summary(press, phases)["plucks"]
    assert [pluck["string"] for pluck in plucks] == [2, 1]
    assert all(pluck["string_probability"] > 0.95 for pluck in plucks)
    lines = press_line(press, phases).splitlines()
    assert HEADER.splitlines()[-1].split()[3] == "#"
    assert (lines[0].split()[3], lines[1].split()[0]) == ("2", "1")
    row = features(press, phases)
    assert (row["string"], row["string_2"]) == (2, 1)
    assert by_string(row)["release"] == row["release_2"]
    predicted = Prediction(SPINET, predict(SPINET))
    assert [each["string"] for each in predicted.document["choirs"]] == [1, 2]
    assert "string 2 (4'): contact" in str(predicted)


def test_a_pluck_far_from_the_only_string_has_none(make_press):
    press = make_press()
    (held,) = find_phases(press).plucks
    assert held.string == 1
    far = with_values(press.rig, {"jack.string_clearance": "4.5 mm", "press.jack_rise": "12 mm"})
    assert all(each.string is None for each in find_phases(replace(press, rig=far)).plucks)


def test_an_animation_moves_the_string_that_was_plucked(recordings, analysed):
    for (_, truth), found in zip(recordings[:2], analysed, strict=False):
        releases = [release for _, _, release in truth]
        scene = replay(found.press, found.phases, np.linspace(0.07, max(releases) + 0.02, 400))
        for string, contact, release in truth:
            motion = scene.choirs[string - 1]
            lift = np.abs(motion.wire[:, 0]).max(axis=1)
            assert scene.time[np.argmax(lift > 0)] == pytest.approx(contact, abs=1.5e-3)
            held = (scene.time > contact) & (scene.time < release)
            assert lift[held].argmax() > 0.97 * held.sum()
            bent = np.ptp(motion.outline[..., 1], axis=1)
            straight = scene.time > release + 1e-3
            assert bent[held].max() > 1.2 * bent[straight].max()
        both = np.mean([max(c for _, c, _ in truth), min(releases)])
        assert scene.phase(both) in ("string 2 and string 1 held", "string 1 and string 2 held")
        last = truth[-1]
        assert scene.phase(np.mean(releases)) == f"string {last[0]} held"


def test_nothing_is_free_while_a_string_is_held():
    found = stretches([(3.0, 6.0), (2.0, 7.0), (8.0, 9.0)], 0.0, 10.0)
    names = ["free", "string held", "2 strings held", "string held", "free", "string held"]
    assert [name for *_, name in found] == [*names, "string released"]
    assert [stop for _, stop, _ in found] == [2.0, 3.0, 6.0, 7.0, 8.0, 9.0, 10.0]
    assert stretches([], 0.0, 1.0) == [(0.0, 1.0, "free")]


def test_figures_shade_how_many_strings_are_held(recordings, analysed):
    press, phases, (_, truth) = analysed[0].press, analysed[0].phases, recordings[0]
    axes = phases_figure([press], [phases]).axes[0]
    assert {"string 1 (8')", "string 2 (4')"} <= {
        label.partition(" ")[2].partition(":")[0]
        for label in (line.get_label() for line in axes.lines)
    }
    top = comparison_figure([press], [phases], predict(press.rig)).axes[0]
    shaded = [text.get_text() for text in top.texts]
    assert shaded == ["free", "string held", "2 strings held", "string held", "string released"]
    places = [text.get_position()[0] for text in top.texts]
    assert 1e3 * truth[0][1] < places[2] < 1e3 * truth[0][2]


def test_a_report_shows_each_string(written, recordings):
    found = gather(written[:2], "auto")
    shapes = json.loads(figures.over_time(found).to_json())["layout"]["shapes"]
    names = {shape["name"] for shape in shapes}
    assert names == {"free", "string held", "2 strings held", "string released"}
    first = min(contact for _, truth in recordings[:2] for _, contact, _ in truth)
    free = max(shape["x1"] for shape in shapes if shape["name"] == "free")
    assert free == pytest.approx(first * 1e3, abs=0.3)
    page = build_report(found, About("a session", "0.1.0"))
    for text in ("release (ms), string 1 (8&#39;)", "release (ms), string 2 (4&#39;)"):
        assert text in page
    assert "string 2 (4&#39;): jack head" in page
    assert "choir 1" not in page
    phases = readings(found.slow_motion)["phase"]
    assert "string 2 and string 1 held" in phases
    assert all(set(record.held) == {1, 2} for record in found.presses)


def test_a_comparison_pairs_each_string_with_its_own_model(analysed):
    found = analyse(analysed)
    (condition,) = found.conditions
    assert condition.comparison.string == 1
    assert condition.comparison.presses == 4
    by_name = {feature.name: feature for feature in condition.features}
    for string, choir in enumerate(predict(SPINET).choirs, 1):
        suffix = "" if string == 1 else f"_{string}"
        rise = by_name[f"contact_rise{suffix}"]
        assert rise.presses == 4
        assert rise.measured.value == pytest.approx(rise.predicted, rel=0.02)
        assert rise.measured.value == pytest.approx(choir.contact * 0.03, rel=0.02)
        assert rise.std < 0.02e-3
    said = str(Comparison(found))
    assert "string 1 (8'), 4 presses" in said
    assert "jack rise at contact (mm), string 2 (4')" in said


def test_a_campaign_gives_each_pluck_the_plectrum_of_its_string(analysed):
    for found in analysed:
        row = row_of(found, Path("a.mcap"))
        for suffix, held in zip(("", "_2"), found.phases.plucks, strict=True):
            choir = choirs(SPINET)[held.string - 1]
            assert row[f"string{suffix}"] == held.string
            assert row[f"plectrum{suffix}"] == plectrum_id(SPINET, held.string)
            assert row[f"plectrum_thickness{suffix}"] == choir.plectrum.thickness
            assert row[f"string_clearance{suffix}"] == choir.jack.string_clearance


@pytest.mark.slow
def test_the_touch_of_plectra_is_that_of_their_own_strings(tmp_path):
    """Eight spinets with other plectra, every second one with the strings in the other order."""
    rows, model = [], []
    random = np.random.default_rng(1)
    for number in range(8):
        thickness, overlap = random.uniform(0.85, 1.15, (2, 2)) * [[0.5, 0.45], [0.3, 0.25]]
        clearances = ("1.5 mm", "4.5 mm") if number % 2 else ("4.5 mm", "1.5 mm")
        values = {
            "jack.string_clearance": clearances[0],
            "more_choirs.0.jack.string_clearance": clearances[1],
            "plectrum.thickness": f"{thickness[0]} mm",
            "plectrum.overlap": f"{overlap[0]} mm",
            "more_choirs.0.plectrum.thickness": f"{thickness[1]} mm",
            "more_choirs.0.plectrum.overlap": f"{overlap[1]} mm",
        }
        rig = with_values(SPINET, values).model_copy(update={"name": f"spinet {number}"})
        model += [
            (
                choir.plectrum.thickness,
                choir.plectrum.overlap,
                each.string_force.max() * choir.jack_arm / rig.key.press_arm,
            )
            for choir, each in zip(choirs(rig), predict(rig).choirs, strict=True)
        ]
        for press in range(2):
            recorded, truth = recorded_spinet(10 * number + press, rig)
            found = analyse_recording(recorded)
            assert [h.string for h in found.phases.plucks] == [string for string, *_ in truth]
            row = row_of(found, Path(f"{number}-{press}.mcap"))
            rows.append(row | {"session": f"s{number}", "size": 1, "mtime": 1})
    campaign = empty_campaign(tmp_path / "campaign.parquet", "test").grown(rows, ())
    campaign.write()
    touch = find_touch(campaign)
    assert touch.presses == len(rows)
    assert len(touch.plectra) == 16
    assert {plectrum.presses for plectrum in touch.plectra} == {2}
    forces = {thickness: force for thickness, _, force in model}
    for plectrum in touch.plectra:
        own = forces[plectrum.shape["plectrum_thickness"]]
        assert plectrum.felt["force_drop"].value == pytest.approx(own, rel=0.05)
    *shape, force = np.log(np.array(model)).T
    strings = np.tile(np.eye(2), (8, 1)).T
    expected = np.linalg.lstsq(np.stack([*shape, *strings], 1), force, rcond=None)[0]
    exponents = touch.felt["force_drop"].exponents
    for name, exponent in zip(("thickness", "overlap"), expected, strict=False):
        assert exponents[f"plectrum_{name}"].value == pytest.approx(exponent, abs=0.15)


@pytest.fixture(scope="module")
def shallower():
    """Return presses of a spinet whose string 2 has another overlap than the rig says."""
    truth = {"more_choirs.0.plectrum.overlap": "0.18 mm"}
    return [spinet_press(seed, **truth)[0] for seed in range(2)]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["string2.plectrum.overlap", "more_choirs.0.plectrum.overlap"])
def test_a_parameter_of_string_2_is_fitted(shallower, name):
    phases = [find_phases(press) for press in shallower]
    found = identify(shallower, phases, [name], starts=1)
    (estimate,) = found.estimates
    assert estimate.name == "string2.plectrum.overlap"
    assert estimate.std < 0.02e-3  # of it 1 um by the noise, the rest by the ranges of the rig
    assert estimate.value == pytest.approx(0.18e-3, abs=2.5 * estimate.std)
    assert found.rig.more_choirs[0].plectrum.overlap == estimate.value
    assert found.rig.plectrum.overlap == SPINET.plectrum.overlap


def test_a_string_that_the_rig_has_not_is_named():
    check_names(["string2.plectrum.overlap", "string1.jack.string_clearance"])
    with pytest.raises(AnalysisError, match=r"string2\.key\.inertia: no parameter has this name"):
        check_names(["string2.key.inertia"])
    press, _ = spinet_press()
    with pytest.raises(AnalysisError, match=r"string3\.jack\.mass: the rig has 2 strings"):
        identify([press], [find_phases(press)], ["string3.jack.mass"])


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ('string_clearance = "2.4 mm"', 'string_clearance = "2.4 N"', "jack.string_clearance"),
        ('thickness = "0.45 mm"', 'thicknes = "0.45 mm"', "plectrum.thicknes"),
        ('plucking_point = "80 mm"', 'plucking_point = "800 mm"', "string.plucking_point"),
    ],
)
def test_a_fault_in_a_further_string_is_reported_at_its_line(old, new, key):
    assert SPINET_TEXT.count(old) == 1
    text = SPINET_TEXT.replace(old, new)
    line = text[: text.index(new)].count("\n") + 1
    with pytest.raises(RigError, match=rf"line {line}: more_choirs\.0\.{key}: "):
        parse_rig(text)


@pytest.mark.parametrize(
    ("value", "std", "shown"),
    [
        (109.2771, 0.1354, "109.28(14)"),
        (52.0, 0.05149, "52.000(51)"),
        (52.0, 0.0009, "52.000(1)"),
        (148.6, 12.4, "149(12)"),
        (0.72, 0.0996, "0.72(10)"),
        (3.0, 150.2, "3(150)"),
        (52.0, None, "52.000"),
        (52.0, math.inf, "52.000"),
    ],
)
def test_a_value_with_its_uncertainty_in_units_of_the_last_digit(value, std, shown):
    assert concise(value, std, 3) == shown
