"""The runner of the benchmarks: missed limits are marked, on the page as well, and fail the run."""

import re
import sys
from types import ModuleType

import pytest

from benchmarks import __main__ as runner
from benchmarks import figures
from benchmarks.figures import Figure


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
