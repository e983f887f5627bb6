"""The declared messages and their twins are one on the wire."""

import numpy as np
from google.protobuf import descriptor_pb2
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from sautereau.daq.file.schemas import (
    FIELDS,
    declared_class,
    decode,
    doubles,
    encode,
    encode_scalars,
    schema_data,
)


@given(hnp.arrays(np.uint64, st.integers(0, 50)))
def test_any_bits_survive_the_twin(bits):
    values = bits.view(np.float64)
    data = encode("Samples", t0=-1, first_sample=-(2**63), rate=51_200.0, volts=values)
    assert np.array_equal(doubles(decode("Samples", data).volts).view(np.uint64), bits)


def test_an_index_from_zero_on_is_what_it_was_as_uint64():
    """Field 2, a varint of 300: recordings from before the samples could be negative."""
    data = encode("Samples", t0=0, first_sample=300, rate=0.0, volts=[])
    assert data == b"\x10\xac\x02"


def test_a_viewer_reads_the_declared_message():
    data = encode("Plan", t=[0.0, 1.0], q1=[2.0, 3.0], q2=[4.0, 5.0], jack_rise=[6.0, 7.0])
    plan = declared_class("Plan").FromString(data)
    assert [list(getattr(plan, name)) for name in FIELDS["Plan"]] == [
        [0.0, 1.0],
        [2.0, 3.0],
        [4.0, 5.0],
        [6.0, 7.0],
    ]
    assert plan.SerializeToString() == data


def test_scalars_at_once_are_scalars():
    values = np.array([0.5, -0.0, np.inf, 5e-324])
    found = [declared_class("Scalar").FromString(row.tobytes()) for row in encode_scalars(values)]
    assert np.array_equal([message.value for message in found], values)


def test_the_schema_holds_every_message():
    (file,) = descriptor_pb2.FileDescriptorSet.FromString(schema_data()).file
    assert [message.name for message in file.message_type] == list(FIELDS)
    assert file.package == "sautereau"
