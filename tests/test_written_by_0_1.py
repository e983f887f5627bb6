"""Files written by version 0.1 open with the present version."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from sautereau.analysis.campaign.table import read_campaign
from sautereau.commands.app import app
from sautereau.daq.file.reading import read_recording
from sautereau.rig.load import load_rig

OLD = Path(__file__).parent / "data" / "written_by_0.1"
PRESSES = sorted((OLD / "session").glob("*.mcap"))


@pytest.fixture
def run(capsys):
    """Run a command in this process with --json, and return its result."""

    def run(*words):
        capsys.readouterr()
        command = [str(word) for word in (*words, "--json")]
        assert app(command, print_error=False, exit_on_error=False) in (0, None)
        return json.loads(capsys.readouterr().out)

    return run


@pytest.fixture
def session(tmp_path):
    return Path(shutil.copytree(OLD / "session", tmp_path / "session"))


def old_columns():
    """Return the old table's columns by their names in the file."""
    import pyarrow.parquet as pq

    return pq.read_table(OLD / "table.parquet").to_pydict()


def test_recordings(run):
    assert run("info", PRESSES[0])
    found = run("phases", *PRESSES)
    old = old_columns()
    for i, file in enumerate(found["files"]):
        (pluck,) = file["plucks"]
        assert pluck["contact"] == pytest.approx(old["contact"][i], abs=1e-4)
        assert pluck["release_force"] == pytest.approx(old["peak_force"][i], rel=0.02)
    compared = run("compare", *PRESSES)
    assert abs(compared["duration_error"]["value"]) < 0.15


def test_a_rig_file(run):
    assert run("plan", OLD / "rig.toml")["feasible"] is True
    assert load_rig(OLD / "rig.toml").press == load_rig("paper").press


def test_a_report_of_a_session(run, session):
    result = run("report", session)
    page = Path(result["path"]).read_text(encoding="utf-8")
    assert result["presses"] == 2
    assert "Session session" in page


@pytest.mark.slow
def test_a_session_is_resumed(run, session):
    (session / PRESSES[1].name).unlink()
    kept = (session / PRESSES[0].name).read_bytes()
    result = run("press", OLD / "rig.toml", "--sim", "--seed", 7, "-n", 2, "--out", session)
    assert [Path(path).name for path in result["recordings"]] == [path.name for path in PRESSES]
    assert (session / PRESSES[0].name).read_bytes() == kept
    assert result["warm_ups"] == [str(session / "warm-up-01.mcap")]  # the press comes from a lift
    new = read_recording(session / PRESSES[1].name)
    assert new.session.session == read_recording(PRESSES[0]).session.session
    assert json.loads(new.session.scene)["engine"] == "rigid"  # which version 0.1 had alone


@pytest.mark.slow
def test_learned_corrections(run, tmp_path):
    out = tmp_path / "out"
    learned = OLD / "learned" / "learned.json"
    words = ("press", OLD / "rig.toml", "--scene", "ideal", "--learned", learned, "--out", out)
    (press,) = run(*words)["recordings"]
    corrected, uncorrected = read_recording(Path(press)).plan, read_recording(PRESSES[0]).plan
    assert 1e-6 < np.abs(corrected.jack_rise - uncorrected.jack_rise).max() < 1e-3


def test_a_campaign_table_is_read_with_present_names():
    campaign = read_campaign(OLD / "table.parquet")
    old = old_columns()
    assert campaign.schema == 1
    table = campaign.table.to_pydict()
    for before, now in (
        ("contact_duration", "pluck_duration"),
        ("peak_force", "release_force"),
        ("force_step", "force_drop"),
        ("force_slope", "force_slope"),
    ):
        assert table[now] == old[before]
    assert "contact_duration" not in table
    assert "peak_force" not in table


def test_touch_reads_a_campaign_table(run):
    result = run("touch", OLD / "table.parquet")
    assert result["presses"] == 2
    assert result["felt"]["release_force"]["press"]["value"] > 0


def test_a_continued_campaign_analyses_all_presses_again(run, session, tmp_path):
    """Rows of 0.1 lack the largest force of the press, so they are not kept."""
    out = tmp_path / "table.parquet"
    shutil.copy(OLD / "table.parquet", out)
    result = run("campaign", session, "--out", out)
    assert (result["presses"], result["read"], result["kept"]) == (2, 2, 0)
    table = read_campaign(out).table.to_pydict()
    assert all(
        peak >= force
        for peak, force in zip(table["peak_force"], table["release_force"], strict=True)
    )
    assert table["plectrum"] == old_columns()["plectrum"]
