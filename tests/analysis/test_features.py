"""The flat row of features of a press."""

import json
import math
from dataclasses import replace

import pytest

from sautereau.analysis.phases import find_phases
from sautereau.analysis.press.features import OF_SATURATED, UNITS, features, gain_stds, std_of
from sautereau.analysis.press.string_start import OF_START
from sautereau.analysis.results.press import press_summary
from sautereau.analysis.session.analysed import analyse_file
from sautereau.analysis.session.conditions import analyse
from sautereau.rig.load import with_values


@pytest.fixture(scope="module")
def found(make_press):
    press = make_press()
    phases = find_phases(press)
    return press, phases, features(press, phases)


def test_a_row_has_a_column_for_every_unit(found):
    *_, row = found
    assert set(row) == set(UNITS)
    optional = ("bottomed", "returned", "held_speed_error", "rest_force", *OF_START)
    # It has no planned motion and no sensor of the string, and the rest before it is too short.
    assert None not in {row[name] for name in row if name not in optional}
    json.dumps(row, allow_nan=False)


def test_the_numbers_are_those_of_the_press(found):
    """Closed forms: a jack at 72 mm/s, and a force that rises by 27 N/s for 20 ms."""
    press, _, row = found
    key = press.rig.key
    assert row["pluck_duration"] == pytest.approx(0.020, rel=1e-3)
    assert row["release_rise"] - row["contact_rise"] == pytest.approx(0.072 * 0.020, rel=1e-3)
    lever = key.laser_arm / key.jack_arm
    assert row["held_deflection"] == pytest.approx(0.072 * 0.020 * lever, rel=0.02)
    travel = 0.072 * 0.020 * key.press_arm / key.jack_arm
    assert row["held_work"] == pytest.approx((0.33 + 27 * 0.020 / 2) * travel, rel=0.02)
    assert row["press_work"] > row["held_work"]
    assert row["force_slope"] == pytest.approx(27 / (0.072 * lever), rel=0.02)


@pytest.mark.parametrize("contact", [0.0521, 0.0525, 0.0529])
def test_the_work_of_few_samples_reaches_from_contact_to_release(make_press, contact):
    """At 1 kHz up to a twentieth of the pluck lies before the first and behind the last sample."""
    times = {"contact": contact, "release": contact + 0.02}
    fine, coarse = (make_press(rate=rate, **times) for rate in (51_200.0, 1000.0))
    (pluck,) = (phases := find_phases(fine)).plucks
    exact = replace(pluck, **times, contact_force=0.33, release_force=0.33 + 27 * 0.02)
    known = replace(phases, plucks=(exact,))
    work = features(coarse, known)["held_work"]
    assert work == pytest.approx(features(fine, known)["held_work"], rel=2e-3)


def test_a_press_has_the_uncertainties_of_its_fit_and_of_its_sensors(found):
    press, phases, row = found
    gains, held = gain_stds(press.rig), phases.plucks[0]
    both = math.hypot(held.contact_std, held.release_std)
    assert std_of(row, "pluck_duration", gains) == pytest.approx(both)
    assert std_of(row, "release", gains) == held.release_std
    force = row["release_force"] * press.rig.daq.channel("force").gain_std
    unseen = row["unseen_force"]  # Its force at rest is 0, of a key that has a weight
    late = (row["release_force"] - row["contact_force"]) / held.pluck_duration * held.release_std
    assert std_of(row, "release_force", gains) == pytest.approx(math.hypot(force, unseen, late))
    travel = row["held_work"] / (row["contact_force"] + row["release_force"]) * 2
    late = row["held_work"] / held.pluck_duration * both
    work = math.hypot(row["held_work"] * gains["held_work"], unseen * travel, late)
    assert std_of(row, "held_work", gains) == pytest.approx(work)
    assert std_of(row, "plucks", gains) is std_of({}, "release_force_2", gains) is None


def test_what_ac_coupling_hides_of_the_force_is_named(make_press, paper):
    """A finger that rests on the key with 0.1 N, which is subtracted as the force at rest."""
    seen, less = find_phases(make_press()), find_phases(make_press(level=0.33 - 0.1))
    assert less.unseen_force - seen.unseen_force == pytest.approx(0.1, abs=2e-3)
    assert f"needs {abs(less.unseen_force):.2g} N" in less.remarks[0]


