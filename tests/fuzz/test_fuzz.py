"""Cases that failed once, some of damaged files, and a short run of every format."""

import contextlib
import os
import random
import re
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from sautereau.rig.errors import SautereauError
from tests.budget import amount, slow
from tests.fuzz.run import Wrong, one, run
from tests.fuzz.targets import SURROUNDINGS, TARGETS

FOUND = [line.split() for line in Path(__file__).with_name("found.txt").read_text().splitlines()]
QUICK = ("session", "learned", "profile", "fit", "npz", "card-client")

pytestmark = pytest.mark.skipif(os.name != "posix", reason="processes are forked and limited")


@pytest.mark.parametrize(
    ("name", "number"),
    [(name, int(number)) if name in QUICK else slow(name, int(number)) for name, number in FOUND],
)
def test_what_failed_once(tmp_path, name, number):
    target = TARGETS[name]()(tmp_path)
    one(target, name, number)
    # The target of names, environment and clocks has a server of commands.
    getattr(getattr(target.case, "__self__", None), "close", lambda: None)()
    # Thousands of nested folders, on which pytest's own cleaning of a later run would end.
    subprocess.run(["rm", "-rf", *map(str, tmp_path.iterdir())], check=True)


IN_PROCESS = ("rig", "csv", "parquet", "wav", "tdms")
"""The others are read in a process of their own."""


@pytest.mark.parametrize(
    "name",
    [*IN_PROCESS, "npz", *map(slow, ("mat", "h5", "lvm", "uff", "xlsx", "mf4", "mcap", "db3"))],
)
def test_damaged_rigs_and_files_of_other_programs_are_refused_or_read_right(tmp_path, name):
    target = TARGETS[name]()(tmp_path)
    for number in range(6 if name in IN_PROCESS else 2):  # read in a process of their own
        one(target, name, number)


def fuzzed(*words):
    """Return what a run prints: in a process of its own, for its peak memory and its threads."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", "tests.fuzz", *words],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_damaged_recordings_give_no_crash_no_hang_and_no_wrong_sample():
    said = fuzzed("recording", "lengths", "--first", "0", "--count", "15", "--seconds", "1000")
    assert "30 cases, 0 failed" in said
    assert max(map(int, re.findall(r"(\d+) MiB", said))) < 500
    recovered = re.findall(r"recovered (\d+)", said)
    assert sum(map(int, recovered)) >= 15


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in TARGETS if name not in SURROUNDINGS])
def test_a_short_run(name):
    """Cases that exceed a limit of time or memory count as failed."""
    said = fuzzed(name, "--first", "0", "--seconds", str(amount(6, 20)))
    assert int(re.search(r"(\d+) cases, 0 failed", said)[1]) > 2


class Target:
    """Fails in three ways, and is refused otherwise."""

    def __init__(self, folder):
        self.number = -1

    def case(self, dice):
        self.number += 1
        match self.number:
            case 1:
                raise ZeroDivisionError
            case 2:
                raise Wrong("a wrong sample")
            case 3:
                os.kill(os.getpid(), 9)
        return "read"


def test_every_failure_is_counted():
    tally = run("target", Target, count=5)
    assert tally.outcomes == {"read": 2}
    assert set(tally.failures) == {1, 2, 3}
    assert "ZeroDivisionError" in tally.failures[1]
    assert "a wrong sample" in tally.failures[2]
    assert tally.failures[3] == "the process has ended"


def test_a_case_is_always_the_same(tmp_path):
    made = []
    for _ in range(2):
        target = TARGETS["profile"]()(tmp_path)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for number in range(5):
                with contextlib.suppress(SautereauError):
                    target.case(random.Random(f"profile {number}"))
                made.append((tmp_path / "profile.toml").read_bytes())
    assert made[:5] == made[5:]
