"""Recordings come back bit for bit, under their name only when whole."""

import json
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from mcap.records import Channel, Header, Message, Metadata
from mcap.stream_reader import StreamReader

from daq.errors import RecordingError
from daq.reading import describe, read_recording
from daq.recording import Block, Recording, SessionInfo
from daq.schemas import declared_class
from rig.load import load_rig

T0 = 1_700_000_000_000_000_000
PAPER = load_rig("paper")
SESSION = SessionInfo(1, "2026-01-01T00:00:00Z", False, "DMC-4123", "USB-6212")


def records(path):
    with path.open("rb") as file:
        return list(StreamReader(file, validate_crcs=True).records)


@settings(max_examples=40, deadline=None)
@given(
    bits=st.lists(
        hnp.arrays(np.uint64, st.tuples(st.just(2), st.integers(1, 300))), min_size=1, max_size=5
    )
)
def test_any_bits_in_blocks_of_any_length_come_back(bits):
    whole = np.concatenate(bits, axis=1)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "press.mcap"
        with Recording(path, PAPER, session=SESSION) as recording:
            for part in bits:
                recording.write_block(Block(recording.n_samples, part.view(np.float64)))
        found = read_recording(path).volts
    for channel, row in zip(PAPER.daq.channels, whole, strict=True):
        assert np.array_equal(found[channel.name].view(np.uint64), row)


def test_everything_beside_the_samples_comes_back(tmp_path, paper, session, volts):
    path = tmp_path / "press.mcap"
    t = np.linspace(0, 0.14, 30)
    with Recording(path, paper, session=session, clock=lambda: T0) as recording:
        recording.write_plan(t, t + 1, t + 2, t + 3)
        recording.write_block(Block(0, volts))
        recording.event("trigger", "PFI0 rose", 0.0)
        recording.write_joints(t, t + 4, t + 5)
    found = read_recording(path)
    assert found.rig == paper
    assert found.rig.sources == paper.sources
    assert found.session == session
    assert found.simulated is True
    assert found.complete is True
    assert found.rate == paper.daq.sample_rate
    assert found.n_samples == 5000
    assert found.plan is not None
    assert found.joints is not None
    assert np.array_equal(found.plan.jack_rise, t + 3)
    assert np.array_equal(found.joints.q2, t + 5)
    assert [(e.time, e.kind, e.text) for e in found.events] == [(0.0, "trigger", "PFI0 rose")]
    assert found.software["mcap"]
    assert found.channels["/daq/velocity"]["scale"] == "0.025 m/s/V"


def test_the_real_rate_of_the_device_is_kept(tmp_path, paper, session, volts):
    path = tmp_path / "press.mcap"
    with Recording(path, paper, session=session, rate=51_203.277) as recording:
        recording.write_block(Block(0, volts))
    assert read_recording(path).rate == 51_203.277


def test_the_head_stands_before_everything_else(tmp_path, record, volts):
    first, *rest = records(record(tmp_path / "press.mcap", volts))
    assert isinstance(first, Header)
    assert first.profile == "sautereau"
    names = [r.name for r in rest if isinstance(r, Metadata)]
    assert names == ["channels", "rig", "software", "session", "schemas"]
    assert all(isinstance(record, Metadata) for record in rest[:5])
    channels = {r.topic: r.id for r in rest if isinstance(r, Channel)}
    assert {t: json.loads(text)["id"] for t, text in rest[0].metadata.items()} == channels


def test_times_do_not_drift(tmp_path, paper, session):
    """51.2 kHz is 19531.25 ns a sample: the last of 102,400 is at 1999980468.75 ns."""
    path = tmp_path / "press.mcap"
    with Recording(path, paper, session=session, clock=lambda: T0) as recording:
        for first in range(0, 102_400, 1024):
            recording.write_block(Block(first, np.zeros((2, 1024))))
        t0 = recording.t0_ns
    assert t0 == T0 - round(1023 * 19531.25)
    messages = [r for r in records(path) if isinstance(r, Message)]
    assert all(m.log_time == m.publish_time for m in messages)
    assert max(m.log_time for m in messages) - t0 == 1_999_980_469
    assert read_recording(path).t0_ns == t0


