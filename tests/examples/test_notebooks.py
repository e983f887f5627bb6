"""The notebooks run from their first cell to their last, and hold no outputs."""

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
def test_nothing_that_a_run_leaves_is_kept(path):
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None


def test_touch_goes_from_recordings_to_figures(tmp_path, monkeypatch, capsys, no_windows):
    write_presses(tmp_path / "recordings", 5, 2, 2)
    (tmp_path / "recordings" / "faulty.mcap").touch()
    monkeypatch.chdir(tmp_path)
    names = {}
    for cell in code_of(TOUCH):
        exec(compile(cell, TOUCH.name, "exec"), names)
    told = capsys.readouterr().out
    assert "20 presses, 21 read now, 0 known before" in told
    assert "left out: faulty.mcap" in told
    assert "SIMULATED" in told
    assert "1 % more thickness" in told
    assert len(names["odd"]) == 0
    assert (tmp_path / "touch.png").stat().st_size > 10_000
    exponent = names["touch"].felt["threshold"].exponents["plectrum_thickness"]
    assert 1 < exponent.value < 3
    assert len(code_of(TOUCH)) <= 12
