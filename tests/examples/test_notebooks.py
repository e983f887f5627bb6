"""The tutorial runs from the first cell to the last, and is stored without outputs."""

import json
from pathlib import Path

import pytest

TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorial.ipynb"


@pytest.mark.slow
def test_the_tutorial_runs_and_is_stored_without_outputs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names, results = {}, []
    for cell in json.loads(TUTORIAL.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] != "code":
            continue
        assert not cell["outputs"]
        assert cell["execution_count"] is None
        source = "".join(cell["source"]).replace('scene="paper"', 'scene="ideal"')  # it is quicker
        *lines, last = source.splitlines()
        exec(compile("\n".join(lines), TUTORIAL.name, "exec"), names)
        if last.startswith((" ", ")", "print(")) or " = " in last:
            exec(compile("\n".join([*lines, last]), TUTORIAL.name, "exec"), names)
        else:  # what a notebook shows
            results.append(eval(compile(last, TUTORIAL.name, "eval"), names))
            assert repr(results[-1])
    output = capsys.readouterr().out
    assert "simulated" in output
    assert "Model error" in output
    assert len(names["session"]) == 2
    assert list(names["tuesday"].features["jack_speed"]) == [0.06, 0.09, 0.072, 0.072]
    assert len(names["tuesday"].compare().found.conditions) == 3
    assert abs(names["fit"].params.loc["plectrum.overlap", "value"] - 0.3e-3) < 0.01e-3
    assert (tmp_path / "fit.toml").is_file()
    assert len(results[-1]) == 3  # with the warm-up press, which the table marks
