"""Recordings whose writer is killed lose little; mutated ones are read right, or refused."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

LIMIT = round(0.25 * 51_200)
"""Samples, that a kill may lose."""
MEMORY = 500
"""MiB."""

pytestmark = pytest.mark.skipif(os.name != "posix", reason="SIGKILL and alarms are POSIX's")


def run(program, *words):
    """Run a program of this folder in a process of its own; return the JSON that it prints."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", f"tests.daq.{program}", *map(str, words)],
        cwd=Path(__file__).parents[2],
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize(
    ("kills", "pace", "block"),
    [
        (2, "paced", 1024),
        pytest.param(100, "paced", 512, marks=pytest.mark.slow),
        pytest.param(100, "unpaced", 1024, marks=pytest.mark.slow),
    ],
)
def test_a_kill_loses_a_quarter_of_a_second_at_the_most(tmp_path, kills, pace, block):
    assert run("killed", tmp_path, kills, block, pace) <= LIMIT


@pytest.mark.timeout(3000)
@pytest.mark.parametrize(
    ("seed", "count"), [(0, 30), pytest.param(1000, 10_000, marks=pytest.mark.slow)]
)
def test_a_mutated_file_gives_no_crash_no_hang_and_no_wrong_sample(tmp_path, record, seed, count):
    volts = np.random.default_rng(3).standard_normal((2, 12_000))
    intact = record(tmp_path / "intact.mcap", volts, block=512)
    outcomes = run("mutated", intact, tmp_path, seed, count)
    assert outcomes["refused"] + outcomes.get("read", 0) == count
    assert outcomes["recovered"] >= count / 2
    assert outcomes["peak memory, MiB"] < MEMORY
