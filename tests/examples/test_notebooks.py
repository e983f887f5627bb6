"""The notebooks run from the first cell to the last, and are stored without outputs."""

import json
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

from benchmarks.campaign import write_presses

EXAMPLES = Path(__file__).parents[2] / "examples"
TOUCH = EXAMPLES / "touch.ipynb"


def code_of(path):
    """Return the source of every code cell."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]


@pytest.fixture
def no_windows():
    plt.switch_backend("agg")
    yield
    plt.close("all")


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.ipynb")), ids=lambda path: path.name)
def test_a_notebook_is_stored_without_outputs(path):
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None


def test_touch_from_recordings_to_figures(tmp_path, monkeypatch, capsys, no_windows):
    write_presses(tmp_path / "recordings", 4, 2, 2)
    (tmp_path / "recordings" / "faulty.mcap").touch()
    monkeypatch.chdir(tmp_path)
    names = {}
    for cell in code_of(TOUCH):
        exec(compile(cell, TOUCH.name, "exec"), names)
    output = capsys.readouterr().out
    assert "16 presses, 17 recordings read now, 0 before" in output
    assert "not read: faulty.mcap" in output
    assert "SIMULATED" in output
    assert "1 % more thickness" in output
    assert len(names["odd"]) == 0
    assert (tmp_path / "touch.png").stat().st_size > 10_000
    exponent = names["touch"].felt["release_force"].exponents["plectrum_thickness"]
    assert 1 < exponent.value < 3
    assert len(code_of(TOUCH)) <= 12
