"""Recordings that another program has written again, with each of MCAP's options."""

import itertools
from io import BytesIO
from struct import pack

import numpy as np
import pytest
import zstandard
from mcap import writer as mcap_writer
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from sautereau.analysis.results.recording import recording_lines
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.records import LARGEST_CHUNK, PREFIX, DamageError
from sautereau.daq.file.reading import read_recording, read_session, read_window, stream
from sautereau.daq.file.recovery import recover
from sautereau.daq.file.survey import describe
from tests.daq.damage import chunks, corrupt, corrupt_chunk, write_chunks

RATE, BEGIN, N = 51_200.0, -512, 40_960
VOLTS = np.random.default_rng(40).standard_normal((2, N))
NONE, LZ4, ZSTD = CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD


@pytest.fixture(scope="module")
def original(tmp_path_factory, paper, session):
    """A recording with several chunks, a plan and events."""
    path = tmp_path_factory.mktemp("original") / "press.mcap"
    return write_chunks(path, paper, session, VOLTS, BEGIN)


def rewrite(source, target, *, late=False, renumber=False, reverse=False, more=None, **options):
    """Write a recording again with MCAP's own writer.

    Args:
        late: Whether the Metadata follow the messages.
        renumber: Whether the topics get other numbers.
        reverse: Whether the messages are in the reverse order.
        more: Given the writer and its stream after the first message, once.
        options: As of the writer.
    """
    with source.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary, metadata = reader.get_summary(), list(reader.iter_metadata())
        messages = list(reader.iter_messages(reverse=reverse))
    stream = BytesIO()
    writer = Writer(stream, **{"chunk_size": 100_000} | options)
    writer.start(profile="sautereau", library="another program")

    def describe():
        for one in metadata:
            writer.add_metadata(one.name, one.metadata)

    if not late:
        describe()
    schemas = {
        number: writer.register_schema(s.name, s.encoding, s.data)
        for number, s in summary.schemas.items()
    }
    numbers = {}
    for number in sorted(summary.channels, reverse=renumber):
        one = summary.channels[number]
        numbers[number] = writer.register_channel(
            one.topic, one.message_encoding, schemas[one.schema_id], one.metadata
        )
    for i, (_, channel, message) in enumerate(messages):
        times = message.log_time, message.data, message.publish_time + 5, i
        writer.add_message(numbers[channel.id], *times)
        if i == 0 and more:
            more(writer, stream)
    if late:
        describe()
    writer.finish()
    target.write_bytes(stream.getvalue())
    return target


def same(path, original):
    """Read a recording in every way, and compare it with the original."""
    found, before = read_recording(path), read_recording(original)
    assert all(np.array_equal(found.volts[name], before.volts[name]) for name in before.volts)
    for name in ("t0_ns", "t0_std", "rate", "first_sample", "rig", "session", "events", "channels"):
        assert getattr(found, name) == getattr(before, name)
    assert np.array_equal(found.plan.jack_rise, before.plan.jack_rise)
    assert read_session(path) == before.session
    joined = [part.volts["force"] for part in stream(path, 0.21)]
    assert np.array_equal(np.concatenate(joined), before.volts["force"])
    window = read_window(path, 0.3, 0.5)
    at = window.first_sample - BEGIN
    expected = before.volts["force"][at : at + window.n_samples]
    assert window.n_samples == 10_240
    assert np.array_equal(window.volts["force"], expected)
    described = describe(path)
    assert described["damage"] is None
    assert described["complete"]
    assert described["messages"] == describe(original)["messages"]
    with pytest.raises(RecordingError, match="undamaged"):
        recover(path)
    return found


@pytest.mark.parametrize("compression", CompressionType)
@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize(("crcs", "data_crcs"), list(itertools.product([True, False], repeat=2)))
def test_compression_chunks_and_checksums(
    tmp_path, original, compression, chunked, crcs, data_crcs
):
    path = rewrite(
        original,
        tmp_path / "again.mcap",
        compression=compression,
        use_chunking=chunked,
        enable_crcs=crcs,
        enable_data_crcs=data_crcs,
    )
    found = same(path, original)
    assert found.checked is describe(path)["checked"] is (data_crcs or (crcs and chunked))
    text = "\n".join(recording_lines(describe(path)))
    assert ("no checksums cover the samples" in text) is not found.checked


@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize(
    "options",
    [
        {"index_types": IndexType.NONE},
        {"index_types": IndexType.CHUNK},
        {"index_types": IndexType.MESSAGE},
        {"repeat_channels": False},
        {"repeat_schemas": False},
        {"use_statistics": False},
        {"use_summary_offsets": False},
        {
            "index_types": IndexType.NONE,
            "repeat_channels": False,
            "repeat_schemas": False,
            "use_statistics": False,
            "use_summary_offsets": False,
        },
    ],
)
def test_parts_of_the_summary(tmp_path, original, options, chunked):
    same(rewrite(original, tmp_path / "again.mcap", use_chunking=chunked, **options), original)


