"""The commands `export` and `import`, on one's own files and another's."""

import json

import numpy as np
import pytest

from sautereau.commands.app import app
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.reading import read_recording
from sautereau.rig.errors import SautereauError


def run(*words):
    return app([str(word) for word in words], print_error=False, exit_on_error=False)


@pytest.fixture
def recordings(tmp_path, record, volts):
    return [record(tmp_path / f"press-{i}.mcap", volts + i) for i in (1, 2)]


@pytest.mark.parametrize("to", ["parquet", "csv"])
def test_there_and_back(tmp_path, recordings, to, capsys):
    out = tmp_path / "out"
    out.mkdir()
    assert run("export", *recordings, "--to", to, "--out", out, "--raw", "--json") == 0
    files = json.loads(capsys.readouterr().out)["files"]
    tables = [out / f"press-{i}.{to}" for i in (1, 2)]
    assert set(map(str, tables)) <= set(files)
    back = tmp_path / "back.mcap"
    assert run("import", tables[1], "--out", back, "--json") == 0
    result = json.loads(capsys.readouterr().out)
    assert result["simulated"] is True
    assert result["n_samples"] == 5000
    for name, signal in read_recording(recordings[1]).volts.items():
        assert np.array_equal(read_recording(back).volts[name], signal)


def test_beside_the_recording_and_never_twice(tmp_path, recordings, capsys):
    assert run("export", recordings[0], "--to", "parquet") == 0
    assert capsys.readouterr().out == f"{tmp_path / 'press-1.parquet'}\n"
    with pytest.raises(SautereauError, match="already exists"):
        run("export", *recordings, "--to", "parquet")
    assert not (tmp_path / "press-2.parquet").exists()


def test_the_rig_as_urdf(tmp_path, recordings, capsys):
    assert run("export", recordings[0], "--to", "urdf") == 0
    assert capsys.readouterr().out == f"{tmp_path / 'press-1.urdf'}\n"
    assert (tmp_path / "press-1.urdf").read_text().startswith('<?xml version="1.0"?>\n<robot')
    with pytest.raises(SautereauError, match="already exists"):
        run("export", recordings[0], "--to", "urdf")


def test_a_table_of_another_program(tmp_path, capsys):
    table, back = tmp_path / "table.csv", tmp_path / "back.mcap"
    table.write_text("t,v\n0.0,10\n0.001,20\n0.002,30\n")
    words = ["import", table, "--out", back, "--rig", "paper", "--without", "force"]
    words += ["--column.velocity", "v", "--unit.velocity", "mm/s", "--time", "t"]
    words += ["--trigger", "1 ms", "--started", "2026-02-03T04:05:06+01:00", "--measured"]
    assert run(*words, "--notes", "old") == 0
    assert capsys.readouterr().out.splitlines() == [
        f"measured: {back}",
        "3 samples at 1000 Hz, the first is sample -1",
        "trigger: 0 us after sample 0",
        "read as: 1 line before the rows, names in line 1, delimiter ',', decimal point",
    ]
    found = read_recording(back)
    np.testing.assert_allclose(found.volts["velocity"], [0.4, 0.8, 1.2], rtol=1e-15)
    assert found.session.notes.startswith("old\nimported from table.csv, sha256 ")


def test_all_that_is_missing_is_asked_for(tmp_path):
    table = tmp_path / "table.csv"
    table.write_text("a\n1\n")
    with pytest.raises(RecordingError, match="8 faults"):
        run("import", table, "--out", tmp_path / "back.mcap", "--rig", "paper")
