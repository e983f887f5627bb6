"""The messages of a recording: declared as protobuf without a compiler, encoded and decoded.

sautereau.proto and foxglove.proto declare them.

Arrays exist twice. The declared message, whose descriptor is in the file for viewers, has
``repeated double`` fields. Its twin has ``bytes`` instead: packed little-endian doubles are the
same bytes on the wire, and numpy reads them without parsing.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2
from google.protobuf.message import DecodeError, Message
from numpy.typing import ArrayLike, NDArray

from sautereau.daq.file.recorded import Event
from sautereau.daq.file.samples import varint

PACKAGE = "sautereau"
FORMAT_1 = ("Samples", "Scalar", "Plan", "Joints", "Event")
"""Messages of recordings of format 1, in the order of the numbers of their schemas."""
FORMAT_1_ONLY = ("Samples", "Event")  # Those of them that are only read
LOG = "foxglove.Log"
"""The message that Foxglove shows as a log, with the event's time as an additional field."""
SCENE = "foxglove.SceneUpdate"  # The message that Foxglove draws in space
TRANSFORMS = "foxglove.FrameTransforms"  # The message that says where the links of a rig are
FRAME = "rig"
"""Name of the frame of drawings: the balance pin is its origin, x points to the jack, z up."""
INFO, ERROR = 2, 4  # Levels of a `LOG`
_Field = descriptor_pb2.FieldDescriptorProto
_Fields = Mapping[str, tuple[int, str]]  # Number and type of each field
_ARRAY = "repeated double"
_MESSAGE = re.compile(r"^message (\w+) \{(.*?)\}", re.DOTALL | re.MULTILINE)
_FIELD = re.compile(r"((?:repeated )?[\w.]+) (\w+) = (\d+);")


def _declared(package: str) -> dict[str, _Fields]:
    """Return the messages that PACKAGE.proto beside this file declares."""
    text = Path(__file__).with_name(f"{package}.proto").read_text("utf-8")
    return {
        name: {field: (int(number), kind) for kind, field, number in _FIELD.findall(body)}
        for name, body in _MESSAGE.findall(text)
    }


FIELDS, _FOXGLOVE = _declared(PACKAGE), _declared("foxglove")
"""Fields of each message, in the order of their numbers."""
MOTION = tuple(name for name in FIELDS["Joints"] if name != "t")
"""Numbers in each row of the message Motion."""
ARRAYS = {
    name: [field for field, (_, kind) in fields.items() if kind == _ARRAY]
    for name, fields in FIELDS.items()
}


def schema_data(rows: Mapping[str, Iterable[str]]) -> bytes:
    """Return the FileDescriptorSet that MCAP schema records carry.

    Args:
        rows: Names of the numbers in each message with one row of a table; see `encode_rows`.
    """
    messages: dict[str, _Fields] = {
        **{name: fields for name, fields in FIELDS.items() if name not in FORMAT_1_ONLY},
        **{m: {name: (i, "float") for i, name in enumerate(n, 1)} for m, n in rows.items()},
    }
    declared = descriptor_pb2.FileDescriptorSet(file=list(_files(PACKAGE, messages)))
    return declared.SerializeToString(deterministic=True)


def schema_of(name: str, data: bytes) -> bytes:
    """Return the part of a FileDescriptorSet that one message needs.

    Args:
        name: With its package: `foxglove.Log`.
        data: The set, with the files that others depend on first.

    Raises:
        ValueError: It is no such set.
    """
    try:
        declared = descriptor_pb2.FileDescriptorSet.FromString(data)
    except DecodeError as error:
        raise ValueError(f"the message definitions cannot be read: {error}") from error
    needed, kept = set[str](), []
    for file in reversed(declared.file):
        if file.package == name.rpartition(".")[0] or file.name in needed:
            needed.update(file.dependency)
            kept.insert(0, file)
    found = descriptor_pb2.FileDescriptorSet(file=kept)
    return found.SerializeToString(deterministic=True)


@cache
def twins() -> dict[str, type[Message]]:
    package = f"{PACKAGE}.wire"
    pool = descriptor_pool.DescriptorPool()
    twins: dict[str, _Fields] = {
        name: {f: (i, "bytes" if kind == _ARRAY else kind) for f, (i, kind) in fields.items()}
        for name, fields in FIELDS.items()
    }
    for file in _files(package, twins):
        pool.Add(file)  # type: ignore[attr-defined]
    names = {name: f"{package}.{name}" for name in FIELDS} | {
        name: name for name in (LOG, SCENE, TRANSFORMS)
    }
    return {
        name: message_factory.GetMessageClass(pool.FindMessageTypeByName(full))
        for name, full in names.items()
    }


def _files(
    package: str, messages: Mapping[str, _Fields]
) -> Iterator[descriptor_pb2.FileDescriptorProto]:
    """Yield the descriptors of our messages and of Foxglove's."""
    stamp = descriptor_pb2.FileDescriptorProto()
    timestamp_pb2.DESCRIPTOR.CopyToProto(stamp)
    yield stamp
    theirs = descriptor_pb2.FileDescriptorProto(
        name="foxglove.proto", package="foxglove", syntax="proto3", dependency=[stamp.name]
    )
    for name, fields in _FOXGLOVE.items():
        _add(theirs, name, fields)
    yield theirs
    file = descriptor_pb2.FileDescriptorProto(
        name=f"{package}.proto", package=package, syntax="proto3"
    )
    for name, fields in messages.items():
        _add(file, name, fields)
    yield file


