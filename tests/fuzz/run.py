"""Run the cases of a format in a process with limits, and count what became of them.

A case is a format and a number: it is always the same. A case fails if anything but an error of
the project leaves, if a wrong sample is accepted, or if it exceeds a limit of time or memory.
"""

import faulthandler
import json
import os
import random
import re
import resource
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from sautereau.rig.errors import SautereauError

LONGEST = 20.0  # s, limit of one case, on a processor of its own
HANGING = 120.0  # s of real time after which a case is ended that may wait for something
MOST_MEMORY = 1 << 30  # Byte, limit of the process, and of those that it starts
HARD_LIMIT = 4 << 30
"""Byte of address space at which the system refuses more, which protects the machine."""


class Wrong(Exception):  # noqa: N818
    """A wrong sample was accepted, or something else is not as promised."""


class Target(Protocol):
    """A format: made once, with a folder of its own."""

    def case(self, dice: random.Random) -> str:
        """Make one hostile input and read it; return what became of it.

        Raises:
            SautereauError: It was refused.
            Wrong: It was accepted, and should not have been.
        """
        ...


@dataclass
class Tally:
    """What became of the cases of one format."""

    outcomes: Counter[str] = field(default_factory=Counter)
    failures: dict[int, str] = field(default_factory=dict)
    """Traceback, or exceeded limit, by number of the case."""
    longest: float = 0.0
    """s."""
    memory: int = 0
    """Byte, peak."""

    @property
    def cases(self) -> int:
        return self.outcomes.total() + len(self.failures)


def one(target: Target, name: str, number: int) -> str:
    """Run a case; return its outcome.

    Raises:
        Exception: Anything but an error of the project.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return target.case(random.Random(f"{name} {number}"))
        except SautereauError as error:
            if not str(error).strip():
                raise Wrong("refused without a message") from error
            return "refused"


def peak_memory() -> int:
    """Return the peak of this process, byte, and of those it has started, whichever is larger."""
    found = re.search(r"VmHWM:\s+(\d+)", Path("/proc/self/status").read_text(encoding="utf-8"))
    children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    return 1024 * max(int(found[1]) if found else 0, children)


def _work(
    name: str, make: Callable[[Path], Target], numbers: Iterable[int], until: float, folder: Path
) -> None:
    """Run cases until the time is over; a line of JSON for each goes to a file."""
    resource.setrlimit(resource.RLIMIT_AS, (HARD_LIMIT, HARD_LIMIT))
    quiet = os.open(os.devnull, os.O_RDWR)
    os.dup2(quiet, 0)
    os.dup2(quiet, 1)
    hung = (folder / "hung").open("w")
    with (folder / "lines").open("a", buffering=1) as lines:
        os.dup2(hung.fileno(), 2)
        place = folder / "place"
        place.mkdir(exist_ok=True)
        target = make(place)
        for number in numbers:
            if time.monotonic() >= until:
                break
            lines.write(json.dumps({"start": number}) + "\n")
            faulthandler.dump_traceback_later(HANGING, exit=True, file=hung)
            start, before = time.process_time(), peak_memory()
            try:
                said = {"outcome": one(target, name, number)}
            except BaseException:  # noqa: BLE001 (that is what is sought)
                said = {"failure": traceback.format_exc()}
            faulthandler.cancel_dump_traceback_later()
            took, memory = time.process_time() - start, peak_memory()
            if took > LONGEST:
                said = {"failure": f"{took:.1f} s\n{said}"}
            if memory > MOST_MEMORY >= before:
                said = {"failure": f"memory {memory / 2**20:.0f} MiB\n{said}"}
            lines.write(json.dumps({"memory": memory, "time": took, **said}) + "\n")
            if memory > MOST_MEMORY:
                break  # the peak of the next ones could not be seen
        lines.write(json.dumps({"end": True}) + "\n")


def run(
    name: str,
    make: Callable[[Path], Target],
    first: int = 0,
    seconds: float = 1e9,
    count: int = 10**9,
) -> Tally:
    """Run the cases ``first``, ``first + 1``, ... of a format for a time, or a number of them."""
    tally, until, at = Tally(), time.monotonic() + seconds, first
    while at < first + count and time.monotonic() < until:
        folder = Path(tempfile.mkdtemp(prefix="sautereau-fuzz-"))
        sys.stdout.flush()
        child = os.fork()
        if child == 0:
            try:
                _work(name, make, range(at, first + count), until, folder)
            except BaseException:  # noqa: BLE001
                (folder / "broken").write_text(traceback.format_exc())
            finally:
                os._exit(0)
        os.waitpid(child, 0)
        before = at
        at = _collect(folder, at, tally)
        subprocess.run(["rm", "-rf", folder], check=False)  # may be deeper than rmtree can follow
        if at == before and time.monotonic() < until:
            raise RuntimeError(f"{name}: no case runs: {tally.failures.get(at, 'it ends at once')}")
    return tally


def _collect(folder: Path, at: int, tally: Tally) -> int:
    """Add what a process has written; return the number of the next case."""
    current, ended = None, False
    for line in (folder / "lines").read_text().splitlines():
        found = json.loads(line)
        if "start" in found:
            current = found["start"]
        elif "end" in found:
            ended = True
        else:
            if "failure" in found:
                tally.failures[current] = found["failure"]
            else:
                tally.outcomes[found["outcome"]] += 1
            tally.longest = max(tally.longest, found["time"])
            tally.memory = max(tally.memory, found["memory"])
            at, current = current + 1, None
    if (folder / "broken").exists():
        raise RuntimeError((folder / "broken").read_text())
    if current is not None and not ended:
        hung = (folder / "hung").read_text(errors="replace")
        tally.failures[current] = hung or "the process has ended"
        tally.longest = max(tally.longest, HANGING if hung else 0.0)
        at = current + 1
    return at
