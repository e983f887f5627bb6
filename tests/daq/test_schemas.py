"""The messages on the wire are those that the schemas declare."""

import numpy as np
import pytest
from google.protobuf import descriptor_pb2
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from sautereau.daq.file.recorded import Event
from sautereau.daq.file.samples import (
    Scaling,
    block_head,
    layout_from_metadata,
    read_block,
    sample_layout,
)
from sautereau.daq.file.schemas import (
    FIELDS,
    FRAME,
    decode,
    doubles,
    encode,
    encode_log,
    encode_rows,
    encode_scene,
    schema_data,
)
from tests.daq.declared import declared_class

NAMES = [f"c{i}" for i in range(20)]
DATA = schema_data({"Preview": NAMES})


@pytest.mark.parametrize("place", [0, 9, 36, 40, None])
def test_another_block_is_refused(place):
    data = bytearray(block_head(1, 2, 3.0, 4, 8) + bytes(8))
    if place is None:
        data = data[:40]
    else:
        data[place] ^= 0x11
    with pytest.raises(ValueError, match="a block has"):
        read_block(memoryview(data))


@pytest.mark.parametrize(
    "changes",
    [
        {"type": "int8"},
        {"type": "float64"},
        {"type": None},
        {"channels": "[]"},
        {"channels": "3"},
        {"channels": "[["},
        {"channels": '["a", "a"]'},
        {"channels": '["a", ["b"]]'},
        {"channels": '["a", "c"]'},
        {"scaling": None},
        {"scaling": "7"},
        {"scaling": '{"a": [0, 1], "b": []}'},
        {"scaling": '{"a": [0, 1], "b": [NaN]}'},
        {"scaling": f'{{"a": [0, 1], "b": [1{"0" * 400}]}}'},
    ],
)
def test_metadata_that_are_no_layout_are_refused(changes):
    layout = sample_layout("ab", Scaling("int16", np.array([[0.0, 1.0, 0.0], [0.1, 2.0, 0.0]])))
    metadata = layout.metadata([{}, {}])
    assert layout_from_metadata(metadata) == layout
    assert layout.scaling == ((0.0, 1.0), (0.1, 2.0))
    changed = {key: value for key, value in {**metadata, **changes}.items() if value is not None}
    with pytest.raises(ValueError, match=r"metadata of /daq|samples of the type|Expecting"):
        layout_from_metadata(changed)


def test_a_viewer_reads_the_declared_message():
    data = encode("Plan", t=[0.0, 1.0], q1=[2.0, 3.0], q2=[4.0, 5.0], jack_rise=[6.0, 7.0])
    plan = declared_class(DATA, "sautereau.Plan").FromString(data)
    found = [list(getattr(plan, name)) for name in FIELDS["Plan"]]
    assert found == np.arange(8.0).reshape(4, 2).tolist()
    assert plan.SerializeToString() == data


def test_rows_at_once_are_messages():
    """Of more than 15 fields, whose tags have two bytes."""
    values = np.array([0.5, -0.0, np.inf, 5e-324])
    columns = [values + i for i in range(len(NAMES))]
    kind = declared_class(DATA, "sautereau.Preview")
    rows = [kind.FromString(row) for row in encode_rows(columns)]
    found = [[getattr(row, name) for row in rows] for name in NAMES]
    assert np.array_equal(found, np.asarray(columns, np.float32))


def test_an_event_is_a_log_of_foxglove():
    data = encode_log(1_700_000_000_123_456_789, Event(-0.25, "aborted", "no edge", 1e-3))
    log = declared_class(DATA, "foxglove.Log").FromString(data)
    assert log.timestamp.ToNanoseconds() == 1_700_000_000_123_456_789
    assert (log.time, log.std, log.name, log.message) == (-0.25, 1e-3, "aborted", "no edge")
    assert log.Level.Name(log.level) == "ERROR"


@pytest.mark.parametrize("name", ["Log", "SceneUpdate", "FrameTransforms"])
def test_messages_for_foxglove_are_those_of_its_own_library(name):
    """Field by field: viewers know these messages by name. A Log has two fields more."""
    foxglove = pytest.importorskip("foxglove.messages")
    schema = getattr(foxglove, name).get_schema()
    pairs, compared = [(f"foxglove.{name}", f"foxglove.{name}")], 0
    for own_name, their_name in pairs:
        own = declared_class(DATA, own_name).DESCRIPTOR
        their = declared_class(schema.data, their_name).DESCRIPTOR
        extra = {"time", "std"} if own_name == "foxglove.Log" else set()
        for field in own.fields:
            if field.name in extra:
                assert field.number not in their.fields_by_number
                continue
            known = their.fields_by_name[field.name]
            for property_ in ("number", "type", "is_repeated"):
                assert getattr(field, property_) == getattr(known, property_)
            compared += 1
            if field.message_type and (inner := field.message_type.full_name) != own_name:
                pairs.append((inner, known.message_type.full_name))
    assert compared >= 4


def test_a_scene_as_foxgloves_own_library_declares_it():
    foxglove = pytest.importorskip("foxglove.messages")
    points = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.02]])
    data = encode_scene(1_700_000_000_123_456_789, {"arm": points})
    scene = declared_class(foxglove.SceneUpdate.get_schema().data, "foxglove.SceneUpdate")
    (entity,) = scene.FromString(data).entities
    assert entity.timestamp.ToNanoseconds() == 1_700_000_000_123_456_789
    assert (entity.id, entity.frame_id) == ("arm", FRAME)
    found = [[(p.x, p.y, p.z) for p in line.points] for line in entity.lines]
    assert found == [[tuple(point) for point in points]]


def test_the_schema_holds_every_message():
    *others, file = descriptor_pb2.FileDescriptorSet.FromString(DATA).file
    assert [message.name for message in file.message_type] == ["Block", "Plan", "Joints", "Preview"]
    assert [other.name for other in others] == ["google/protobuf/timestamp.proto", "foxglove.proto"]


@given(hnp.arrays(np.uint64, st.integers(0, 50)))
def test_any_bits_survive_the_twin(bits):
    values = bits.view(np.float64)
    data = encode("Samples", t0=-1, first_sample=-(2**63), rate=51_200.0, volts=values)
    assert np.array_equal(doubles(decode("Samples", data).volts).view(np.uint64), bits)
