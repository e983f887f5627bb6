"""Soft, medium, hard: known odds are recovered, and what limits the result is said."""

import json
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from sautereau.analysis.campaign.judged import find_judged, with_labels
from sautereau.analysis.campaign.row import LEVELS, touch_in
from sautereau.analysis.campaign.table import empty_campaign
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.results.touch import judged_lines

ODDS = 6.0  # Of a harder judgement, per standard deviation of the logarithm of the release force


def campaign_of(rows):
    return empty_campaign(Path("campaign.parquet"), "test").grown(rows, ())


def rows_of(sessions, presses=2, seed=0, limits=(-1.5, 1.5), noise=1.0):
    """Return rows whose judgements follow the proportional-odds model in the release force."""
    random = np.random.default_rng(seed)
    rows = []
    for s in range(sessions):
        x = random.normal()
        felt = np.log(ODDS) * x + noise * random.logistic()
        label = LEVELS[int(np.searchsorted(limits, felt))]
        for i in range(presses):
            rows.append({
                "path": f"{s}/{i}.mcap", "size": 1, "mtime": 1, "simulated": True,
                "session": f"s{s}", "plectrum": "p", "warm_up": False, "plucks": 1,
                "touch": label, "release_force": np.exp(0.2 * x),
                "held_work": 1e-4 * random.uniform(1, 2), "contact_force": -0.01 * x,
                "force_drop": None,
            })  # fmt: skip
    return rows


def test_known_odds_and_what_does_not_matter():
    pytest.importorskip("statsmodels")
    found = find_judged(campaign_of(rows_of(150)))
    assert sum(found.judgements.values()) == 150  # one per session, not per press
    force, work = found.quantities["release_force"], found.quantities["held_work"]
    assert force.odds_ratio.low < ODDS < force.odds_ratio.high
    assert force.odds_ratio.high < 3 * force.odds_ratio.low
    assert 0.5 < force.somers_d.low < force.somers_d.value < force.somers_d.high < 1
    assert force.q_value < 0.01
    assert work.odds_ratio.low < 1 < work.odds_ratio.high
    assert work.p_value > 0.01
    assert list(found.quantities)[-1] == "held_work"
    assert found.quantities["contact_force"].somers_d.value < 0  # negative values, not logarithms
    means = list(force.means.values())
    assert means == sorted(means)
    assert found.notes == ("force_drop: not compared, 0 judgements have it",)
    summary = json.loads(json.dumps(asdict(found), allow_nan=False))
    assert summary["quantities"]["release_force"]["odds_ratio"]["value"] > 1
    lines = judged_lines(found)
    assert any(line.startswith("release force (N)") for line in lines)
    assert max(map(len, lines)) <= 80


def test_judgements_are_compared_with_the_shape_that_varies():
    rows = rows_of(60)
    for row in rows:
        row["plectrum_tip_thickness"] = 3e-4 * row["release_force"] ** 0.7
        row["plectrum_length"] = 4.5e-3
    found = find_judged(campaign_of(rows))
    force, tip = (found.quantities[n] for n in ("release_force", "plectrum_tip_thickness"))
    assert tip.somers_d == force.somers_d
    assert "plectrum_length" not in found.quantities
    assert any(line.startswith("thickness of the tip (mm)") for line in judged_lines(found))


def test_levels_that_do_not_overlap_and_few_judgements():
    found = find_judged(campaign_of(rows_of(9, noise=0.0)))
    force = found.quantities["release_force"]
    assert force.separated
    assert force.odds_ratio is None
    assert force.somers_d.value == 1.0
    assert force.p_value < 0.05
    notes = "\n".join(found.notes)
    assert "release_force: the levels do not overlap" in notes
    assert "not reliable below 10 judgements" in notes
    assert "no overlap" in "\n".join(judged_lines(found))
    few = find_judged(campaign_of(rows_of(3)))
    assert not few.quantities
    assert "too few judgements" in few.notes[0]
    assert judged_lines(few)


def test_presses_of_one_session_with_several_judgements_count_each():
    rows = rows_of(6, presses=3)
    for i, row in enumerate(rows[:3]):
        row["touch"] = LEVELS[i]
    rows[3] |= {"warm_up": True}
    rows[4] |= {"plucks": 0}
    assert sum(find_judged(campaign_of(rows)).judgements.values()) == 3 + 5


@pytest.mark.parametrize("key", ["rig", "plectrum"])
def test_a_row_of_a_table_is_one_judgement_in_however_many_sessions(key, tmp_path):
    """Copies of a session must not make an association more significant."""
    path, found = tmp_path / "labels.csv", []
    once = [row | {key: row["session"]} for row in rows_of(12)]
    path.write_text("".join([f"{key},touch\n", *(f"{r[key]},{r['touch']}\n" for r in once[::2])]))
    copies = [r | {"path": f"b{r['path']}", "session": f"b{r['session']}"} for r in once]
    for rows in (once, once + copies):
        bare = campaign_of([row | {"touch": None} for row in rows])
        found.append(find_judged(with_labels(bare, path)))
    assert sum(found[1].judgements.values()) == 12
    assert found[1].quantities["release_force"] == found[0].quantities["release_force"]


def test_without_judgements_and_without_statsmodels(monkeypatch):
    rows = rows_of(20)
    none = [row | {"touch": None} for row in rows]
    assert find_judged(campaign_of(none)) is None
    monkeypatch.setitem(sys.modules, "statsmodels.miscmodels.ordinal_model", None)
    found = find_judged(campaign_of(rows))
    assert found.quantities["release_force"].odds_ratio is None
    assert "pip install 'sautereau[ordinal]'" in found.notes[0]


def test_judgements_from_notes_and_files(tmp_path):
    assert touch_in("cold room\nTouch: Hard\n") == "hard"
    assert touch_in("touch: harder") is None
    table = campaign_of([row | {"touch": None} for row in rows_of(3, presses=1)])
    path = tmp_path / "labels.csv"
    path.write_text("session; touch\ns0;soft\n\ns2; Hard\n")
    labelled = with_labels(table, path)
    assert labelled.data["touch"].tolist() == ["soft", np.nan, "hard"]
    assert labelled.data["touch"].dtype.ordered
    path.write_text("session,touch\ns0,soft\ns0,hard\ns7,loud\n")
    with pytest.raises(AnalysisError) as caught:
        with_labels(table, path)
    for text in ("row 3: session 's0' has two", "row 4: 'loud' is none of", "no session 's7'"):
        assert text in str(caught.value)
    for text in ("a,b\n1,2\n", "", "session,plectrum,touch\n"):
        path.write_text(text)
        with pytest.raises(AnalysisError, match="judgements"):
            with_labels(table, path)