def _add(file: descriptor_pb2.FileDescriptorProto, name: str, fields: _Fields) -> None:
    message = file.message_type.add(name=name)
    for field, (number, kind) in fields.items():
        added = message.field.add(name=field, number=number, label=_Field.LABEL_OPTIONAL)
        if kind == _ARRAY:
            added.options.packed = True
        if kind.startswith("repeated "):
            kind, added.label = kind.removeprefix("repeated "), _Field.LABEL_REPEATED
        scalar = f"TYPE_{kind.upper()}"
        added.type = getattr(_Field, scalar, _Field.TYPE_MESSAGE)
        if kind == "Level":
            added.type, added.type_name = _Field.TYPE_ENUM, f".{file.package}.{name}.Level"
            levels = message.enum_type.add(name="Level")
            for level, text in enumerate(("UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL")):
                levels.value.add(name=text, number=level)
        elif not hasattr(_Field, scalar):
            added.type_name = f".{kind}"


def encode(name: str, **values: Any) -> bytes:
    """Return the wire bytes of a message; arrays are 1-D float arrays, and optional."""
    for field in values.keys() & set(ARRAYS[name]):
        values[field] = np.ascontiguousarray(values[field], dtype="<f8").tobytes()
    return twins()[name](**values).SerializeToString()


def encode_log(date: int, event: Event) -> bytes:
    """Return the wire bytes of an event as a `LOG`, with its date in ns since 1970."""
    level = ERROR if event.kind in ("aborted", "fault") else INFO
    log: Any = twins()[LOG](
        level=level, name=event.kind, message=event.text, time=event.time, std=event.std
    )
    log.timestamp.FromNanoseconds(date)
    return log.SerializeToString()


def encode_scene(date: int, lines: Mapping[str, NDArray[np.float64]]) -> bytes:
    """Return the wire bytes of a `SCENE` of lines.

    Args:
        date: ns since 1970.
        lines: Points in `FRAME`, m, of each line by name, shape (n, 3).
    """
    scene: Any = twins()[SCENE]()
    for name, points in lines.items():
        entity = scene.entities.add(frame_id=FRAME, id=name)
        entity.timestamp.FromNanoseconds(date)
        line = entity.lines.add(thickness=3.0, scale_invariant=True)  # Pixels
        line.pose.orientation.w = 1.0
        line.color.r = line.color.g = line.color.b = line.color.a = 1.0
        for x, y, z in points.tolist():
            line.points.add(x=x, y=y, z=z)
    return scene.SerializeToString()


def encode_transforms(date: int, frames: Mapping[str, NDArray[np.float64]]) -> bytes:
    """Return the wire bytes of `TRANSFORMS`.

    Args:
        date: ns since 1970.
        frames: x and z, m, and angle from x towards z, rad, of each frame in `FRAME`, shape (3,).
    """
    message: Any = twins()[TRANSFORMS]()
    for name, (x, z, angle) in frames.items():
        frame = message.transforms.add(parent_frame_id=FRAME, child_frame_id=name)
        frame.timestamp.FromNanoseconds(date)
        frame.translation.x, frame.translation.z = x, z
        frame.rotation.y, frame.rotation.w = -math.sin(angle / 2), math.cos(angle / 2)
    return message.SerializeToString()


def encode_rows(columns: ArrayLike) -> list[bytes]:
    """Return the wire bytes of messages with one row of a table each.

    Args:
        columns: Values of each field, in the order of their numbers, shape (n_fields, n).
    """
    with np.errstate(over="ignore"):  # samples may be any double
        values = np.asarray(columns, "<f4")
    kind, row = _row_of(len(values))
    data = np.frombuffer(bytearray(row * values.shape[1]), kind)
    for number, column in enumerate(values, 1):
        data[f"value {number}"] = column
    return data.view(f"V{kind.itemsize}").tolist()


@cache
def _row_of(n_fields: int) -> tuple[np.dtype[np.void], bytes]:
    """Return the type of a message of so many numbers of 32 bits, and one of zeros."""
    tags = {number: varint(number << 3 | 5) for number in range(1, n_fields + 1)}  # 5: 32 bits
    fields = []
    for number, tag in tags.items():
        fields += [(f"tag {number}", f"V{len(tag)}"), (f"value {number}", "<f4")]
    row = np.zeros(1, fields)
    for number, tag in tags.items():
        row[f"tag {number}"] = tag
    return row.dtype, row.tobytes()


def decode(name: str, data: bytes) -> Any:
    """Return a message as its twin; convert its array fields with `doubles`."""
    message = twins()[name]()
    message.ParseFromString(data)
    return message


def doubles(field: bytes) -> NDArray[np.float64]:
    """Return an array field of a decoded message, shape (n,), without copying."""
    return np.frombuffer(field, dtype="<f8")
