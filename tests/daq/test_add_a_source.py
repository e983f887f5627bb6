"""docs/add-a-source.md, followed literally: an acquisition device of another package."""

import json
import re
import sys
import tomllib
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from sautereau.commands.app import app
from sautereau.daq.errors import DaqError
from sautereau.daq.file.reading import read_recording
from sautereau.daq.source.source import open_source
from sautereau.rig.load import load_rig

PAGE = Path(__file__).parents[2] / "docs" / "add-a-source.md"


def blocks(language):
    return re.findall(rf"```{language} .*?\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


@pytest.fixture
def rig_file(tmp_path, monkeypatch, install):
    (module,) = blocks("python")
    project, daq = map(tomllib.loads, blocks("toml"))
    (tmp_path / "logger.py").write_text(module, encoding="utf-8")
    install(tmp_path, {"name": "logger", "version": "1.0"} | project["project"])
    paper = resources.files("sautereau.rig").joinpath("paper.toml").read_text(encoding="utf-8")
    named = f'[daq]\ndriver = "{daq["daq"]["driver"]}"\n'
    (tmp_path / "my-rig.toml").write_text(paper.replace("[daq]\n", named, 1))
    monkeypatch.chdir(tmp_path)
    yield tmp_path / "my-rig.toml"
    sys.modules.pop("logger", None)


def test_the_command_on_the_page_records_from_it(rig_file, capsys):
    words = re.search(r"`sautereau (acquire .*?)`", PAGE.read_text()).group(1)
    arguments = [word.strip('"') for word in re.findall(r'"[^"]*"|\S+', words)]
    assert app([*arguments, "--json"], result_action="return_value") == 0
    assert json.loads(capsys.readouterr().out)["simulated"] is True
    found = read_recording(rig_file.with_name("a.mcap"))
    assert (found.n_samples, found.simulated, found.session.daq) == (5120, True, "sine logger")
    expected = np.sin(2 * np.pi * 100 * np.arange(5120) / 51_200)
    np.testing.assert_allclose(found.volts["force"], expected, atol=1e-12)


def test_what_it_cannot_do_it_refuses(rig_file):
    with pytest.raises(DaqError, match="no trigger input"):
        open_source(load_rig(rig_file).daq, 0.1)
