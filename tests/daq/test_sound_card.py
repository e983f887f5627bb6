"""A sound card as the acquisition: over a library that plays counts, and over real PortAudio."""

import itertools
import os
import subprocess
import sys
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

from sautereau.daq.errors import DaqError
from sautereau.daq.source.source import open_source
from sautereau.rig.load import with_values

RATE, N = 48_000, 9600
VALUES = {
    "daq.driver": "sound-card",
    "daq.device": "silence",
    "daq.sample_rate": f"{RATE} Hz",
    "daq.trigger_source": "in3",
    "daq.trigger_timeout": "0.5 s",
    "daq.channels.0.terminal": "in1",
    "daq.channels.1.terminal": "in2",
}


class Stream:
    """Plays the counts of `PLAYED` as PortAudio would, on a thread of its own."""

    counts = np.zeros((0, 3), dtype=np.int32)
    lost_at = -1
    pause = 0
    started = 0.0

    def __init__(self, *, channels, samplerate, blocksize, callback, **_):
        if samplerate != RATE:
            raise PortAudioError("Invalid sample rate")
        self.samplerate, self._size, self._callback = samplerate, blocksize, callback
        self._channels = channels

    def start(self):
        threading.Thread(target=self._play).start()

    def _play(self):
        for first in range(0, len(self.counts), self._size):
            piece = self.counts[first : first + self._size, : self._channels]
            lost = first <= self.lost_at < first + self._size
            # The stream's clock is an hour ahead; the first sample of a piece is 0.1 s old.
            now = time.monotonic() + 3600.0
            times = SimpleNamespace(currentTime=now, inputBufferAdcTime=now - 0.1)
            if first == 0:
                type(self).started = now - 3600.1
            self._callback(piece, len(piece), times, SimpleNamespace(input_overflow=lost))
            if self.pause and first >= self.pause:
                time.sleep(0.2)

    def stop(self, ignore_errors=True):
        pass

    close = stop


class PortAudioError(Exception):
    pass


@pytest.fixture
def played(monkeypatch):
    """Put a library that plays given counts in the place of sounddevice."""
    library = SimpleNamespace(
        InputStream=Stream,
        PortAudioError=PortAudioError,
        query_devices=lambda: [
            {"name": "monitor", "index": 0, "max_input_channels": 0},
            {"name": "USB silence", "index": 1, "max_input_channels": 8},
        ],
    )
    monkeypatch.setitem(sys.modules, "sounddevice", library)

    def play(edge=None, lost_at=-1):
        counts = np.random.default_rng(3).integers(-(2**31), 2**31, (N, 3), dtype=np.int32)
        counts[:, 2] = 0
        if edge is not None:
            counts[edge : edge + 3000, 2] = 2**30
        monkeypatch.setattr(Stream, "counts", counts)
        monkeypatch.setattr(Stream, "lost_at", lost_at)
        return counts[:, :2].T * np.array([[4.0], [9.0]]) / 2**31

    return play


@pytest.fixture
def daq(paper):
    ranges = {"daq.channels.0.range": "4 V", "daq.channels.1.range": "9 V"}
    return with_values(paper, VALUES | ranges).daq


def acquired(daq, duration, *, triggered):
    with open_source(daq, duration, triggered=triggered) as source:
        source.start()
        blocks = list(source.blocks())
    for one, next_one in itertools.pairwise(blocks):
        assert next_one.first_sample == one.first_sample + one.volts.shape[1]
    return blocks[0].first_sample, np.concatenate([block.volts for block in blocks], axis=1)


@pytest.mark.parametrize("before", [0.0, 10e-3])
@pytest.mark.parametrize("edge", [481, 1023, 1024, 1025, 5000])
def test_the_edge_on_an_input_starts_the_recording_at_its_sample(played, daq, before, edge):
    volts = played(edge)
    daq = daq.model_copy(update={"pre_trigger": before})
    first, found = acquired(daq, 0.05, triggered=True)
    early = round(before * RATE)
    assert first == -early
    np.testing.assert_array_equal(found, volts[:, edge - early : edge + 2400])


