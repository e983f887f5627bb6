"""Recordings of any length, stretch by stretch and window by window."""

import numpy as np
import pytest

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.reading import read_window, stream
from sautereau.daq.file.recovery import recover
from tests.daq.damage import chunks, corrupt
from tests.recordings import write_recording

RATE = 51_200.0
N = 70_000
BEGIN = -1000


@pytest.fixture
def volts():
    return np.random.default_rng(8).standard_normal((2, N))


@pytest.fixture
def long(tmp_path, paper, session, volts):
    """A recording of 70,000 samples, 1000 of them before the trigger."""
    options = {"session": session, "monotonic": lambda: 0.0}
    return write_recording(tmp_path / "long.mcap", paper, volts, BEGIN, block=1000, **options)


@pytest.fixture
def holed(long):
    """The same without its third chunk, of 10,240 samples."""
    corrupt(long, chunks(long)[2][0] + 5000)
    found = recover(long)
    assert {(g.first_sample, g.stop_sample) for g in found.gaps} == {(19_480, 29_720)}
    return found.path


@pytest.mark.parametrize("seconds", [0.01, 0.25, 100.0])
def test_a_stream_is_complete(long, volts, seconds):
    stretches = list(stream(long, seconds))
    n = round(seconds * RATE)
    assert [s.first_sample for s in stretches] == list(range(BEGIN, BEGIN + N, n))
    assert all(s.n_samples == n for s in stretches[:-1])
    for row, name in enumerate(("velocity", "force")):
        assert np.array_equal(np.concatenate([s.volts[name] for s in stretches]), volts[row])


def test_no_stretch_spans_a_gap(holed, volts):
    stretches = list(stream(holed, 0.25))
    starts = [s.first_sample for s in stretches]
    assert starts == [-1000, 11_800, 29_720, 42_520, 55_320, 68_120]
    assert stretches[1].first_sample + stretches[1].n_samples == 19_480
    for s in stretches:
        at = s.first_sample - BEGIN
        assert np.array_equal(s.volts["force"], volts[1, at : at + s.n_samples])


@pytest.mark.parametrize(
    ("start", "stop", "first", "last"),
    [
        (BEGIN / RATE, 0.0, -1000, 0),
        (-0.001, 0.001, -51, 52),
        (0.5, 0.75, 25_600, 38_400),
        (1.3, 69_000 / RATE, 66_560, 69_000),
        (BEGIN / RATE, 69_000 / RATE, BEGIN, 69_000),
    ],
)
def test_a_window(long, volts, start, stop, first, last):
    found = read_window(long, start, stop)
    assert found.first_sample == first
    assert np.array_equal(found.volts["velocity"], volts[0, first - BEGIN : last - BEGIN])
    assert np.array_equal(found.volts["force"], volts[1, first - BEGIN : last - BEGIN])
    assert found.time[0] >= start


@pytest.mark.parametrize(("start", "stop"), [(-1.0, 0.0), (1.0, 1.4), (5.0, 6.0)])
def test_a_window_beyond_the_recording(long, start, stop):
    with pytest.raises(RecordingError, match=r"samples are missing.*sautereau info") as caught:
        read_window(long, start, stop)
    assert str(long) in str(caught.value)


@pytest.mark.parametrize("time", [1e10, 1e308, float("inf"), float("nan")])
def test_a_window_beyond_every_recording(long, time):
    for window in ((0.0, time), (-time, 0.0), (time, time)):
        with pytest.raises(RecordingError, match=r"FARTHEST_TIME = 9e\+09 s"):
            read_window(long, *window)
    assert next(stream(long, 1e300)).n_samples == N


def test_a_window_over_a_gap(holed):
    with pytest.raises(RecordingError, match="samples are missing"):
        read_window(holed, 0.4, 0.7)
    assert read_window(holed, 0.7, 0.8).first_sample == 35_840


def test_a_window_reads_nothing_corrupt(long):
    """A changed byte in another chunk does no harm; in its own it is refused."""
    corrupt(long, chunks(long)[3][0] + 5000)
    assert read_window(long, 0.0, 0.2).n_samples == 10_240
    with pytest.raises(RecordingError, match="`sautereau recover"):
        read_window(long, 0.65, 0.7)
    with pytest.raises(RecordingError, match="`sautereau recover"):
        next(stream(long, 0.1))


def test_a_window_without_sense(long):
    with pytest.raises(RecordingError, match="give a later stop"):
        read_window(long, 0.5, 0.5)
    with pytest.raises(RecordingError, match="more than 0 s"):
        next(stream(long, 0.0))
