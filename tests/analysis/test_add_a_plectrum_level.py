"""docs/add-a-plectrum-level.md followed literally, as a package outside sautereau."""

import json
import re
import runpy

import pytest

from sautereau.analysis.model.plectrum.levels import LEVELS, levels_help
from sautereau.analysis.model.predict import predict
from sautereau.commands.app import app
from sautereau.rig.load import load_rig


def test_the_page_adds_a_level(follow, capsys):
    page = follow("add-a-plectrum-level.md")
    assert LEVELS.names() == ["auto", "elastica", "fe", "rods", "beam", "two-beam", "hinge"]
    assert levels_help().endswith("two-beam, hinge.")
    tests = runpy.run_path("test_hinge_level.py")
    for name in [name for name in tests if name.startswith("test_")]:
        tests[name]()
    command = re.findall(r"^sautereau (predict .*)$", page.text, re.MULTILINE)
    assert app([*command[0].split(), "--json"], result_action="return_value") == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["pluck_duration"] == pytest.approx(predict(load_rig(), "hinge").pluck_duration)
