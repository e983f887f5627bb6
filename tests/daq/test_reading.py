"""A recording is read completely or refused, whatever happened to the file."""

import numpy as np
import pytest
from mcap.records import Chunk, DataEnd, Footer
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from sautereau.daq.errors import RecordingError
from sautereau.daq.file import runs
from sautereau.daq.file.provenance import PROFILE
from sautereau.daq.file.reading import read_recording, read_window, stream
from sautereau.daq.file.recording import Recording
from sautereau.daq.file.schemas import encode, schema_data
from sautereau.daq.file.survey import describe
from sautereau.rig.document import rig_json


@pytest.fixture
def good(tmp_path, record, volts):
    return record(tmp_path / "good.mcap", volts)


def refused(path):
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    message = str(caught.value)
    assert str(path) in message
    return message


def described(path, what):
    """Return what `describe` says of a file, whether it describes or refuses it."""
    try:
        return describe(path)[what]
    except RecordingError as error:
        return str(error)


def write(path, data):
    path.write_bytes(data)
    return path


def test_what_is_no_recording_is_refused(tmp_path):
    assert "no such file" in refused(tmp_path / "none.mcap")
    assert "it is a folder" in refused(tmp_path)
    assert "it is empty" in refused(write(tmp_path / "empty.mcap", b""))
    for data in (b"RIFF....WAVEfmt ", b"\x00" * 100, b"\x89MCAQ0\r\n"):
        assert "it is not an MCAP file" in refused(write(tmp_path / "other.mcap", data))
    for name, kind in (("my.toml", "rig or scene"), ("a.png", "picture"), ("a.CSV", "import")):
        assert kind in refused(write(tmp_path / name, b"name = 1 "))


def test_an_mcap_of_another_program(tmp_path):
    path = tmp_path / "ros.mcap"
    writer = Writer(str(path))
    writer.start(profile="ros2")
    writer.finish()
    assert "does not name sautereau" in refused(path)


def test_more_bytes_than_were_written_are_refused(tmp_path, good):
    refused(write(tmp_path / "long.mcap", good.read_bytes() + b"\x00"))
    refused(write(tmp_path / "twice.mcap", good.read_bytes() * 2))


def test_a_chunk_with_its_checksums_removed_is_refused(tmp_path, good):
    """A CRC of zero means "none" to MCAP, and would switch its own check off."""
    data = good.read_bytes()
    with good.open("rb") as file:
        found = list(StreamReader(file, emit_chunks=True).records)
    chunk = next(r for r in found if isinstance(r, Chunk))
    end = next(r for r in found if isinstance(r, DataEnd))
    footer = next(r for r in found if isinstance(r, Footer))
    for crc in (chunk.uncompressed_crc, end.data_section_crc, footer.summary_crc):
        stored = crc.to_bytes(4, "little")
        assert data.count(stored) == 1
        changed = write(tmp_path / "zeroed.mcap", data.replace(stored, b"\x00" * 4))
        assert "corrupted" in refused(changed)
        assert "corrupted" in described(changed, "damage")


def forge(path, rig, session, blocks, *, metadata=None):
    """Write a file whose checksums hold, with blocks of (channel, first sample, volts)."""
    writer = Writer(str(path), enable_data_crcs=True)
    writer.start(profile=PROFILE)
    heads = {
        "rig": {"json": rig_json(rig)},
        "software": {"python": "3"},
        "session": session.to_metadata(),
    }
    for name, values in (heads | (metadata or {})).items():
        if values is not None:
            writer.add_metadata(name, values)
    schema = writer.register_schema("sautereau.Samples", "protobuf", schema_data({}))
    numbers = {
        channel.name: writer.register_channel(f"/daq/{channel.name}", "protobuf", schema)
        for channel in rig.daq.channels
    }
    for name, first, volts in blocks:
        data = encode("Samples", t0=0, first_sample=first, rate=51_200.0, volts=volts)
        writer.add_message(numbers[name], 0, data, 0)
    writer.finish()
    return path


def test_a_hole_is_named_and_never_filled(tmp_path, paper, session):
    places = (("velocity", 0), ("velocity", 1024), ("force", 0))
    blocks = [(*place, np.zeros(512)) for place in places]
    path = forge(tmp_path / "hole.mcap", paper, session, blocks)
    message = refused(path)
    assert "samples 512 to 1023 of velocity are missing, 10 ms to 20 ms" in message
    assert "daq.file.reading.read_parts" in message
    assert (512, 1024) in [
        (m["first_sample"], m["stop_sample"]) for m in described(path, "missing")
    ]


