"""The runner of the benchmarks: missed limits are marked, on the page as well, and fail the run."""

import re
import sys
from types import ModuleType

import pytest

from benchmarks import __main__ as runner
from benchmarks import figures, speed
from benchmarks.figures import Figure
from benchmarks.speed import Row


@pytest.mark.parametrize(
    ("value", "against", "missed"),
    [
        (0.9, "limit", False),
        (1.1, "limit", True),
        (-1.1, "limit", True),
        (1.1, "at least", False),
        (0.9, "at least", True),
        (9.0, "a peer", False),
        (float("nan"), "limit", False),
    ],
)
def test_a_figure_beyond_its_limit_is_marked(value, against, missed):
    figure = Figure("time", value, "s", against, 1.0)
    assert figure.missed is missed
    assert str(figure).endswith(" MISSED |") is missed


@pytest.mark.parametrize(("value", "status"), [(0.5, 0), (2.0, 1)])
@pytest.mark.parametrize("options", [[], ["--write"]])
def test_a_missed_limit_ends_with_one(monkeypatch, tmp_path, capsys, value, status, options):
    module = ModuleType("benchmarks.imports")
    module.run = lambda: [Figure("time", value, "s", "limit", 1.0)]
    monkeypatch.setitem(sys.modules, "benchmarks.imports", module)
    monkeypatch.setattr(figures, "PAGE", tmp_path / "figures.md")
    assert runner.main(["imports", *options]) == status
    assert ("MISSED" in capsys.readouterr().out) == bool(status)
    assert figures.PAGE.exists() == bool(options)
    if options:
        assert ("2 MISSED |" in figures.PAGE.read_text()) == bool(status)


def test_the_page_marks_every_missed_limit():
    """Of the figures that are on the page now."""
    for line in figures.PAGE.read_text(encoding="utf-8").splitlines():
        row = re.fullmatch(r"\| .* \| (\S+).* \| (limit|at least): (\S+).* \| .* \|", line)
        if row:
            missed = Figure("", float(row[1]), "", row[2], float(row[3])).missed
            assert line.endswith(" MISSED |") == missed, line


def test_a_benchmark_with_a_table_of_its_own(monkeypatch, tmp_path):
    rows = [
        Row("soft", 0.01, 40.0, 13.0, 0.2, 0.8, 0.1),
        Row("coarse", 0.3, float("nan"), 9.0, 2.05, 2.2, 2.0),
        Row("loose", 0.01, 18.0, 6.0, 2.7, 1.3, 0.4),
    ]
    assert [row.missed for row in rows] == [False, False, True]
    monkeypatch.setattr(speed, "run", lambda: rows)
    monkeypatch.setattr(figures, "PAGE", tmp_path / "figures.md")
    assert runner.main(["speed", "--write"]) == 1
    table = figures.PAGE.read_text()
    assert "| rig and scene | planned | predicted |" in table
    assert "| coarse | 0.3 % | - | 9 % | 2.05 % | 2.2 % | 2 % | reached |" in table
    assert "| loose | 0.01 % | 18 % | 6 % | 2.7 % | 1.3 % | 0.4 % | MISSED |" in table


def test_the_cases_of_the_speed_are_all_there():
    """Twelve or more, of which one is in real time and each has another rig or scene."""
    cases = speed.cases()
    assert len(cases) >= 12
    assert sum(paced for _, _, paced in cases.values()) == 1
    names = list(cases)
    different = {repr((rig, scene)) for rig, scene, paced in cases.values() if not paced}
    assert len(different) == len(names) - 1
