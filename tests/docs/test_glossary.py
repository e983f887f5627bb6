"""The glossary is generated from the one table of quantities, and the table is complete."""

from dataclasses import fields

from docs.glossary import PAGE, page
from sautereau.analysis.campaign.touch import FELT, Felt
from sautereau.analysis.press.features import UNITS
from sautereau.analysis.session.compare import Comparison
from sautereau.analysis.session.repeatability import Repeatability
from sautereau.rig.quantities import DISPLAYED, QUANTITIES, SECTIONS


def test_the_committed_page_is_the_generated_one():
    assert PAGE.read_text(encoding="utf-8") == page(), "run `python -m docs.glossary`"


def test_every_quantity_is_defined_once_and_completely():
    assert len(QUANTITIES) == sum(map(len, SECTIONS.values()))
    for name, quantity in QUANTITIES.items():
        assert quantity.name == name
        assert quantity.label
        assert quantity.definition.endswith(".")
        assert quantity.unit in {"", "1", "s", "m", "N", "J", "N/m", "m/s", "m/N", "Pa", "rad"}
    labels = [quantity.label for quantity in SECTIONS["Phases and features of a press"].values()]
    assert len(set(labels)) == len(labels)


def test_everything_that_is_reported_has_an_entry():
    reported = {*UNITS, *FELT, *(f"felt.{field.name}" for field in fields(Felt))}
    reported |= {f.name for each in (Comparison, Repeatability) for f in fields(each)}
    reported -= {"presses", "stds", "budget"}  # a count of recordings, and uncertainties
    assert reported <= set(QUANTITIES)


def test_titles_have_the_unit_that_is_displayed():
    assert QUANTITIES["release_force"].title == "release force (N)"
    assert QUANTITIES["pluck_duration"].title == "pluck duration (ms)"
    assert QUANTITIES["plucks"].title == "plucks"
    assert QUANTITIES["pluck_duration"].displayed == DISPLAYED["s"] == (1e3, "ms")
    assert QUANTITIES["free_speed"].displayed == (1.0, "m/s")


def test_terms_are_sorted_sentences():
    for part in PAGE.read_text(encoding="utf-8").split("\n| term | meaning |\n|---|---|\n")[1:]:
        rows = [line.strip("| ").split(" | ") for line in part.splitlines() if line[:1] == "|"]
        terms = [term for term, _ in rows]
        assert len(terms) > 20
        assert terms == sorted(terms, key=str.lower)
        assert all(meaning.endswith(".") for _, meaning in rows)
