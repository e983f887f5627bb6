"""Recordings whose writer is killed lose little."""

import os

import pytest

from tests.budget import amount

LONG = [pytest.mark.slow, pytest.mark.timeout(1200)]
LIMIT = round(0.25 * 51_200)  # Samples, that a kill may lose

pytestmark = pytest.mark.skipif(os.name != "posix", reason="SIGKILL is POSIX's")


@pytest.mark.parametrize(
    ("kills", "pace", "block"),
    [
        (2, "paced", 1024),
        pytest.param(amount(20, 100), "paced", 512, marks=LONG),
        pytest.param(amount(20, 100), "unpaced", 1024, marks=LONG),
    ],
)
def test_a_kill_loses_a_quarter_of_a_second_at_the_most(
    tmp_path, command_server, kills, pace, block
):
    (tmp_path / "made").mkdir()
    words = ("-c", "from tests.daq.killed import main; main()", tmp_path / "made")
    done = command_server.run(*words, kills, block, pace, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) <= LIMIT
