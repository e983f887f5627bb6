"""The intact part of a damaged recording is recovered, and the loss reported."""

import itertools
import shutil
from functools import cache

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.records import Opcode
from sautereau.daq.file.reading import read_parts, read_recording
from sautereau.daq.file.recording import Recording
from sautereau.daq.file.recovery import recover
from sautereau.daq.file.survey import describe
from tests.daq.damage import chunks, corrupt, record_and, write_chunks

N = 60_000
CHUNK = 10_240  # Samples in a chunk of these recordings: 0.2 s


VOLTS = np.random.default_rng(5).standard_normal((2, N))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory, paper, session):
    """Return a function that records the volts from a first sample on, once for each."""

    @cache
    def made(begin):
        path = tmp_path_factory.mktemp("recorded") / "press.mcap"
        return write_chunks(path, paper, session, VOLTS, begin)

    return made


@pytest.fixture
def make(tmp_path, recorded):
    """Return a function that copies such a recording."""
    return lambda begin=0: shutil.copy(recorded(begin), tmp_path / "press.mcap")


def is_valid_for_others(path):
    """Read a file by the library's two readers, checksums on."""
    with path.open("rb") as file:
        by_stream = sum(1 for _ in StreamReader(file, validate_crcs=True).records)
    with path.open("rb") as file:
        by_index = sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages())
    return by_stream > 0 and by_index > 0


