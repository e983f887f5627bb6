"""Recordings whose writer is killed lose little."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

LONG = [pytest.mark.slow, pytest.mark.timeout(1200)]
LIMIT = round(0.25 * 51_200)
"""Samples, that a kill may lose."""

pytestmark = pytest.mark.skipif(os.name != "posix", reason="SIGKILL is POSIX's")


@pytest.mark.parametrize(
    ("kills", "pace", "block"),
    [
        (2, "paced", 1024),
        pytest.param(100, "paced", 512, marks=LONG),
        pytest.param(100, "unpaced", 1024, marks=LONG),
    ],
)
def test_a_kill_loses_a_quarter_of_a_second_at_the_most(tmp_path, kills, pace, block):
    words = [tmp_path, kills, block, pace]
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", "tests.daq.killed", *map(str, words)],
        cwd=Path(__file__).parents[2],
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) <= LIMIT
