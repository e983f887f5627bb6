"""Whatever is done to a file: no crash, no hang, no wrong sample, and memory within bounds."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
MEMORY = 500
"""MiB."""

pytestmark = pytest.mark.skipif(os.name != "posix", reason="alarms and peak memory are POSIX's")


def mutated(intact, folder, seed, count):
    """Return what became of ``count`` mutations of a recording."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", "tests.daq.mutated"]
        + [str(word) for word in (intact, folder, seed, count)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture
def intact(tmp_path, record):
    volts = np.random.default_rng(3).standard_normal((2, 12_000))
    return record(tmp_path / "intact.mcap", volts, block=512)


def test_some_mutations(tmp_path, intact):
    outcomes = mutated(intact, tmp_path, 0, 30)
    assert outcomes["refused"] + outcomes.get("read", 0) == 30
    assert outcomes["recovered"] > 15
    assert outcomes["peak memory, MiB"] < MEMORY


@pytest.mark.slow
@pytest.mark.timeout(3000)
def test_ten_thousand_mutations(tmp_path, intact):
    outcomes = mutated(intact, tmp_path, 1000, 10_000)
    assert outcomes["refused"] + outcomes.get("read", 0) == 10_000
    assert outcomes["recovered"] > 5000
    assert outcomes["peak memory, MiB"] < MEMORY
