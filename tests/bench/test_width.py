"""What commands print fits into a terminal of 80 columns."""

import re
import shutil

import pytest

from sautereau.analysis.text import WIDTH, wrapped
from sautereau.commands.app import app
from tests.pages import ROOT

QUICK = {
    "init": "new.toml", "plan": "-v", "predict": "", "phases": "session",
    "compare": "{0} {1} --against {0} {1}",
    "animate": "{0} --slow 1 --until 80ms --out a.gif",
    "info": "{0}",
    "campaign": "session --out t.parquet", "touch": "t.parquet",
    "survey": "keys.csv",
    "recover": "{0}.part --out new.mcap", "export": "{0} --to csv --out a.csv",
    "import": "a.csv --out i.mcap",
    "acquire": "--sim --dry-run", "doctor": "", "watch": "session -n 1",
}  # fmt: skip
"""Options of commands, in an order in which each finds the files that it needs."""
SLOW = {
    "setup": "--sim --yes", "mount": "", "press": "-n 2 --sim --out p", "listen": "--out a.wav",
    "replay": "{0} --sim --out r", "learn": "-n 2 --sim --out l", "transient": "session",
    "identify": "session --free plectrum.overlap,key.inertia,jack.mass --starts 1 -v --profile",
    "report": "session", "package": "session", "trade": "",
}  # fmt: skip


@pytest.fixture
def too_wide(tmp_path, monkeypatch, capfd):
    """Return a function that runs a command and returns the lines that are too wide."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / "tests/data/written_by_0.1/session", "session")
    rows = "".join(f"k{k},{0.2 + 0.01 * k}\n" for k in range(8))
    (tmp_path / "keys.csv").write_text(f"key,overlap [mm],recordings\n{rows}last,0.3,session\n")
    files = [f"session/press-000{n}.mcap" for n in (1, 2)]
    (tmp_path / f"{files[0]}.part").write_bytes((tmp_path / files[0]).read_bytes()[:100_000])

    def run(command: str, options: str) -> list[str]:
        app([command, *options.format(*files).split()], exit_on_error=False, print_error=False)
        lines = "".join(capfd.readouterr()).splitlines()
        assert lines, command
        return [line for line in lines if len(re.sub(r"\S*/\S*", "", line)) > WIDTH]

    return run


@pytest.mark.slow
def test_no_line_is_too_wide(too_wide):
    assert {name: too_wide(name, QUICK[name]) for name in QUICK} == {name: [] for name in QUICK}


@pytest.mark.slow
@pytest.mark.parametrize("name", SLOW)
def test_no_line_of_slow_commands_is_too_wide(too_wide, name):
    assert too_wide(name, SLOW[name]) == []


def test_the_width_of_every_command_is_tested():
    every = {name for name in app if not name.startswith("-")}
    # stand-in runs until it is stopped; tests/analysis/test_split.py makes recordings to split;
    # outline and voice need photographs: tests/analysis/test_outline_photo.py, test_voice.py;
    # effects needs a design: tests/analysis/test_effects.py.
    assert (
        every - {"stand-in", "split", "outline", "voice", "effects"} == QUICK.keys() | SLOW.keys()
    )


def test_prose_is_broken_at_spaces_and_tables_are_not():
    word, path = "word " * 20, "folder/" * 20
    assert wrapped(f"a: {word}").splitlines() == [f"a: {word[:74]}", f"  {word[75:].rstrip()}"]
    assert wrapped(f"label:   {word}").splitlines()[1].startswith(" " * 9 + "word")
    head = f"{'':40}odds ratio{'':30}false discovery"
    for kept in (head, f"one  two  {word}", f"report: {path}", "", "  short"):
        assert wrapped(kept) == kept.rstrip() or wrapped(kept) == kept
