"""A disk that fills up: the error names the file left behind and how to fix it."""

import errno
import os
from contextlib import contextmanager

import numpy as np
import pytest

from sautereau.daq.convert.importing import write_part
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.durable import DurableFile
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recovery import recover
from tests.recordings import write_recording

BLOCKS = 40
VOLTS = np.random.default_rng(0).standard_normal((2, BLOCKS * 1024))


@contextmanager
def largest_file(size):
    """Limit the size of this process's files: a write at the limit is refused with EFBIG."""
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def record(path, rig):
    clocks = {"clock": lambda: 10**18, "monotonic": lambda: 0.0}
    write_recording(path, rig, VOLTS, block=1024, **clocks)


def is_all_that_fitted(part, share):
    """Return whether samples come back, the first ones, and all but a chunk of what fitted."""
    found = recover(part).samples["force"]
    read = read_recording(part.with_suffix(""))
    chunk = 11 * 1024
    return found >= share * BLOCKS * 1024 - chunk and np.array_equal(
        np.stack(list(read.volts.values())), VOLTS[:, :found]
    )


@pytest.mark.skipif(os.name != "posix", reason="limits of the file size are POSIX's")
def test_a_limit_reached_anywhere_is_one_error(tmp_path, paper):
    complete = tmp_path / "complete.mcap"
    record(complete, paper)
    size = complete.stat().st_size
    # In the head, in a chunk, in the last chunk as it is closed, in the summary, at the end.
    for limit in (1000, size // 2, size - 5000, size - 300, size - 1):
        path = tmp_path / f"{limit}.mcap"
        part = tmp_path / f"{limit}.mcap.part"
        said = f"raise the limit.*what was written before is in {part}.*`sautereau recover {part}`"
        with pytest.raises(RecordingError, match=said), largest_file(limit):
            record(path, paper)
        assert not path.exists()
        assert 0 < part.stat().st_size <= limit
        if limit > 1000:
            assert is_all_that_fitted(part, limit / size)
    with largest_file(size):
        record(tmp_path / "exact.mcap", paper)


@pytest.mark.parametrize(
    ("code", "how_to_fix"),
    [
        (errno.ENOSPC, "the disk is full; free some space"),
        (errno.EDQUOT, "quota is used up; free some space"),
        (errno.EFBIG, "raise the limit"),
        (errno.EIO, "check the disk"),
    ],
)
def test_each_fault_says_how_to_fix_it(tmp_path, code, how_to_fix):
    file = DurableFile(tmp_path / "press.mcap")
    said = f"{how_to_fix}.*is in {file.part_path}"
    with pytest.raises(RecordingError, match=said), file.writing():
        raise OSError(code, os.strerror(code))
    file.stream.close()


@pytest.mark.skipif(os.name != "posix", reason="limits of the file size are POSIX's")
@pytest.mark.parametrize("limit", [1, 1000, 5000, -300])
def test_a_recording_that_is_made_of_another_file_leaves_nothing_behind(tmp_path, paper, limit):
    complete, copy = tmp_path / "complete.mcap", tmp_path / "copy.mcap"
    record(complete, paper)
    recorded = read_recording(complete)
    limit = limit if limit > 0 else complete.stat().st_size + limit
    with pytest.raises(RecordingError) as caught, largest_file(limit):
        write_part(recorded, 0, recorded.n_samples, copy, 1)
    assert "raise the limit" in str(caught.value)
    assert ".part" not in str(caught.value)
    assert not hasattr(caught.value, "__notes__")
    assert [path.name for path in tmp_path.iterdir()] == ["complete.mcap"]