def test_a_killed_recording(make):
    """Everything after the third chunk is missing, within the fourth."""
    path = make()
    place, length = chunks(path)[3]
    part = path.with_name("press.mcap.part")
    data = path.read_bytes()[: place + length // 2]
    part.write_bytes(data)
    path.unlink()
    with pytest.raises(RecordingError, match=r"truncated.*`sautereau recover"):
        read_recording(part)
    result = describe(part)
    assert "sautereau recover" in (result["damage"] or "")
    assert result["n_samples"] == 3 * CHUNK
    found = recover(part)
    assert part.read_bytes() == data
    assert found.path == path
    assert found.samples == {"velocity": 3 * CHUNK, "force": 3 * CHUNK}
    assert {(g.channel, g.first_sample, g.stop_sample, g.start, g.stop) for g in found.gaps} == {
        (name, 3 * CHUNK, None, 0.6, None) for name in ("velocity", "force")
    }
    assert is_valid_for_others(path)
    read = read_recording(path)
    assert np.array_equal(np.stack(list(read.volts.values())), VOLTS[:, : 3 * CHUNK])
    assert read.gaps == found.gaps
    assert not read.complete
    assert read.plan is not None
    assert describe(path)["damage"] is None
    assert describe(path)["complete"] is False
    assert (describe(path)["recovered"] or {})["from"] == "press.mcap.part"


@pytest.mark.parametrize(
    ("number", "where", "begin"),
    [*itertools.product([0, 2, 5], [0.0, 0.001, 0.5, 1.0], [0]), (0, 0.5, -700), (5, 0.5, -700)],
)
def test_a_corrupt_chunk(make, number, where, begin):
    """A byte of its opcode, its length, its content, or its last; first, middle, last chunk."""
    path = make(begin)
    place, length = chunks(path)[number]
    corrupt(path, place + round(where * (length - 1)))
    damaged = path.read_bytes()
    with pytest.raises(RecordingError, match=r"corrupted.*`sautereau recover"):
        read_recording(path)
    found = recover(path)
    assert path.read_bytes() == damaged
    assert found.path.name == "press-recovered.mcap"
    assert is_valid_for_others(found.path)
    first, stop = number * CHUNK, min((number + 1) * CHUNK, N)
    assert {(g.channel, g.first_sample, g.stop_sample) for g in found.gaps} == {
        (name, begin + first, begin + stop) for name in ("velocity", "force")
    }
    parts = read_parts(found.path)
    assert all(part.gaps == found.gaps and not part.complete for part in parts)
    for part in parts:
        at = part.first_sample - begin
        assert np.array_equal(
            np.stack(list(part.volts.values())), VOLTS[:, at : at + part.n_samples]
        )
    assert sum(part.n_samples for part in parts) == N - (stop - first)
    if number == 5:
        assert read_recording(found.path).n_samples == N - (stop - first)
    else:
        with pytest.raises(RecordingError, match=r"are missing.*never filled.*read_parts"):
            read_recording(found.path)


def test_a_length_that_leads_astray(make):
    """A chunk that says it reaches to the file's end hides none of those that follow."""
    path = make()
    place, _ = chunks(path)[1]
    data = bytearray(path.read_bytes())
    data[place + 1 : place + 9] = (len(data) - place - 9).to_bytes(8, "little")
    path.write_bytes(bytes(data))
    assert [g.first_sample for g in recover(path).gaps] == [CHUNK, CHUNK]


def test_a_hole_in_the_file(make):
    """A block of the disk read as zeros, over the end of one chunk and the start of the next."""
    path = make()
    (before, length), (after, _) = chunks(path)[1:3]
    data = bytearray(path.read_bytes())
    start, stop = before + length - 100, after + 100
    data[start:stop] = bytes(stop - start)
    path.write_bytes(bytes(data))
    assert {(g.first_sample, g.stop_sample) for g in recover(path).gaps} == {(CHUNK, 3 * CHUNK)}


def test_damage_outside_the_samples_loses_none(make):
    path = make()
    size, intact = path.stat().st_size, path.read_bytes()
    for place in (0, 12, 30, 200, 6000, size - 20, size - 400):
        path.write_bytes(intact)
        corrupt(path, place)
        found = recover(path)
        assert found.gaps == ()
        read = read_recording(found.path)
        assert np.array_equal(np.stack(list(read.volts.values())), VOLTS)
        assert read.complete
        found.path.unlink()


def test_a_head_whose_copies_are_both_damaged(make):
    path = make()
    data = path.read_bytes()
    corrupt(path, *(i for i in range(len(data) - 11) if data[i : i + 11] == b"laser_arm\\x22"[:9]))
    spoilt = data.replace(b"laser_arm", b"laser_ARM")
    path.write_bytes(spoilt)
    with pytest.raises(RecordingError, match="lacks the metadata rig"):
        recover(path)
    assert path.read_bytes() == spoilt
    assert [p.name for p in path.parent.iterdir()] == ["press.mcap"]


def test_what_needs_no_recovery_and_what_allows_none(make, tmp_path):
    path = make()
    with pytest.raises(RecordingError, match="undamaged and needs no recovery"):
        recover(path)
    for data, message in (
        (b"", "it is empty"),
        (b"RIFF" * 100, "not an MCAP file"),
        (path.read_bytes()[:5000], "what was recorded|truncated"),
    ):
        other = tmp_path / "other.mcap.part"
        other.write_bytes(data)
        with pytest.raises(RecordingError, match=message):
            recover(other)
        assert not (tmp_path / "other.mcap").exists()
    with pytest.raises(RecordingError, match="no such file"):
        recover(tmp_path / "none.mcap")


def test_an_invalid_definition_in_a_chunk_of_another_program(make, tmp_path, monkeypatch):
    """Its checksum is right: a schema record that ends within its length."""
    path = make()
    place, length = chunks(path)[2]
    data = bytearray(path.read_bytes())
    data[place + length // 2] ^= 0xFF
    path.write_bytes(data)
    record = (Opcode.SCHEMA, b"\x01\x00\x02", 0)
    monkeypatch.setattr("sautereau.daq.file.recovery.records_within", lambda _: [record])
    with pytest.raises(RecordingError, match="has an invalid record"):
        recover(path, tmp_path / "new.mcap")
    assert not (tmp_path / "new.mcap").exists()


@pytest.mark.parametrize("folder", [".", "/"])
def test_a_folder_without_a_name_is_no_recording(folder):
    with pytest.raises(RecordingError, match="it is a folder; name a recording"):
        recover(folder)


def test_nothing_is_overwritten(make, tmp_path):
    path = make()
    corrupt(path, chunks(path)[1][0])
    taken = tmp_path / "taken.mcap"
    taken.write_text("precious")
    with pytest.raises(RecordingError, match="never overwritten"):
        recover(path, taken)
    assert taken.read_text() == "precious"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["press.mcap", "taken.mcap"]


def test_a_recovered_file_damaged_again(make):
    path = make()
    place, _ = chunks(path)[1]
    corrupt(path, place)
    once = recover(path).path
    place, _ = chunks(once)[1]
    corrupt(once, place + 99)
    found = recover(once)
    assert found.path.name == "press-recovered-recovered.mcap"
    assert {(g.first_sample, g.stop_sample) for g in found.gaps} == {(CHUNK, 3 * CHUNK)}


def test_an_aborted_press_takes_its_name(tmp_path, paper, session):
    recording = Recording(tmp_path / "press.mcap", paper, session=session)
    with pytest.raises(ZeroDivisionError):
        record_and(recording, VOLTS, lambda: 1 / 0)
    found = recover(recording.part_path)
    assert found.gaps == ()
    read = read_recording(found.path)
    assert read.complete is False
    assert np.array_equal(np.stack(list(read.volts.values())), VOLTS)
