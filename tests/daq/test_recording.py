"""Recordings are read back bit for bit, and get their name only when complete."""

import itertools
import json
import os
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from mcap.records import Channel, Chunk, Header, Metadata
from mcap.stream_reader import StreamReader

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import Event, Joints
from sautereau.daq.file.recording import Block, Recording, SessionInfo
from sautereau.daq.file.recovery import recover
from sautereau.daq.file.samples import Scaling
from sautereau.daq.file.survey import describe
from sautereau.rig.load import load_rig
from tests.budget import examples
from tests.daq.damage import record_and
from tests.daq.declared import messages, records

T0 = 1_700_000_000_000_000_000
PAPER = load_rig("paper")
SESSION = SessionInfo(1, "2026-01-01T00:00:00Z", False, "DMC-4123", "USB-6212")


BITS = st.lists(
    hnp.arrays(np.uint64, st.tuples(st.just(2), st.integers(1, 300))), min_size=1, max_size=5
)


@examples(10, 300)
@given(BITS)
def test_any_bits_in_blocks_of_any_length_come_back(bits):
    together = np.concatenate(bits, axis=1)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "press.mcap"
        with Recording(path, PAPER, session=SESSION, t0_ns=T0) as recording:  # of a file
            for part in bits:
                recording.write_block(Block(recording.n_samples, part.view(np.float64)))
        found = read_recording(path).volts
    for channel, row in zip(PAPER.daq.channels, together, strict=True):
        assert np.array_equal(found[channel.name].view(np.uint64), row)


def test_an_interrupt_while_a_recording_is_closed_names_its_file(tmp_path, monkeypatch):
    """The file was left without a word, as that of an earlier session."""
    path = tmp_path / "press.mcap"

    def interrupted(recording, file):
        raise KeyboardInterrupt

    monkeypatch.setattr(Recording, "_close", interrupted)
    with (
        pytest.raises(KeyboardInterrupt) as caught,
        Recording(path, PAPER, session=SESSION, t0_ns=T0) as recording,
    ):
        recording.write_block(Block(0, np.zeros((2, 100_000))))
    (note,) = caught.value.__notes__
    assert f"{path}.part" in note
    assert recover(tmp_path / "press.mcap.part", path).samples["force"] > 50_000


def test_everything_beside_the_samples_comes_back(complete_recording, paper, session):
    t = np.linspace(0, 0.14, 30)
    found = read_recording(complete_recording)
    assert found.rig == paper
    assert found.rig.sources == paper.sources
    assert found.session == session
    assert found.simulated is True
    assert repr(found) == f"<Recorded: {found.n_samples} samples of velocity, force at 51203.3 Hz>"
    assert found.complete is True
    assert found.rate == 51_203.277
    assert found.n_samples == 5000
    assert found.plan is not None
    assert found.joints is not None
    assert np.array_equal(found.plan.jack_rise, t + 3)
    assert np.array_equal(found.joints.q2, t + 5)
    assert found.events == (
        Event(0.0, "trigger", "PFI0 rose"),
        Event(1.2e-3, "motion", "started", 3e-5),
    )
    assert found.motion == found.events[1]
    assert found.software["mcap"]
    metadata = found.channels["/daq"]
    assert (metadata["type"], metadata["channels"]) == ("float64", '["velocity", "force"]')
    assert json.loads(metadata["channel velocity"])["scale"] == "0.025 m/s/V"


def test_the_head_stands_before_everything_else(tmp_path, record, volts):
    first, *rest = records(record(tmp_path / "press.mcap", volts))
    assert isinstance(first, Header)
    assert first.profile == "sautereau"
    names = [r.name for r in rest if isinstance(r, Metadata)]
    head = ["channels", "rig", "software", "session", "schemas"]
    assert names == [*head, *(f"{name} (copy)" for name in head), "end"]
    assert all(isinstance(record, Metadata) for record in rest[:10])
    channels = {r.topic: r.id for r in rest if isinstance(r, Channel)}
    result = {t: text for t, text in rest[0].metadata.items() if t != "crc32"}
    assert {t: json.loads(text)["id"] for t, text in result.items()} == channels


def test_previews_are_in_si_for_a_viewer(tmp_path, record, paper):
    volts = np.array([np.full(5252, 2.0), np.arange(5252.0)])
    path = record(tmp_path / "press.mcap", volts)
    rows = [row for _, _, row in messages(path, "/preview")]
    assert [row.velocity for row in rows] == pytest.approx([0.05] * 89)
    assert [row.force for row in rows] == pytest.approx(np.arange(89) * 52 + 326)


@pytest.mark.parametrize("early", [True, False])
def test_messages_are_in_the_order_of_their_times(tmp_path, paper, session, early):
    """Only what is given after the samples of its time follows them, as the joints of a press."""
    path, t = tmp_path / "press.mcap", np.arange(0.0, 1.9, 0.002)
    joints = Joints(t, t + 1, t + 2, e1=t, e2=t)
    with Recording(path, paper, session=session, t0_ns=T0) as recording:
        if early:
            recording.write_joints(joints)
        for first in range(-2000, 100_000, 1000):
            recording.write_block(Block(first, np.zeros((2, 1000))))
            if first == 0:
                recording.event("trigger", "rose", 0.0)
        recording.flush()
        if not early:
            recording.write_joints(joints)
        recording.event("stopped", "here", 100_000 / 51_200)
    found = messages(path)
    motion = [(at, row) for topic, at, row in found if topic == "/motion"]
    late = () if early else ("/joints", "/motion", "/events")
    assert [at for at, _ in motion] == sorted(at for at, _ in motion)
    times = [at for topic, at, _ in found if topic not in late]
    assert times == sorted(times)
    topics = [topic for topic, _, _ in found]
    assert topics.count("/preview") == (102_000 - 653) // 52 + 1
    events = [(at, row.name) for topic, at, row in found if topic == "/events"]
    assert events == [(T0, "trigger"), (T0 + 1_953_125_000, "stopped")]
    at, row = motion[9]
    time = (at - T0) / 1e9
    assert (row.q1, row.q2, row.e2) == pytest.approx((time + 1, time + 2, time))
    assert np.isnan(row.m1)


def test_counts_and_their_polynomials_come_back(tmp_path, paper, session):
    """int16 and int32; the volts are those of Horner's rule, in doubles."""
    for kind, most in (("int16", 2**15), ("int32", 2**31)):
        counts = np.random.default_rng(1).integers(-most, most, (2, 30_000)).astype(kind)
        coefficients = np.array([[1e-3, 3e-4, 2e-12, -1e-17], [0.0, 2e-4, 0.0, 0.0]])
        scaling = Scaling(kind, coefficients)
        path = tmp_path / f"{kind}.mcap"
        with Recording(path, paper, session=session, scaling=scaling) as recording:
            for at in range(0, 30_000, 999):
                block = Block(at, counts[:, at : at + 999], scaling=scaling)
                recording.write_block(block)
        read = np.stack(list(read_recording(path).volts.values()))
        polynomials = [
            np.polynomial.polynomial.polyval(*pair)
            for pair in zip(counts, coefficients, strict=True)
        ]
        assert np.array_equal(read, polynomials)
        assert np.array_equal(block.volts, read[:, block.first_sample :])
        kept = b"".join(row.data for _, _, row in messages(path, "/daq"))
        assert len(kept) == counts.nbytes
        (first, *_) = (row.data for _, _, row in messages(path, "/daq"))
        stored = np.frombuffer(first, counts.dtype).reshape(2, -1)
        assert np.array_equal(stored, counts[:, : stored.shape[1]])
        assert path.stat().st_size < 1.25 * counts.nbytes + 60_000


def test_samples_of_another_type_are_refused(tmp_path, paper, session):
    with (
        pytest.raises(RecordingError, match="a block of int16 samples at sample 0; it was opened"),
        Recording(tmp_path / "press.mcap", paper, session=session) as recording,
    ):
        recording.write_block(Block(0, np.zeros((2, 8), np.int16)))


def test_an_exception_leaves_a_readable_part(tmp_path, paper, session, volts):
    recording = Recording(tmp_path / "press.mcap", paper, session=session)
    with pytest.raises(ZeroDivisionError) as caught:
        record_and(recording, volts, lambda: 1 / 0)
    assert [file.name for file in tmp_path.iterdir()] == ["press.mcap.part"]
    assert str(recording.part_path) in caught.value.__notes__[0]
    found = read_recording(recording.part_path)
    assert found.complete is False
    assert found.events[-1].text == "ZeroDivisionError: division by zero"
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
    with pytest.raises(RecordingError, match="created it meanwhile"):
        record_and(recording, volts, lambda: path.write_text("precious"))
    assert path.read_text() == "precious"
    assert read_recording(recording.part_path).n_samples == 5000


def test_folders_that_cannot_be_written(tmp_path, paper, session):
    cases = {tmp_path / "none": "there is no folder"}
    if os.name == "posix":
        cases[Path("/proc")] = "cannot be written"
    for folder, message in cases.items():
        with (
            pytest.raises(RecordingError, match=message),
            Recording(folder / "press.mcap", paper, session=session),
        ):
            pass


@pytest.mark.parametrize(
    ("first", "shape", "message"),
    [
        (1025, (2, 8), "the next sample is 1024"),
        (0, (2, 8), "the next sample is 1024"),
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
        with pytest.raises(RecordingError, match="same shape"):
            recording.write_joints(Joints(np.array([0.0, 1.0]), np.zeros(1), np.array([0.0, 1.0])))


def test_use_outside_the_context(paper, session, tmp_path):
    recording = Recording(tmp_path / "press.mcap", paper, session=session)
    with pytest.raises(RecordingError, match="inside `with"):
        recording.event("fault", "too early", 0.0)


def test_a_recording_begins_at_the_trigger_or_before(tmp_path, paper, session):
    with Recording(tmp_path / "late.mcap", paper, session=session) as recording:
        with pytest.raises(RecordingError, match="starts at sample 1, but the next sample is 0"):
            recording.write_block(Block(1, np.zeros((2, 8))))
        recording.write_block(Block(-3, np.arange(16.0).reshape(2, 8)))
        assert recording.n_samples == 8
        with pytest.raises(RecordingError, match="starts at sample 0, but the next sample is 5"):
            recording.write_block(Block(0, np.zeros((2, 8))))
        recording.write_block(Block(5, np.zeros((2, 8))))
    found = read_recording(tmp_path / "late.mcap")
    assert found.first_sample == -3
    assert found.n_samples == 16
    assert found.time[3] == 0.0
    described = describe(tmp_path / "late.mcap")
    assert described["first_sample"] == -3
    assert described["size"] == (tmp_path / "late.mcap").stat().st_size
    json.dumps(described)
    assert described["missing"] == []


@pytest.mark.parametrize("compress", [True, False])
def test_sixteen_channels_in_blocks_of_any_size(tmp_path, session, compress):
    """Every chunk holds 0.2 s of all channels, and no more."""
    rig = with_channels(PAPER, 16)
    volts = np.random.default_rng(4).standard_normal((16, 90_000))
    path = tmp_path / "long.mcap"
    with Recording(path, rig, session=session, compress=compress) as recording:
        for first, stop in itertools.pairwise([0, 1, 60_000, 60_007, 90_000]):
            recording.write_block(Block(first, volts[:, first:stop]))
    found = read_recording(path)
    assert np.array_equal(np.stack(list(found.volts.values())), volts)
    with path.open("rb") as file:
        chunks = [r for r in StreamReader(file, emit_chunks=True).records if isinstance(r, Chunk)]
    assert max(chunk.uncompressed_size for chunk in chunks) < 1_400_000


def test_a_plan_larger_than_readers_accept_is_refused_and_no_more(tmp_path, paper, session, volts):
    t = np.zeros(2_200_000)
    path = tmp_path / "press.mcap"
    with Recording(path, paper, session=session) as recording:
        with pytest.raises(RecordingError, match="exceeds the limit of 33554432 bytes"):
            recording.write_plan(t, t, t, t)
        recording.write_block(Block(0, volts))
    assert read_recording(path).plan is None


def with_channels(rig, n):
    """Return a rig with n channels, copies of its force channel."""
    force = rig.daq.channel("force")
    channels = tuple(
        force.model_copy(update={"name": f"c{i}", "terminal": f"ai{i}"}) for i in range(n)
    )
    return rig.replaced({"daq.channels": channels})
