"""A stranger's path: clone to picture, new key to report, design to effects.

In a bare environment: no home, no cache, no environment of Python. The first part installs from the
network, as pip is set up on this machine.
"""

import json
import os
import re
import resource
import struct
import subprocess
import sys
import tempfile
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path

from benchmarks.figures import check
from sautereau.analysis.text import counted

ROOT = Path(__file__).parents[1]
HEAD = "| what | now | before |\n|---|---|---|"
KEPT = re.compile(r"PIP_|SSL_|OPENBLAS_|.*_CERT_FILE$|.*CA_BUNDLE$")
"""Variables of the environment that say how this machine reaches pip's index, and what it is."""
DESIGN = re.compile(r"```python\n(import sautereau as st\n(?:(?!```).)*?st\.design\(.*?)```", re.S)
EDITS = {"overlap": "0.28 mm", "mass": "7 g"}  # What a user measures at the new key first


@dataclass(frozen=True)
class Row:
    """What a stranger needs now, beside what was needed in version 0.2."""

    what: str
    now: str
    before: str = "-"
    missed: bool = False

    def __str__(self) -> str:
        return f"| {self.what} | {self.now} | {self.before} |"


class Stranger:
    """Somebody in a folder, with a home of their own; counts their commands and the time."""

    def __init__(self, folder: Path):
        self.folder, self.commands = folder, 0
        home = folder / "home"
        home.mkdir()
        path = os.pathsep.join((str(Path(sys.base_prefix) / "bin"), "/usr/bin", "/bin"))
        kept = {name: text for name, text in os.environ.items() if KEPT.match(name)}
        self._environment = kept | {"HOME": str(home), "PATH": path, "LANG": "C.UTF-8"}
        self._start, self._spent = time.perf_counter(), _spent()

    def run(self, *words: str) -> str:
        """Run a command; return its output.

        Raises:
            BenchmarkFault: It fails.
        """
        self.commands += 1
        done = subprocess.run(
            words, cwd=self.folder, env=self._environment, capture_output=True, encoding="utf-8"
        )
        check(done.returncode == 0, f"{' '.join(words)}: {done.stdout[-500:]}{done.stderr[-500:]}")
        return done.stdout

    def took(self) -> str:
        """Return how many commands and how much time since the last call."""
        wall, spent = time.perf_counter() - self._start, _spent() - self._spent
        made = counted(self.commands, "command")
        self.commands, self._start, self._spent = 0, time.perf_counter(), _spent()
        return f"{made}, {wall:.3g} s ({spent:.3g} s of processor time)"


def run() -> list[Row]:
    """Return what each part of the path takes, and how much there is to learn."""
    with tempfile.TemporaryDirectory() as folder:
        stranger = Stranger(Path(folder))
        rows = [_clone(stranger)]
        stranger.folder /= "sautereau"
        tool = str(stranger.folder / ".venv" / "bin" / "sautereau")
        return [*rows, *_key(stranger, tool), _design(stranger, tool), *_counts(stranger, tool)]


def _clone(stranger: Stranger) -> Row:
    stranger.run("git", "clone", "--quiet", str(ROOT), "sautereau")
    printed = stranger.run("make", "-C", "sautereau", "press")
    took = stranger.took()
    found = re.search(r"picture: *(\S+\.png)", printed)
    check(found is not None, f"make press names no picture: {printed[-500:]}")
    _drawn(stranger.folder / "sautereau" / (found[1] if found else ""))
    return Row("clone, `make press`: to the first picture, installation included", took)


