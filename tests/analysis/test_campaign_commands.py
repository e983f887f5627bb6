"""The commands `campaign` and `touch`."""

import json

import pytest

from benchmarks.campaign import write_presses
from sautereau.analysis.errors import AnalysisError
from sautereau.commands.app import app


def run(*words):
    return app([str(word) for word in words], print_error=False, exit_on_error=False)


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    write_presses(folder, 3, 2, 2)
    (folder / "faulty.mcap").touch()
    return folder


@pytest.fixture
def table(recordings, tmp_path, capsys):
    out = tmp_path / "campaign.parquet"
    assert run("campaign", recordings, "--out", out, "--processes", 1) == 0
    capsys.readouterr()
    return out


def test_campaign_answers_in_json(recordings, tmp_path, capsys):
    words = ("campaign", recordings, "--out", tmp_path / "a.parquet", "--processes", 1, "--json")
    assert run(*words) == 0
    told = json.loads(capsys.readouterr().out)
    assert [told[name] for name in ("presses", "read", "kept", "dropped")] == [12, 13, 0, 0]
    assert told["simulated"] is True
    assert [fault["path"] for fault in told["faults"]] == ["faulty.mcap"]
    assert run(*words) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["read"], told["kept"]) == (1, 12)


def test_campaign_answers_in_lines(recordings, table, capsys):
    assert run("campaign", recordings, "--out", table) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[0].startswith("SIMULATED")
    assert "12 presses" in told[1]
    assert told[2].startswith("left out: faulty.mcap: ")


def test_work_is_done_in_one_place(recordings, tmp_path, capsys):
    out = tmp_path / "a.parquet"
    places = ("--processes", 2, "--cluster", "tcp://127.0.0.1:1")
    assert run("campaign", recordings, "--out", out, *places) == 2
    assert "give one" in capsys.readouterr().err
    with pytest.raises(AnalysisError, match="0 cannot work"):
        run("campaign", recordings, "--out", out, "--processes", 0)
    assert not out.exists()


def test_touch_answers(table, tmp_path, capsys):
    picture = tmp_path / "touch.png"
    assert run("touch", table, "--plot", picture, "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["simulated"] is True
    assert len(told["plectra"]) == 3
    assert told["units"]["release_force"] == "N"
    assert told["felt"]["release_force"]["press"]["value"] < 0.02
    assert picture.stat().st_size > 10_000
    assert run("touch", table) == 0
    assert "between sessions" in capsys.readouterr().out
