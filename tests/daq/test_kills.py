"""kill -9 at a random moment loses a quarter of a second at the most, and spoils nothing."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LIMIT = round(0.25 * 51_200)
"""Samples."""

pytestmark = pytest.mark.skipif(os.name != "posix", reason="SIGKILL is POSIX's")


def lost(folder, kills, block, pace):
    """Return the most samples that were handed over before a kill and are lost."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", "tests.daq.killed"]
        + [str(word) for word in (folder, kills, block, pace)],
        cwd=ROOT,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return int(done.stdout)


def test_two_kills(tmp_path):
    assert lost(tmp_path, 2, 1024, "paced") <= LIMIT


@pytest.mark.slow
@pytest.mark.parametrize(("pace", "block"), [("paced", 512), ("unpaced", 1024)])
def test_a_hundred_kills(tmp_path, pace, block):
    assert lost(tmp_path, 100, block, pace) <= LIMIT