def test_the_start_waits_for_the_samples_before_the_edge(played, daq, monkeypatch):
    monkeypatch.setattr(Stream, "pause", 1024)
    volts = played(3000)
    daq = daq.model_copy(update={"pre_trigger": 50e-3})  # 2400 samples: the third piece
    with open_source(daq, 0.05, triggered=True) as source:
        begun = time.monotonic()
        source.start()
        assert time.monotonic() - begun > 0.1
        found = np.concatenate([block.volts for block in source.blocks()], axis=1)
    np.testing.assert_array_equal(found, volts[:, 600:5400])
    played(edge=100)
    monkeypatch.setattr(Stream, "counts", np.zeros((1000, 3), dtype=np.int32))
    with (
        open_source(daq.model_copy(update={"trigger_timeout": 0.1}), 0.05) as source,
        pytest.raises(
            DaqError, match=r"1000 samples after 0\.15 s, but daq\.pre_trigger needs 2400"
        ),
    ):
        source.start()


def test_the_edge_is_dated_by_the_converter_not_by_its_arrival(played, daq):
    played(1500)
    with open_source(daq, 0.05, triggered=True) as source:
        source.start()
        counts = [counted for block in source.blocks() for counted in block.counted]
    # All pieces arrive at once, so that the first one alone has the true time of its samples.
    first, *_ = counts
    assert first.asked == pytest.approx(Stream.started, abs=5e-3)
    assert first.stop == 1024 - 1500 + 1  # the edge is in the second piece


def test_without_a_trigger_every_sample_from_the_start(played, daq):
    volts = played()
    first, found = acquired(daq, 0.1, triggered=False)
    assert first == 0
    np.testing.assert_array_equal(found, volts[:, :4800])


def test_faults_say_how_to_fix_them(played, daq):
    played()
    with pytest.raises(DaqError, match=r"no samples within 0\.5 s"):
        acquired(daq, 1.0, triggered=False)
    with pytest.raises(DaqError, match=r"no edge on in3 within 0\.1 s"):
        acquired(daq.model_copy(update={"trigger_timeout": 0.1}), 0.1, triggered=True)
    played(lost_at=2000)
    with pytest.raises(DaqError, match="samples were lost"):
        acquired(daq, 0.1, triggered=False)
    for change, words in (
        ({"device": "Dev1"}, "'USB silence'"),
        ({"sample_rate": 44_100.0}, "Invalid sample rate"),
        ({"trigger_source": "PFI0"}, "in1, in2"),
    ):
        with pytest.raises(DaqError, match=words):
            acquired(daq.model_copy(update=change), 0.1, triggered=True)


REAL = """
import sys
from sautereau.daq.source.continuous import record
from sautereau.rig.load import load_rig, with_values
values = dict(zip(sys.argv[2::2], sys.argv[3::2], strict=True))
print(record(with_values(load_rig("paper"), values), __import__("pathlib").Path(sys.argv[1]), 0.2))
"""


def test_it_records_from_a_real_stream(tmp_path):
    """PortAudio reads an ALSA device of zeros; skipped where its library is missing."""
    try:
        import sounddevice  # noqa: F401
    except (ImportError, OSError) as error:
        pytest.skip(f"no PortAudio: {error}")
    (tmp_path / ".asoundrc").write_text("pcm.silence { type null }\n")
    words = [word for pair in VALUES.items() for word in pair]
    done = subprocess.run(
        [sys.executable, "-c", REAL, str(tmp_path / "a.mcap"), *words],
        env=os.environ | {"HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    if "no such input device" in done.stderr:
        pytest.skip("ALSA has no null device")
    assert done.stdout == f"{N}\n", done.stderr