def _key(stranger: Stranger, tool: str) -> list[Row]:
    stranger.run(tool, "init", "bench.toml", "--bench")
    stranger.run(tool, "init", "c4.toml", "--instrument", "--base", "bench.toml")
    path = stranger.folder / "c4.toml"
    text = path.read_text(encoding="utf-8")
    for key, value in EDITS.items():
        text, n = re.subn(rf"(?m)^{key} = .*$", f'{key} = "{value}"', text, count=1)
        check(n == 1, f"the new key's file has no {key}")
    path.write_text(text, encoding="utf-8")
    stranger.run(tool, "plan", "c4.toml")
    stranger.run(tool, "press", "c4.toml", "--sim", "-n", "3", "--out", "c4")
    stranger.run(tool, "report", "c4")
    took = stranger.took()
    page = (stranger.folder / "c4" / "report.html").read_text(encoding="utf-8")
    check("Session c4" in page, "the report is of another session")
    compared = json.loads(stranger.run(tool, "compare", "c4", "--json"))
    error = compared["duration_error"]["value"]
    check(abs(error) < 0.05, f"pluck duration of the new key: model error {error:+.2%}")
    stranger.run(tool, "init", "complete.toml")
    own, complete = (_keys(stranger.folder / name) for name in ("c4.toml", "complete.toml"))
    stranger.took()
    return [
        Row("`init` twice, `plan`, `press`, `report`: a new key to its report", took),
        Row(
            "rig keys of a new key",
            f"{own} beside its bench, {len(EDITS)} of them changed here; {complete} in one file",
            "103",
        ),
    ]


def _design(stranger: Stranger, tool: str) -> Row:
    """Run the program of the handbook: 3 plectra at 4 speeds, 5 presses each."""
    page = (stranger.folder / "docs" / "bench.md").read_text(encoding="utf-8")
    found = DESIGN.search(page)
    check(found is not None, "docs/bench.md has no program with a design")
    program = found[1] if found else ""
    (stranger.folder / "study.py").write_text(program, encoding="utf-8")
    stranger.run(str(Path(tool).with_name("python")), "study.py")
    took = stranger.took()
    _drawn(stranger.folder / "effects.png")
    presses = list((stranger.folder / "plectra").glob("press-*.mcap"))
    check(len(presses) == 60, f"the design made {len(presses)} presses, not 60")
    words = ("effects", "plectra", "--of", "release_force", "--json")
    force = json.loads(stranger.run(tool, *words))["effects"]["release_force"]
    check(_grows(force), f"a thicker plectrum has no larger force: {force}")
    stranger.took()
    lines = sum(bool(line.strip()) for line in program.splitlines())
    return Row(
        f"{lines} lines of Python: 60 presses of a design to their effects", took, "41 lines"
    )


def _grows(force: dict) -> bool:
    """Return whether the mean force grows from thin to thick, outside the 95 % intervals."""
    effects = [effect for factor in force["factors"] for effect in factor["effects"]]
    of = {each["level"]: each for each in effects if each["factor"] == "plectrum"}
    return 0 < of["medium"]["low"] < of["medium"]["high"] < of["thick"]["low"]


def _counts(stranger: Stranger, tool: str) -> list[Row]:
    """Count what the help shows: commands, and different options of all commands."""
    listed = stranger.run(tool, "--help")
    groups = re.findall(r"(?m)^╭─ (\w+) ─", listed)
    commands = re.findall(r"(?m)^│ ([a-z][\w-]+) ", listed)
    shown, rare = set(), set()
    for command in commands:
        shown |= _options(stranger.run(tool, command, "--help"))
        rare |= _options(stranger.run(tool, command, "--help-all"))
    check(len(commands) > 20 and shown < rare, "the help has another form")
    return [
        Row("commands", f"{len(commands)} in {len(groups)} groups, in their order of use", "27"),
        Row("options of all commands", f"{len(shown)}, and {len(rare - shown)} rare ones", "65"),
    ]


def _options(text: str) -> set[str]:
    return set(re.findall(r"(?m)^│ \*?\s*(--[a-z][a-z-]+)", text))


def _keys(path: Path) -> int:
    """Return the number of values in a rig file."""

    def count(value: object) -> int:
        if isinstance(value, dict) and "value" not in value:
            return sum(map(count, value.values()))
        if isinstance(value, list) and value and isinstance(value[0], dict):
            return sum(map(count, value))
        return 1

    return count(tomllib.loads(path.read_text(encoding="utf-8")))


def _drawn(path: Path) -> None:
    """Check that a file is a PNG of at least 400 by 300 pixels."""
    head = path.read_bytes()[:24]
    check(head[:8] == b"\x89PNG\r\n\x1a\n", f"{path} is no picture")
    width, height = struct.unpack(">II", head[16:])
    check(width > 400 and height > 300, f"{path} has {width} x {height} pixels")


def _spent() -> float:
    """Return the processor time [s] of all processes that have ended."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime
