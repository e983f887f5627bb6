"""What the writer of recordings accepts is read back; what readers refuse is refused before."""

from dataclasses import replace

import numpy as np
import pytest

from sautereau.daq.errors import RecordingError
from sautereau.daq.file import recording as written
from sautereau.daq.file.container.records import LARGEST_CHUNK
from sautereau.daq.file.limits import FARTHEST_TIME, HIGHEST_RATE
from sautereau.daq.file.provenance import LARGEST_HEAD, check_recordable
from sautereau.daq.file.reading import read_recording, read_session
from sautereau.daq.file.recorded import Block, Joints
from sautereau.daq.file.recording import Recording
from sautereau.daq.file.recovery import recover
from sautereau.daq.file.survey import describe
from sautereau.rig.schema import Gesture
from tests.daq.damage import corrupt_chunk, record_and
from tests.recordings import write_recording

VOLTS = np.zeros((2, 100))


def gesture_of(rig, n):
    """Return a rig whose press is a gesture of n points."""
    time = np.linspace(0, 1, n)
    gesture = Gesture.model_construct(time=tuple(time.tolist()), rise=tuple((5e-3 * time).tolist()))
    return rig.model_copy(update={"press": rig.press.model_copy(update={"gesture": gesture})})


@pytest.mark.parametrize("n", [0, 1_000_000, LARGEST_HEAD - 40_000])
def test_long_notes_are_read_back(tmp_path, paper, session, n):
    session = replace(session, notes="ö" * (n // 2))
    path = write_recording(tmp_path / "press.mcap", paper, VOLTS, session=session)
    assert read_recording(path).session == read_session(path) == session
    assert describe(path)["session"]["notes"] == session.notes


def test_longer_notes_are_refused_before_the_file_exists(tmp_path, paper, session):
    notes = "x" * 2_500_000
    for refused in (
        lambda: Recording(tmp_path / "press.mcap", paper, session=replace(session, notes=notes)),
        lambda: check_recordable(paper, notes),
    ):
        said = f"session notes 2500000 bytes.*LARGEST_HEAD = {LARGEST_HEAD}; shorten"
        with pytest.raises(RecordingError, match=said):
            refused()
    assert not list(tmp_path.iterdir())


def test_a_gesture_that_is_accepted_is_read_back(tmp_path, paper, session):
    rig = gesture_of(paper, 20_000)
    path = write_recording(tmp_path / "press.mcap", rig, VOLTS, session=session)
    assert read_recording(path).rig == rig


def test_a_gesture_that_no_reader_accepts_is_refused(paper):
    with pytest.raises(RecordingError, match=r"rig json \d+ bytes.*press\.gesture"):
        check_recordable(gesture_of(paper, 60_000), "")


def test_the_scene_counts_as_well(paper):
    check_recordable(paper, "x" * (LARGEST_HEAD // 2))
    with pytest.raises(RecordingError, match="session scene"):
        check_recordable(paper, "x" * (LARGEST_HEAD // 2), "y" * (LARGEST_HEAD // 2))


@pytest.mark.parametrize("notes", ["caf\udce9", "a\x00b\ud800"])
def test_notes_that_are_not_utf_8_are_refused_where_they_stand(paper, notes):
    with pytest.raises(RecordingError, match=r"session notes: .*character 4|session notes"):
        check_recordable(paper, notes)


def test_a_recovery_has_room_for_what_is_missing(tmp_path, paper, session):
    """Metadata of the largest size, damage, and a file name that is not UTF-8."""
    session = replace(session, notes="x" * (LARGEST_HEAD - 40_000))
    path = tmp_path / "caf\udce9.mcap"
    with Recording(path, paper, session=session, monotonic=lambda: 0.0) as recording:
        for at in range(0, 60_000, 100):
            recording.write_block(Block(at, VOLTS))
    corrupt_chunk(path, 2)
    found = describe(recover(path, tmp_path / "found.mcap").path)
    assert found["session"]["notes"] == session.notes
    assert found["recovered"]["from"] == "caf\\xe9.mcap"


def test_texts_of_events_show_the_bytes_of_file_names(tmp_path, paper, session):
    path = tmp_path / "press.mcap"
    with Recording(path, paper, session=session) as recording:
        recording.write_block(Block(0, VOLTS))
        recording.event("fault", "caf\udce9: no such file", 0.0)
    assert [event.text for event in read_recording(path).events] == ["caf\\xe9: no such file"]


def test_the_largest_plan_after_small_messages_is_read_back(tmp_path, paper, session):
    t = np.full((LARGEST_CHUNK - 70_000) // 32, 1.0)
    path = tmp_path / "press.mcap"
    with Recording(path, paper, session=session, compress=False) as recording:
        recording.write_block(Block(0, np.zeros((2, 2000))))
        recording.event("fault", "x" * 100_000, 0.9)
        recording.write_plan(t, t, t, t)
    found = read_recording(path)
    assert found.plan is not None
    assert np.array_equal(found.plan.jack_rise, t)
    assert len(found.events) == 1


@pytest.mark.parametrize("time", [2 * FARTHEST_TIME, float("nan")])
def test_times_that_no_reader_accepts(tmp_path, paper, session, time):
    path = tmp_path / "press.mcap"
    t = np.array([0.0, time])
    with Recording(path, paper, session=session) as recording:
        recording.write_block(Block(0, VOLTS))
        for write in (
            lambda: recording.event("fault", "late", time),
            lambda: recording.write_plan(t, t, t, t),
            lambda: recording.write_joints(Joints(t, t, t)),
        ):
            with pytest.raises(RecordingError):
                write()
    assert read_recording(path).events == ()


def test_a_rate_that_no_reader_accepts(tmp_path, paper, session):
    with pytest.raises(RecordingError, match="HIGHEST_RATE"):
        Recording(tmp_path / "press.mcap", paper, session=session, rate=2 * HIGHEST_RATE)


def test_more_events_than_readers_accept(tmp_path, paper, session, monkeypatch):
    monkeypatch.setattr(written, "MOST_EVENTS", 3)
    recording = Recording(tmp_path / "press.mcap", paper, session=session)

    def again():
        for _ in range(3):
            recording.event("fault", "again", 0.0)

    with pytest.raises(RecordingError, match="MOST_EVENTS"):
        record_and(recording, VOLTS, again)
    found = describe(recording.part_path)
    assert found["damage"] is None
    assert len(found["events"]) == 3  # the last is `aborted`