@pytest.mark.parametrize(
    ("blocks", "message"),
    [
        ([("velocity", 0, 1024), ("force", 0, 512)], "samples 512 to 1023 of force are missing"),
        (
            [("velocity", 0, 512), ("velocity", 256, 512)],
            "samples 256 to 511 of velocity are repea",
        ),
    ],
    ids=["a channel ends early", "a block is there twice"],
)
def test_blocks_that_do_not_follow_each_other(tmp_path, paper, session, blocks, message):
    blocks = [(name, first, np.zeros(n)) for name, first, n in blocks]
    assert message in refused(forge(tmp_path / "blocks.mcap", paper, session, blocks))


@pytest.mark.parametrize(
    ("metadata", "message"),
    [
        ({"session": None}, "lacks the metadata session"),
        ({"rig": {"json": "{}"}}, "the rig stored here cannot be read"),
        ({"session": {"press": "1"}}, "lack started, simulated"),
    ],
)
def test_a_head_that_is_not_complete(tmp_path, paper, session, metadata, message):
    path = forge(tmp_path / "head.mcap", paper, session, [], metadata=metadata)
    assert message in refused(path)


def test_the_simulated_flag_has_two_values_only(tmp_path, paper, session):
    wrong = session.to_metadata() | {"simulated": "perhaps"}
    path = forge(tmp_path / "flag.mcap", paper, session, [], metadata={"session": wrong})
    assert "simulated = 'perhaps'" in refused(path)


def test_a_recording_without_samples(tmp_path, paper, session):
    path = tmp_path / "press.mcap"
    recording = Recording(path, paper, session=session)
    with pytest.raises(TimeoutError) as failed, recording:
        raise TimeoutError("no edge")
    assert failed.value.__notes__ == [f"no sample was recorded; delete {recording.part_path}"]
    with pytest.raises(RecordingError, match="holds no samples"):
        read_recording(recording.part_path)
    found = describe(recording.part_path)
    assert found["n_samples"] == 0
    assert found["complete"] is False
    assert "aborted: TimeoutError: no edge" in found["events"][0]


def test_a_small_file_of_many_samples_is_read_in_stretches(tmp_path, record, monkeypatch):
    """Zeros are packed to a fraction; the volts held at once are limited, not their number."""
    path = record(tmp_path / "zeros.mcap", np.zeros((2, 102_400)))
    monkeypatch.setattr(runs, "MOST_VOLTS", 2 * 8 * 51_200)
    assert path.stat().st_size * runs.VOLTS_PER_BYTE > 2 * 8 * 102_400
    assert read_recording(path).n_samples == 102_400
    monkeypatch.setattr(runs, "VOLTS_PER_BYTE", 1)
    assert "MOST_VOLTS" in refused(path)
    assert sum(part.n_samples for part in stream(path, 0.5)) == 102_400
    assert read_window(path, 1.5, 1.9).n_samples == 20_480
    with pytest.raises(RecordingError, match="MOST_VOLTS"):
        list(stream(path, 2.0))


def test_every_changed_byte_is_refused(tmp_path, good):
    """Bytes all over the file, and those that steer a reader: prefixes, checksums, footer."""
    data = bytearray(good.read_bytes())
    path = tmp_path / "changed.mcap"
    places = {*range(50), *range(50, len(data), 251), *range(len(data) - 60, len(data))}
    for place in sorted(places):
        data[place] ^= 0x41
        message = refused(write(path, bytes(data)))
        data[place] ^= 0x41
        assert any(word in message for word in ("corrupted", "truncated", "not an MCAP", "header"))
        assert "sautereau recover" in message


def test_every_truncation_is_refused(tmp_path, good):
    data = good.read_bytes()
    path = tmp_path / "short.mcap"
    sizes = {*range(1, 60), *range(60, len(data), 997), *range(len(data) - 80, len(data))}
    for size in sorted(sizes):
        message = refused(write(path, data[:size]))
        assert "it is truncated" in message, size
        assert f"`sautereau recover {path}`" in message
        assert "it is truncated" in described(path, "damage")