def test_previews_are_in_si_for_a_viewer(tmp_path, record, paper):
    volts = np.array([np.full(5200, 2.0), np.arange(5200.0)])
    path = record(tmp_path / "press.mcap", volts)
    found = records(path)
    topics = {r.id: r.topic for r in found if isinstance(r, Channel)}
    scalars = {"/preview/velocity": [], "/preview/force": []}
    for r in found:
        if isinstance(r, Message) and topics[r.channel_id] in scalars:
            value = declared_class("Scalar").FromString(r.data).value
            scalars[topics[r.channel_id]].append(value)
    assert scalars["/preview/velocity"] == pytest.approx([0.05] * 100)
    assert scalars["/preview/force"] == pytest.approx(np.arange(100) * 52 + 25.5)


def test_the_name_is_taken_at_the_end_only(tmp_path, paper, session, volts):
    path = tmp_path / "press.mcap"
    with Recording(path, paper, session=session) as recording:
        recording.write_block(Block(0, volts))
        assert recording.part_path.exists()
        assert not path.exists()
    assert [file.name for file in tmp_path.iterdir()] == ["press.mcap"]


def test_an_exception_leaves_a_readable_part(tmp_path, paper, session, volts):
    path = tmp_path / "press.mcap"
    recording = Recording(path, paper, session=session)

    def press():
        with recording:
            recording.write_block(Block(0, volts))
            raise ValueError("the finger fell off")

    with pytest.raises(ValueError, match="the finger fell off") as caught:
        press()
    assert [file.name for file in tmp_path.iterdir()] == ["press.mcap.part"]
    assert str(recording.part_path) in caught.value.__notes__[0]
    found = read_recording(recording.part_path)
    assert found.complete is False
    assert found.events[-1].text == "ValueError: the finger fell off"
    assert np.array_equal(found.volts["force"], volts[1])


@pytest.mark.parametrize("name", ["press.mcap", "press.mcap.part"])
def test_nothing_is_overwritten(tmp_path, paper, session, name):
    (tmp_path / name).write_text("precious")
    with (
        pytest.raises(RecordingError, match="never overwritten") as caught,
        Recording(tmp_path / "press.mcap", paper, session=session),
    ):
        pass
    assert str(tmp_path / name) in str(caught.value)
    assert [file.read_text() for file in tmp_path.iterdir()] == ["precious"]


def test_a_file_that_comes_into_being_meanwhile_stays(tmp_path, paper, session, volts):
    path = tmp_path / "press.mcap"
    recording = Recording(path, paper, session=session)

    def press():
        with recording:
            recording.write_block(Block(0, volts))
            path.write_text("precious")

    with pytest.raises(RecordingError, match="came into being"):
        press()
    assert path.read_text() == "precious"
    assert read_recording(recording.part_path).n_samples == 5000


def test_a_folder_that_is_not_there(tmp_path, paper, session):
    with (
        pytest.raises(RecordingError, match="there is no folder"),
        Recording(tmp_path / "none" / "press.mcap", paper, session=session),
    ):
        pass


@pytest.mark.parametrize(
    ("first", "shape", "message"),
    [
        (1025, (2, 8), "the next one is 1024"),
        (0, (2, 8), "the next one is 1024"),
        (1024, (3, 8), "2 channels"),
        (1024, (8,), "2 channels"),
        (1024, (2, 0), "2 channels"),
    ],
)
def test_a_block_that_does_not_fit(tmp_path, paper, session, first, shape, message):
    recording = Recording(tmp_path / "press.mcap", paper, session=session)
    with recording:
        recording.write_block(Block(0, np.zeros((2, 1024))))
        with pytest.raises(RecordingError, match=message):
            recording.write_block(Block(first, np.zeros(shape)))


def test_series_of_one_length_only(tmp_path, paper, session, volts):
    with Recording(tmp_path / "press.mcap", paper, session=session) as recording:
        recording.write_block(Block(0, volts))
        with pytest.raises(RecordingError, match="one shape"):
            recording.write_joints([0.0, 1.0], [0.0], [0.0, 1.0])


def test_use_outside_the_context(paper, session, tmp_path):
    recording = Recording(tmp_path / "press.mcap", paper, session=session)
    with pytest.raises(RecordingError, match="inside `with"):
        recording.event("fault", "too early", 0.0)


def test_describe_is_json(tmp_path, record, volts):
    path = record(tmp_path / "press.mcap", volts)
    found = json.loads(json.dumps(describe(path)))
    assert found["n_samples"] == 5000
    assert found["duration"] == 5000 / 51_200
    assert found["simulated"] is True
    assert found["messages"]["/daq/force"] == 5
    assert found["messages"]["/preview/force"] == 96
    assert found["size"] == path.stat().st_size
    assert found["session"]["press"] == "3"
