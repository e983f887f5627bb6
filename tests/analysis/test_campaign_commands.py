"""The commands `campaign` and `touch`."""

import json
import shutil

import pytest

from sautereau.commands.app import app
from sautereau.rig.errors import UsageError


def run(*words):
    return app([str(word) for word in words], print_error=False, exit_on_error=False)


@pytest.fixture(scope="module")
def recordings(campaign_folder, tmp_path_factory):
    folder = tmp_path_factory.mktemp("commands") / "recordings"
    shutil.copytree(campaign_folder, folder)
    (folder / "faulty.mcap").touch()
    return folder


@pytest.fixture(scope="module")
def table(recordings, tmp_path_factory):
    out = tmp_path_factory.mktemp("table") / "campaign.parquet"
    assert run("campaign", recordings, "--out", out) == 0
    return out


def test_campaign_in_json(recordings, table, capsys):
    for words in (
        (recordings, "--out", table.with_name("new.parquet")),
        (recordings, "--out", table),
    ):
        assert run("campaign", *words, "--json") == 0
        result = json.loads(capsys.readouterr().out)
        counts = [result[name] for name in ("presses", "read", "kept", "dropped")]
        assert counts == ([12, 1, 12, 0] if table in words else [12, 13, 0, 0])
        assert result["simulated"] is True
        assert [fault["path"] for fault in result["faults"]] == ["faulty.mcap"]


def test_campaign_in_lines(recordings, table, capsys):
    assert run("campaign", recordings, "--out", table) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("SIMULATED")
    assert "12 presses" in lines[1]
    assert "faulty.mcap: " in " ".join(lines[2:])


def test_processes_and_cluster_exclude_each_other(recordings, tmp_path):
    out = tmp_path / "a.parquet"
    places = ("--processes", 2, "--cluster", "tcp://127.0.0.1:1")
    with pytest.raises(UsageError, match="--processes and --cluster"):
        run("campaign", recordings, "--out", out, *places)
    assert not out.exists()