@pytest.mark.parametrize(("offset", "said"), [(0.0, False), (0.4, True), (-0.2, True)])
def test_a_zero_of_the_force_that_the_ranges_of_the_rig_do_not_explain(
    make_press, paper, offset, said
):
    """The free key needs 0.08 N by the rig; without AC coupling its level is as measured."""
    channels = tuple(c.model_copy(update={"high_pass": 0.0}) for c in paper.daq.channels)
    rig = paper.model_copy(update={"daq": paper.daq.model_copy(update={"channels": channels})})
    found = find_phases(replace(make_press(level=0.08 + offset), rig=rig))
    assert found.unseen_force is None
    texts = [text for text in found.warnings if "the zero of the sensor is wrong" in text]
    assert len(texts) == said
    if said:
        assert f"and {0.08 + offset:.2g} N were measured" in texts[0]
        low, high = map(float, texts[0].split("needs ")[1].split(" N")[0].split(" to "))
        # 8 mN m less gravity; 6 g more of jack, friction of 40 mN and 2.5 mN m more.
        assert low < 0.08 - 8e-3 / 0.171 < 0.08 + (0.1 * 0.215 + 2.5e-3) / 0.171 < high + 5e-3
    exact = find_phases(replace(make_press(level=0.3), rig=rig.model_copy(update={"assumed": {}})))
    assert any("the free key needs 0.079 N by the rig" in text for text in exact.warnings)


def test_wrong_gains_change_features_by_their_uncertainties(make_press, paper):
    """Gains that are wrong by two different factors, and exact ones."""
    press = make_press()
    names = {"daq.channels.0.gain_std": 0.02, "daq.channels.1.gain_std": 0.03}
    stds = gain_stds(with_values(paper, names))
    gains = {c.quantity: gain for c, gain in zip(paper.daq.channels, (0.02, 0.03), strict=True)}
    right = features(press, find_phases(press))
    found = dict.fromkeys(stds, 0.0)
    for wrong, gain in gains.items():
        scaled = {q: press.data[q].to_numpy() * (1 + gain * (q == wrong)) for q in gains}
        other = make_press.build(scaled["velocity"], scaled["force"], press.rate)
        row = features(other, find_phases(other))
        assert row["release"] == pytest.approx(right["release"], abs=0.02e-3)
        assert row["contact"] == pytest.approx(right["contact"], abs=right["contact_std"] * 2)
        for name in stds:
            found[name] = math.hypot(found[name], row[name] / right[name] - 1)
    assert found.pop("force_drop") < 1.1 * stds.pop("force_drop")
    assert found == pytest.approx(stds, rel=0.1)


def test_a_press_without_a_pluck_has_empty_columns(make_press):
    press = make_press(slope=0)
    row = features(press, find_phases(press))
    assert set(row) == set(UNITS)
    assert row["plucks"] == 0
    assert row["contact"] is None
    assert row["held_work"] is None
    assert row["press_work"] > 0


def test_columns_of_later_plucks_end_in_their_number(found):
    press, phases, _ = found
    row = features(press, replace(phases, plucks=phases.plucks * 2))
    assert row["plucks"] == 2
    assert row["contact_2"] == row["contact"]
    assert {name.removesuffix("_2") for name in row} == set(UNITS)


def test_forces_of_a_press_that_saturates_are_unknown(write_session, tmp_path):
    """A force of 0.73 N on an input of 0.6 V: it is unknown, the instants are not."""
    low = with_values(write_session.one.rig, {"daq.channels.1.range": "0.6 V"})
    paths = [*write_session(tmp_path, 1), *write_session(tmp_path / "low", 1, rig=low)]
    good, bad = (analyse_file(path) for path in paths)
    lost = {name for name, value in bad.features.items() if value is None}
    assert lost - {n for n, v in good.features.items() if v is None} == {
        *(set(OF_SATURATED) & set(UNITS)),
        "peak_force",
        "press_work",
    }
    assert bad.features["release"] == pytest.approx(good.features["release"], abs=1e-3)
    (condition,) = analyse([bad]).conditions
    assert "saturated" in " ".join(condition.warnings)
    document = press_summary(bad.press, bad.phases)
    assert document["forces"]["release"] is document["plucks"][0]["force_drop"] is None
