"""Recordings whose checksums are right and whose values are not are refused with the reason."""

import json
import struct

import numpy as np
import pytest

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.reading import read_parts, read_window, stream
from sautereau.daq.file.recovery import recover
from sautereau.daq.file.survey import describe
from tests.budget import slow
from tests.fuzz import mcap
from tests.fuzz.recordings import small


@pytest.fixture(scope="module")
def intact(tmp_path_factory):
    return small(tmp_path_factory.mktemp("intact") / "a.mcap").read_bytes()


def parts_of(data):
    return mcap.records(data[len(mcap.MAGIC) : -len(mcap.MAGIC)])


def messages(parts, topic):
    """Return the messages of all topics that begin with a text."""
    named = (mcap.texts(part.body) for part in parts if part.opcode == mcap.METADATA)
    topics = next(values for name, values in named if name == "channels")
    numbers = {json.loads(v)["id"] for k, v in topics.items() if k.startswith(topic)}
    inner = [record for part in parts for record in part.inner if record.opcode == mcap.MESSAGE]
    return [r for r in inner if struct.unpack_from("<H", r.body)[0] in numbers]


def with_field(topic, number, value):
    """Change a field of the messages of a topic."""

    def change(parts):
        for record in messages(parts, topic):
            found = {field[0]: field for field in mcap.fields(record.body[22:])}
            found[number] = (number, *value)
            record.body = record.body[:22] + mcap.packed(sorted(found.values()))

    return change


def with_text(name, key, text):
    def change(parts):
        for part in parts:
            if part.opcode == mcap.METADATA and mcap.first_name(part) == name:
                own, values = mcap.texts(part.body)
                new = text(values[key]) if callable(text) else text
                part.body = mcap.metadata(own, values | {key: new})

    return change


def double(value):
    return 1, struct.pack("<d", value)


def doubles(*values):
    return 2, np.array(values, "<f8").tobytes()


def without_id(text):
    return json.dumps(json.loads(text) | {"id": 70_000})


CHANGES = {
    "rate": (with_field("/daq", 3, double(float("inf"))), "rate: inf Hz"),
    "no rate": (with_field("/daq", 3, double(float("nan"))), "rate: nan Hz"),
    "slow": (with_field("/daq", 3, double(1e-300)), "beyond the dates of 64 bits"),
    "date": (with_field("/daq", 1, (1, struct.pack("<q", 2**63 - 1))), "dates of 64 bits"),
    "place": (with_field("/daq", 4, (1, struct.pack("<q", -(2**62)))), "FARTHEST_SAMPLE"),
    "plan": (with_field("/plan", 1, doubles(0, 1)), "plan: its columns must"),
    "plan NaN": (with_field("/plan", 2, doubles(*[np.nan] * 30)), "plan: its columns must"),
    "event": (with_field("/events", 15, double(float("nan"))), "no finite time"),
    "press": (with_text("session", "press", "9" * 30), "is not an integer"),
    "seed": (with_text("session", "seed", "1_000"), "is not an integer"),
    "end": (with_text("end", "stop_sample", str(10**18)), "metadata `end`"),
    "deep": (with_text("channels", "/plan", "[" * 9000), "does not describe the channel"),
    "id": (with_text("channels", "/plan", without_id), "does not describe the channel"),
    "rig": (with_text("rig", "json", "[" * 9000), "cannot be read"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_values_beyond_what_a_recording_holds(tmp_path, intact, name):
    change, words = CHANGES[name]
    parts = parts_of(intact)
    change(parts)
    path = tmp_path / "a.mcap"
    path.write_bytes(mcap.together(parts))
    with pytest.raises(RecordingError, match=words):
        read_parts(path)
    with pytest.raises(RecordingError):
        describe(path)
    if words.startswith(("rate", "beyond", "dates", "FARTHEST")):
        for read in (lambda: list(stream(path, 0.01)), lambda: read_window(path, 0.0, 0.01)):
            with pytest.raises(RecordingError, match=words):
                read()


def test_a_plan_without_points_is_none(tmp_path, intact):
    parts = parts_of(intact)
    (plan,) = messages(parts, "/plan")
    plan.body = plan.body[:22]
    path = tmp_path / "a.mcap"
    path.write_bytes(mcap.together(parts))
    assert read_parts(path)[0].plan is None


def test_an_index_of_another_program(tmp_path, intact):
    parts = parts_of(intact)
    next(part for part in parts if part.opcode == mcap.INDEX).body = bytes(14)
    path = tmp_path / "a.mcap"
    path.write_bytes(mcap.together(parts))
    with pytest.raises(RecordingError, match="index is too short"):
        read_window(path, 0.0, 0.01)
    path.write_bytes(intact[:20])
    with pytest.raises(RecordingError, match="truncated"):
        read_parts(path)


def of_heads(intact):
    """Each looks like a chunk that reaches over the half of the others."""
    claim = 500_000
    head = struct.pack("<BQQQQIIQ", mcap.CHUNK, claim, 0, 0, claim - 40, 1, 0, claim - 40)
    return intact[:200] + head * (2 * claim // len(head))


def of_previews(intact):
    """Previews of alternating lengths, which cannot be counted together."""
    parts = parts_of(intact)
    chunk = next(part for part in parts if part.opcode == mcap.CHUNK)
    head = mcap.MESSAGE_HEAD.pack(2, 0, 1, 1)
    one, other = mcap.Record(mcap.MESSAGE, head), mcap.Record(mcap.MESSAGE, head + b"\x10\x01")
    chunk.inner += [one, other] * 150_000
    return mcap.together(parts)


@pytest.mark.timeout(60)
@pytest.mark.parametrize(
    ("make", "words"),
    [
        (of_heads, "MOST_UNPACKED"),
        slow(of_previews, "SMALLEST_RECORD"),
    ],
)
def test_small_files_that_would_take_long(tmp_path, intact, make, words):
    path = tmp_path / "a.mcap"
    path.write_bytes(make(intact))
    with pytest.raises(RecordingError, match=words):
        recover(path)
