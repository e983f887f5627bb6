"""Decisions are numbered without gaps, and what refers to a decision or a trial finds it."""

import re
from pathlib import Path

from benchmarks.__main__ import ALL, LONG
from tests.test_language import files

ROOT = Path(__file__).parents[2]
DECISIONS = ROOT / "docs" / "decisions"
PAGES = sorted(path.name for path in DECISIONS.glob("0*.md"))
TRIALS = (ROOT / "docs" / "trials.md").read_text(encoding="utf-8")
ENTRIES = re.split(r"(?m)^### ", TRIALS)[1:]
_NUMBER = re.compile(r"\bdecisions?[\s/]+\[?(\d+)\b", re.IGNORECASE)
_PARTS = ("Tried.", "Figures.", "Kept.", "Repeat.")


def test_pages_are_numbered_and_listed():
    assert [int(name[:4]) for name in PAGES] == list(range(1, len(PAGES) + 1))
    listed, _, old = (DECISIONS / "index.md").read_text("utf-8").partition("## Old numbers")
    assert re.findall(r"(?m)^\| \[\d+\]\((.*?)\)", listed) == PAGES
    numbers = re.findall(r"(?m)^\| (\d+) \| .*\]\(.*\) \|$", old)
    assert numbers == sorted(set(numbers))
    assert len(numbers) == 54


def test_every_number_of_a_decision_exists():
    numbers = {int(name[:4]) for name in PAGES}
    found = [
        (path.name, int(number))
        for path in files([path for path in ROOT.iterdir() if path.name[0] != "."])
        if path not in (DECISIONS / "index.md", Path(__file__))
        for number in _NUMBER.findall(path.read_text(encoding="utf-8"))
    ]
    assert len(found) > 10
    assert [each for each in found if each[1] not in numbers] == []


def test_every_link_to_a_trial_leads_to_its_heading():
    headings = re.findall(r"(?m)^##+ (.*)$", TRIALS)
    anchors = {re.sub(r"\W+", "-", heading.lower()) for heading in headings}
    pages = [path for path in (ROOT / "docs").rglob("*.md") if path.name != "trials.md"]
    linked = [
        (path.name, anchor)
        for path in pages
        for anchor in re.findall(r"trials\.md#([\w-]+)", path.read_text(encoding="utf-8"))
    ] + [("trials.md", anchor) for anchor in re.findall(r"\]\(#([\w-]+)\)", TRIALS)]
    assert len(linked) > 27
    assert [each for each in linked if each[1] not in anchors] == []


def test_every_trial_is_complete_and_its_commands_exist():
    for entry in ENTRIES:
        title = entry.splitlines()[0]
        places = [entry.find(f"**{part}**") for part in _PARTS]
        assert [-1, *places] == sorted({-1, *places}), title
        repeat = entry[places[-1] :]
        commands = re.findall(r"`python -m ([^`]+)`", repeat)
        assert commands or "o command repeats" in repeat, title
        for command in commands:
            module, *words = command.split()
            if module == "benchmarks":
                assert words, title
                assert set(words) <= {*ALL, *LONG}, title
            elif module == "pytest":
                _selects(words)
            else:
                assert module == "benchmarks.independent_phases", title
                assert [word.isdigit() for word in words] == [True, True], title


def _selects(words: list[str]) -> None:
    """Check that a file of tests exists, and contains a test that `-k` selects."""
    (path,) = [ROOT / word for word in words if word.endswith(".py")]
    part = words[words.index("-k") + 1] if "-k" in words else "test_"
    assert re.search(rf"def test_\w*{part}|def {part}", path.read_text(encoding="utf-8")), path