@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize("order", [{"late": True}, {"renumber": True}])
def test_the_order_and_the_numbers_of_others(tmp_path, original, order, chunked):
    path = rewrite(original, tmp_path / "again.mcap", use_chunking=chunked, **order)
    same(path, original)
    same(rewrite(path, tmp_path / "twice.mcap", late=True, renumber=True), original)


def _attachment(writer, _):
    writer.add_attachment(1, 2, "photo.png", "image/png", bytes(LARGEST_CHUNK + 1))


def _private(_, stream):
    stream.write(PREFIX.pack(0x80, 5) + b"mine!")


def _own_topic(writer, _):
    schema = writer.register_schema("Comment", "jsonschema", b"{}")
    number = writer.register_channel("/comment", "json", schema, {"by": "a viewer"})
    writer.add_message(number, 10**18, b'{"text": "bright"}', 0)


@pytest.mark.parametrize("more", [_attachment, _private])
def test_records_that_only_others_use(tmp_path, original, more):
    same(rewrite(original, tmp_path / "again.mcap", more=more), original)


def test_a_topic_that_another_program_has_added(tmp_path, original):
    path = rewrite(original, tmp_path / "again.mcap", more=_own_topic)
    assert np.array_equal(read_recording(path).volts["force"], VOLTS[1])
    assert describe(path)["messages"]["/comment"] == 1
    start, length = chunks(path)[2]
    corrupt(path, start + length // 2)
    recovered = recover(path).path
    described = describe(recovered)
    assert described["channels"]["/comment"] == {"by": "a viewer"}
    assert described["messages"]["/comment"] == 1
    with recovered.open("rb") as file:
        schemas = make_reader(file).get_summary().schemas
    assert schemas[max(schemas)].name == "Comment"


def test_zstd_frames_that_were_written_as_streams(tmp_path, original, monkeypatch):
    """As the tools in Go and Rust write them: without the size of their content."""

    def streamed(data):
        packer = zstandard.ZstdCompressor().compressobj()
        return packer.compress(data) + packer.flush()

    monkeypatch.setattr(mcap_writer.zstandard, "compress", streamed)
    same(rewrite(original, tmp_path / "again.mcap"), original)


def test_another_order_of_the_samples_is_refused(tmp_path, original):
    path = rewrite(original, tmp_path / "again.mcap", reverse=True)
    with pytest.raises(RecordingError, match=r"follow later ones.*mcap sort"):
        read_recording(path)


@pytest.mark.parametrize("compression", [LZ4, ZSTD])
@pytest.mark.parametrize("late", [True, False])
@pytest.mark.parametrize("data_crcs", [True, False])
def test_damage_is_found_and_the_rest_recovered(tmp_path, original, compression, late, data_crcs):
    path = rewrite(
        original,
        tmp_path / "again.mcap",
        compression=compression,
        late=late,
        enable_data_crcs=data_crcs,
    )
    corrupt_chunk(path, 2)
    with pytest.raises(DamageError):
        read_recording(path)
    found = recover(path)
    described = describe(found.path)
    assert described["missing"]
    assert 0 < found.samples["force"] < N
    assert described["events"] == describe(original)["events"]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"enable_crcs": False, "enable_data_crcs": True}, "no chunk with a matching checksum"),
        ({"renumber": True}, "renumbered"),
    ],
)
def test_what_is_neither_intact_nor_its_own_is_not_recovered(tmp_path, original, changes, said):
    path = rewrite(original, tmp_path / "again.mcap", **changes)
    corrupt_chunk(path, 2)
    with pytest.raises(RecordingError, match=said):
        recover(path)


def test_an_unknown_compression_is_named(tmp_path, original):
    path = rewrite(original, tmp_path / "again.mcap", compression=LZ4, index_types=IndexType.NONE)
    data = path.read_bytes()
    path.write_bytes(data.replace(pack("<I", 3) + b"lz4", pack("<I", 3) + b"br2"))
    for read in (read_recording, describe):
        with pytest.raises(RecordingError, match=r"'br2'.*mcap compress") as raised:
            read(path)
        assert not isinstance(raised.value, DamageError)


def test_too_large_a_chunk_is_not_damage(tmp_path, original):
    def large(writer, _):
        writer.add_message(1, 10**18, bytes(LARGEST_CHUNK), 0)

    path = rewrite(original, tmp_path / "again.mcap", more=large)
    with pytest.raises(RecordingError, match=f"limit of {LARGEST_CHUNK} bytes") as raised:
        read_recording(path)
    assert not isinstance(raised.value, DamageError)


def test_the_filter_that_drops_the_metadata(tmp_path, original):
    path = tmp_path / "filtered.mcap"
    stream = BytesIO()
    writer = Writer(stream)
    writer.start(profile="sautereau")
    writer.finish()
    path.write_bytes(stream.getvalue())
    with pytest.raises(RecordingError, match="include-metadata"):
        read_recording(path)
