"""The messages of a recording, as protobuf descriptors built without a compiler.

Every message exists twice. The declared one, whose descriptor is in the file for viewers, has
``repeated double`` arrays. Its twin has ``bytes`` instead: packed little-endian doubles are the
same bytes on the wire, and numpy reads them without parsing.
"""

from functools import cache
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import Message
from numpy.typing import NDArray

PACKAGE = "sautereau"

_Field = descriptor_pb2.FieldDescriptorProto
_SCALARS = {
    "int64": _Field.TYPE_INT64,
    "double": _Field.TYPE_DOUBLE,
    "string": _Field.TYPE_STRING,
}
_ARRAY = "doubles"

FIELDS: dict[str, dict[str, str]] = {
    # t0: date of the trigger, ns since 1970; first_sample, begin: index of the first sample of
    # this block and of the recording, counted from the trigger; rate: Hz; volts: V.
    # first_sample used to be uint64, which has the same bytes from 0 up.
    "Samples": {
        "t0": "int64",
        "first_sample": "int64",
        "rate": "double",
        "volts": _ARRAY,
        "begin": "int64",
    },
    "Scalar": {"value": "double"},
    # t: s after the trigger; q1, q2: rad; jack_rise: m.
    "Plan": {"t": _ARRAY, "q1": _ARRAY, "q2": _ARRAY, "jack_rise": _ARRAY},
    # t: s after the trigger on the controller's clock; q1, q2: rad.
    # e1, e2: following errors in rad; m1, m2: motor torques in N m; empty if not recorded.
    "Joints": dict.fromkeys(("t", "q1", "q2", "e1", "e2", "m1", "m2"), _ARRAY),
    # time: s after the trigger; std: s, standard uncertainty of it.
    "Event": {"time": "double", "kind": "string", "text": "string", "std": "double"},
}
"""Fields of each message, in the order of their numbers."""
_ARRAYS = {
    name: [field for field, kind in fields.items() if kind == _ARRAY]
    for name, fields in FIELDS.items()
}


def _file(package: str, *, twin: bool) -> descriptor_pb2.FileDescriptorProto:
    file = descriptor_pb2.FileDescriptorProto(
        name=f"{package}.proto", package=package, syntax="proto3"
    )
    for name, fields in FIELDS.items():
        message = file.message_type.add(name=name)
        for number, (field, kind) in enumerate(fields.items(), 1):
            added = message.field.add(name=field, number=number, label=_Field.LABEL_OPTIONAL)
            if kind != _ARRAY:
                added.type = _SCALARS[kind]
            elif twin:
                added.type = _Field.TYPE_BYTES
            else:
                added.type = _Field.TYPE_DOUBLE
                added.label = _Field.LABEL_REPEATED
                added.options.packed = True
    return file


@cache
def schema_data() -> bytes:
    """Return the FileDescriptorSet that MCAP schema records carry."""
    declared = descriptor_pb2.FileDescriptorSet(file=[_file(PACKAGE, twin=False)])
    return declared.SerializeToString(deterministic=True)


@cache
def _classes(twin: bool) -> dict[str, type[Message]]:
    package = f"{PACKAGE}.wire" if twin else PACKAGE
    pool = descriptor_pool.DescriptorPool()
    pool.Add(_file(package, twin=twin))  # type: ignore[attr-defined]
    return {
        name: message_factory.GetMessageClass(pool.FindMessageTypeByName(f"{package}.{name}"))
        for name in FIELDS
    }


def declared_class(name: str) -> type[Message]:
    """Return the class of a message as viewers see it, with repeated doubles."""
    return _classes(False)[name]


def encode(name: str, **values: Any) -> bytes:
    """Return the wire bytes of a message; arrays are 1-D float arrays, and optional."""
    for field in values.keys() & set(_ARRAYS[name]):
        values[field] = np.ascontiguousarray(values[field], dtype="<f8").tobytes()
    return _classes(True)[name](**values).SerializeToString()


def encode_scalars(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return the wire bytes of Scalar messages, shape (n, 9), of values of shape (n,)."""
    data = np.empty((len(values), 9), np.uint8)
    data[:, 0] = 1 << 3 | 1  # field 1, of 64 bits
    data[:, 1:] = np.ascontiguousarray(values, "<f8").view(np.uint8).reshape(-1, 8)
    return data


def decode(name: str, data: bytes) -> Any:
    """Return a message as its twin; convert its array fields with `doubles`."""
    message = _classes(True)[name]()
    message.ParseFromString(data)
    return message


def doubles(field: bytes) -> NDArray[np.float64]:
    """Return an array field of a decoded message, shape (n,), without copying."""
    return np.frombuffer(field, dtype="<f8")
