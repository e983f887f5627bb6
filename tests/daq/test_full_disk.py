"""A disk that fills up: the error names the file left behind and the remedy."""

import errno
import os
import subprocess
import sys

import numpy as np
import pytest

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.durable import DurableFile
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recovery import recover

# Runs under a limit of the file's size: the write at the limit is refused with EFBIG.
SCRIPT = """
import resource, sys
import numpy as np
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.recording import Block, Recording, SessionInfo
from sautereau.rig.load import load_rig

path, limit, blocks = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
if limit:
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
volts = np.random.default_rng(0).standard_normal((2, blocks * 1024))
session = SessionInfo(1, "2026-01-01T00:00:00Z", True, "c", "d")
try:
    with Recording(path, load_rig(), session=session, clock=lambda: 10**18,
                   monotonic=lambda: 0.0) as recording:
        for first in range(0, volts.shape[1], 1024):
            recording.write_block(Block(first, volts[:, first:first + 1024]))
except RecordingError as error:
    print(error)
    sys.exit(3)
"""


def run(path, limit, blocks):
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", SCRIPT, str(path), str(limit), str(blocks)],
        capture_output=True,
        text=True,
        check=False,
    )


def is_all_that_fitted(part, share):
    """Return whether samples come back, the first ones, and all but a chunk of what fitted."""
    found = recover(part).samples["force"]
    volts = np.random.default_rng(0).standard_normal((2, 40 * 1024))
    read = read_recording(part.with_suffix(""))
    chunk = 11 * 1024
    return found >= share * 40 * 1024 - chunk and np.array_equal(
        np.stack(list(read.volts.values())), volts[:, :found]
    )


@pytest.mark.skipif(os.name != "posix", reason="limits of the file size are POSIX's")
def test_a_limit_reached_anywhere_is_one_error(tmp_path):
    whole = tmp_path / "whole.mcap"
    assert run(whole, 0, 40).returncode == 0
    size = whole.stat().st_size
    # In the head, in a chunk, in the last chunk as it is closed, in the summary, at the end.
    for limit in (1000, size // 2, size - 5000, size - 300, size - 1):
        path = tmp_path / f"{limit}.mcap"
        ended = run(path, limit, 40)
        assert ended.returncode == 3, ended.stderr
        assert ended.stderr == ""
        assert "raise the limit" in ended.stdout
        assert f"left in {path}.part" in ended.stdout
        assert not path.exists()
        part = tmp_path / f"{limit}.mcap.part"
        assert 0 < part.stat().st_size <= limit
        assert f"`sautereau recover {part}`" in ended.stdout
        if limit > 1000:
            assert is_all_that_fitted(part, limit / size)
    path = tmp_path / "exact.mcap"
    assert run(path, size, 40).returncode == 0


@pytest.mark.parametrize(
    ("code", "remedy"),
    [
        (errno.ENOSPC, "the disk is full; free some space"),
        (errno.EDQUOT, "quota is used up; free some space"),
        (errno.EFBIG, "raise the limit"),
        (errno.EIO, "see to the disk"),
    ],
)
def test_each_fault_has_its_remedy(tmp_path, code, remedy):
    file = DurableFile(tmp_path / "press.mcap")
    with pytest.raises(RecordingError) as caught, file.writing():
        raise OSError(code, os.strerror(code))
    file.stream.close()
    assert remedy in str(caught.value)
    assert f"left in {file.part_path}" in str(caught.value)
