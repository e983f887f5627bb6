"""Break commands at random moments, and judge what is left."""

import hashlib
import random
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from tests.forked import CommandServer
from tests.kills.commands import COMMANDS, LEFT_OVER, Command, Lost, fresh, make_inputs
from tests.kills.disk import after_power_cut, notes_in

IN_A_ROW = 5  # Times, at most, that a command is broken before it may end
AT_A_CHANGE = 0.5  # Dimensionless fraction of the kills just before a change of a name or a flush
REPLACED = (".html", ".parquet")  # Endings of files that the next run may replace
PROGRAM = """
import sys
from pathlib import Path
from sautereau.commands.app import main
from tests.kills.disk import trace
trace(Path.cwd(), Path({store!r}), {end_at})
sys.argv = ["sautereau", *{words!r}]
main()
"""


@dataclass
class Tally:
    """What became of the breaks of one command."""

    kills: int = 0
    cuts: int = 0
    runs: int = 0
    """Of the command, broken or not."""
    failures: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class _Known:
    """What an undisturbed run has shown."""

    folder: Path
    seconds: float
    changes: int


class Breaker:
    """Runs commands in a place of its own, and breaks them."""

    def __init__(self, server: CommandServer, place: Path, seed: int):
        self._server, self._place = server, place
        self._dice, self._seed = random.Random(seed), seed
        self._inputs = place / "inputs"
        self._inputs.mkdir()
        make_inputs(server, self._inputs)
        self._known: dict[str, _Known] = {}

    def known(self, name: str) -> _Known:
        """Run a command undisturbed, once."""
        if name not in self._known:
            folder = self._place / f"reference-{name}"
            fresh(COMMANDS[name], self._inputs, folder)
            start = time.monotonic()
            status, store, printed = self._run(COMMANDS[name], folder)
            if status:
                raise RuntimeError(f"{name}: undisturbed, it ended with {status}: {printed}")
            seconds = time.monotonic() - start
            self._known[name] = _Known(folder, seconds, len(notes_in(store)))
            shutil.rmtree(store)
        return self._known[name]

    def run(self, name: str, kills: int, cuts: int, say: Callable[[str], object]) -> Tally:
        """Break a command until there are enough kills and power cuts."""
        tally = Tally()
        while tally.kills < kills or tally.cuts < cuts:
            powered = tally.kills >= kills or (tally.cuts < cuts and self._dice.random() < 0.3)
            try:
                self._series(name, powered, (cuts if powered else kills), tally)
            except Lost as lost:
                tally.failures.append(str(lost))
                say(f"  FAILED {name}: {lost}")
        return tally

    def _series(self, name: str, powered: bool, most: int, tally: Tally) -> None:
        """Break a command some times in a row, then let it end."""
        command, known = COMMANDS[name], self.known(name)
        folder = self._place / "work"
        shutil.rmtree(folder, ignore_errors=True)
        fresh(command, self._inputs, folder)
        announced: dict[str, str] = {}
        for _ in range(IN_A_ROW):
            if (tally.cuts if powered else tally.kills) >= most:
                break
            before = self._place / "before"
            shutil.rmtree(before, ignore_errors=True)
            shutil.copytree(folder, before)
            tally.runs += 1
            status, store, printed = self._run(command, folder, known)
            announced |= {path: digest(folder / path) for path in named(printed, folder)}
            if powered and status < 0:
                image = self._place / "image"
                after_power_cut(before, folder, store, image, self._dice)
                shutil.rmtree(folder)
                image.rename(folder)
            shutil.rmtree(store)
            if status >= 0:
                self._ended(name, status, printed)
                break
            if powered:
                tally.cuts += 1
            else:
                tally.kills += 1
            self._check(announced, folder, "announced, and not as it was after the break")
            command.check_broken(folder, known.folder)
        tally.runs += 1
        status, store, printed = self._run(command, folder)
        shutil.rmtree(store)
        self._ended(name, status, printed)
        self._check(announced, folder, "announced, and changed by the next run")
        command.check(folder, known.folder)
        left = [path.name for path in folder.rglob("*") if LEFT_OVER.search(path.name)]
        if left:
            raise Lost(f"left behind: {', '.join(left)}")

    def _run(
        self, command: Command, folder: Path, known: _Known | None = None
    ) -> tuple[int, Path, str]:
        """Run a command, and kill it if it is known; return status, notes, and what it printed.

        The status is negative if it was killed.
        """
        store = Path(tempfile.mkdtemp(dir=self._place, prefix="store-"))
        at_change = known is not None and self._dice.random() < AT_A_CHANGE
        end_at = self._dice.randint(1, known.changes) if known and at_change else 0
        program = PROGRAM.format(store=str(store), end_at=end_at, words=command.words.split())
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
        with self._server.start("-c", program, cwd=folder, **streams) as process:
            killed = False
            if known and not at_change:
                try:
                    process.wait(self._dice.uniform(0, known.seconds))
                except subprocess.TimeoutExpired:
                    process.kill()
                    killed = True
            printed = process.communicate()[0]
        killed |= bool(end_at) and len(notes_in(store)) == end_at - 1 and process.returncode != 0
        return -9 if killed else process.returncode, store, printed

    @staticmethod
    def _ended(name: str, status: int, printed: str) -> None:
        if status:
            raise Lost(f"the same command ended with {status}: {printed[-400:]}")

    @staticmethod
    def _check(announced: dict[str, str], folder: Path, what: str) -> None:
        for path, expected in announced.items():
            if not path.endswith(REPLACED) and digest(folder / path) != expected:
                raise Lost(f"{path}: {what}")


def digest(path: Path) -> str:
    """Return the SHA-256 of a file; empty for none."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""


def named(printed: str, folder: Path) -> list[str]:
    """Return the files of a folder that a command has named."""
    words = set(re.findall(r"[\w./-]+[\w]", printed))
    found = []
    for path in folder.rglob("*"):
        name = str(path.relative_to(folder))
        if path.is_file() and {name, str(path), path.name} & words:
            found.append(name)
    return found
