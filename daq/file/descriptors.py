"""The messages of a recording, as protobuf descriptors built without a compiler.

sautereau.proto and foxglove.proto declare them.

Arrays exist twice. The declared message, whose descriptor is in the file for viewers, has
``repeated double`` fields. Its twin has ``bytes`` instead: packed little-endian doubles are the
same bytes on the wire, and numpy reads them without parsing.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2
from google.protobuf.message import DecodeError, Message

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
