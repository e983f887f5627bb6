"""docs/add-a-source.md, followed literally: an acquisition device of another package."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from sautereau.commands.app import app
from sautereau.daq.errors import DaqError
from sautereau.daq.file.reading import read_recording
from sautereau.daq.source.source import open_source
from sautereau.rig.load import load_rig


@pytest.fixture
def page(follow):
    return follow("add-a-source.md")


def test_the_command_on_the_page_records_from_it(page, capsys):
    words = re.search(r"`sautereau (acquire .*?)`", page.text).group(1)
    arguments = [word.strip('"') for word in re.findall(r'"[^"]*"|\S+', words)]
    assert app([*arguments, "--json"], result_action="return_value") == 0
    assert json.loads(capsys.readouterr().out)["simulated"] is True
    found = read_recording(Path("a.mcap"))
    assert (found.n_samples, found.simulated, found.session.daq) == (5120, True, "sine logger")
    expected = np.sin(2 * np.pi * 100 * np.arange(5120) / 51_200)
    np.testing.assert_allclose(found.volts["force"], expected, atol=1e-12)


def test_what_it_cannot_do_it_refuses(page):
    with pytest.raises(DaqError, match="no trigger input"):
        open_source(load_rig("my-rig.toml").daq, 0.1)
