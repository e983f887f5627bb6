"""The commands `export` and `import`, on one's own files and another's."""

import json

import numpy as np
import pytest

from sautereau.commands.app import app
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


@pytest.mark.parametrize("to", ["parquet", "urdf"])
def test_beside_the_recording_and_never_twice(tmp_path, recordings, to, capsys):
    assert run("export", recordings[0], "--to", to) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'press-1'}.{to}\n"
    with pytest.raises(SautereauError, match="already exists"):
        run("export", *recordings, "--to", to)
    assert not (tmp_path / f"press-2.{to}").exists()
