"""docs/add-a-plectrum-level.md followed literally, as a package outside sautereau."""

import json
import re
import runpy
import tomllib
from pathlib import Path

import pytest

from sautereau.analysis.model.plectrum.levels import LEVELS, levels_help
from sautereau.analysis.model.predict import predict
from sautereau.commands.app import app
from sautereau.rig.load import load_rig

PAGE = Path(__file__).parents[2] / "docs" / "add-a-plectrum-level.md"


@pytest.fixture
def package(tmp_path, install):
    """Write the page's files as an installed package, and return its folder."""
    text = PAGE.read_text(encoding="utf-8")
    files = re.findall(r"Save this as `(\S+)`:\s+```python\n(.*?)```", text, re.DOTALL)
    assert [name for name, _ in files] == ["hinge_level.py", "test_hinge_level.py"]
    for name, code in files:
        (tmp_path / name).write_text(code, encoding="utf-8")
    (block,) = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    install(tmp_path, tomllib.loads(block)["project"])
    return tmp_path


def test_the_page_adds_a_level(package, capsys):
    assert LEVELS.names() == ["elastica", "fe", "rods", "beam", "two-beam", "hinge"]
    assert levels_help().endswith("two-beam, hinge.")
    tests = runpy.run_path(str(package / "test_hinge_level.py"))
    for name in [name for name in tests if name.startswith("test_")]:
        tests[name]()
    command = re.findall(r"^sautereau (predict .*)$", PAGE.read_text("utf-8"), re.MULTILINE)
    assert app([*command[0].split(), "--json"], result_action="return_value") == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["pluck_duration"] == pytest.approx(predict(load_rig(), "hinge").pluck_duration)
