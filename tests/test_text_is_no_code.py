"""Texts of files reach tables, pages and names of files as data only."""

import re
from pathlib import Path

import pytest

from sautereau.daq.convert.export import export
from sautereau.rig.errors import RigError
from sautereau.rig.load import with_values
from tests.fuzz.recordings import small

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize("name", ["=1+1", "+1", "-1", "@sum", "\t=1", "../x", "a\n=1", 'a",=1'])
def test_no_name_of_a_channel_is_a_formula_or_a_path(paper, name):
    """They are the heads of an export's columns, and its only texts."""
    with pytest.raises(RigError, match=r"daq\.channels\.0\.name"):
        with_values(paper, {"daq.channels.0.name": name})


def test_no_cell_of_a_table_is_a_formula(tmp_path):
    table = tmp_path / "table.csv"
    export(small(tmp_path / "a.mcap"), "csv", table)
    number = r"-?\d+(\.\d+)?(e[-+]?\d+)?"
    heads, *rows = table.read_text(encoding="utf-8").splitlines()
    assert all(re.fullmatch(r'"?[a-z]\w* ?(\[[\w/^]+\])?"?', head) for head in heads.split(","))
    for row in rows[:100] + rows[-100:]:
        assert all(re.fullmatch(rf"{number}|true|", cell) for cell in row.split(",")), row


def test_a_report_has_no_handlers_in_its_markup():
    page = (ROOT / "analysis" / "report" / "page.html.jinja").read_text(encoding="utf-8")
    assert not re.search(r"\son\w+\s*=|javascript:", page)
    assert "Content-Security-Policy" in page
