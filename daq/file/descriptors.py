"""The messages of a recording, as protobuf descriptors built without a compiler.

Arrays exist twice. The declared message, whose descriptor is in the file for viewers, has
``repeated double`` fields. Its twin has ``bytes`` instead: packed little-endian doubles are the
same bytes on the wire, and numpy reads them without parsing.
"""

from collections.abc import Iterable, Iterator, Mapping
from functools import cache

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2
from google.protobuf.message import DecodeError, Message

PACKAGE = "sautereau"
FORMAT_1 = ("Samples", "Scalar", "Plan", "Joints", "Event")
"""Messages of recordings of format 1, in the order of the numbers of their schemas."""
FORMAT_1_ONLY = ("Samples", "Event")
"""Those of them that are only read."""
LOG = "foxglove.Log"
"""The message that Foxglove shows as a log, with the event's time as an additional field."""
SCENE = "foxglove.SceneUpdate"
"""The message that Foxglove draws in space."""
TRANSFORMS = "foxglove.FrameTransforms"
"""The message that says where the links of a rig are."""
FRAME = "rig"
"""Name of the frame of drawings: the balance pin is its origin, x points to the jack, z up."""
INFO, ERROR = 2, 4
"""Levels of a `LOG`."""

_Field = descriptor_pb2.FieldDescriptorProto
_Fields = Mapping[str, "str | tuple[int, str]"]
"""Type of each field, with its number if that is not its place."""
_ARRAY = "doubles"
_TIMESTAMP = "google.protobuf.Timestamp"

FIELDS: dict[str, dict[str, str]] = {
    # t0: date of the trigger, ns since 1970; first_sample, begin: index of the first sample of
    # this block and of the recording, counted from the trigger; rate: Hz; data: the samples of one
    # channel after the other, of the type in the topic's metadata.
    "Block": {
        "t0": "sfixed64",
        "first_sample": "sfixed64",
        "rate": "double",
        "begin": "sfixed64",
        "data": "bytes",
    },
    # t: s after the trigger; q1, q2: rad; jack_rise: m.
    "Plan": {"t": _ARRAY, "q1": _ARRAY, "q2": _ARRAY, "jack_rise": _ARRAY},
    # t: s after the trigger on the controller's clock; q1, q2: rad.
    # e1, e2: following errors in rad; m1, m2: motor torques in N m; empty if not recorded.
    "Joints": dict.fromkeys(("t", "q1", "q2", "e1", "e2", "m1", "m2"), _ARRAY),
    # Format 1: as Block, of one channel, in V; first_sample used to be uint64, which has the same
    # bytes from 0 up.
    "Samples": {
        "t0": "int64",
        "first_sample": "int64",
        "rate": "double",
        "volts": _ARRAY,
        "begin": "int64",
    },
    # Format 1. time: s after the trigger; std: s, standard uncertainty of it.
    "Event": {"time": "double", "kind": "string", "text": "string", "std": "double"},
}
"""Fields of each message, in the order of their numbers."""
_FOXGLOVE: dict[str, _Fields] = {
    "Log": {
        "timestamp": _TIMESTAMP,
        "level": "enum",
        "message": "string",
        "name": "string",
        "time": (15, "double"),  # s after the trigger; this and the next are not Foxglove's
        "std": (16, "double"),  # s, standard uncertainty of it
    },
    "SceneUpdate": {"entities": (2, "repeated foxglove.SceneEntity")},
    "SceneEntity": {
        "timestamp": _TIMESTAMP,
        "frame_id": "string",
        "id": "string",
        "lines": (11, "repeated foxglove.LinePrimitive"),
    },
    "LinePrimitive": {  # type 0, a strip of lines, is the default
        "pose": (2, "foxglove.Pose"),
        "thickness": (3, "double"),
        "scale_invariant": (4, "bool"),
        "points": (5, "repeated foxglove.Point3"),
        "color": (6, "foxglove.Color"),
    },
    "FrameTransforms": {"transforms": "repeated foxglove.FrameTransform"},
    "FrameTransform": {
        "timestamp": _TIMESTAMP,
        "parent_frame_id": "string",
        "child_frame_id": "string",
        "translation": "foxglove.Vector3",
        "rotation": "foxglove.Quaternion",
    },
    "Pose": {"position": "foxglove.Vector3", "orientation": "foxglove.Quaternion"},
    "Vector3": dict.fromkeys("xyz", "double"),
    "Quaternion": dict.fromkeys("xyzw", "double"),
    "Point3": dict.fromkeys("xyz", "double"),
    "Color": dict.fromkeys("rgba", "double"),
}
"""The fields of Foxglove's messages that are used."""
MOTION = tuple(name for name in FIELDS["Joints"] if name != "t")
"""Numbers in each row of the message Motion."""
ARRAYS = {
    name: [field for field, kind in fields.items() if kind == _ARRAY]
    for name, fields in FIELDS.items()
}


def _add(file: descriptor_pb2.FileDescriptorProto, name: str, fields: _Fields) -> None:
    message = file.message_type.add(name=name)
    for place, (field, kind) in enumerate(fields.items(), 1):
        number, kind = kind if isinstance(kind, tuple) else (place, kind)
        added = message.field.add(name=field, number=number, label=_Field.LABEL_OPTIONAL)
        if kind == _ARRAY:
            added.type = _Field.TYPE_DOUBLE
            added.label = _Field.LABEL_REPEATED
            added.options.packed = True
            continue
        if kind.startswith("repeated "):
            kind, added.label = kind.removeprefix("repeated "), _Field.LABEL_REPEATED
        scalar = f"TYPE_{kind.upper()}"
        added.type = getattr(_Field, scalar, _Field.TYPE_MESSAGE)
        if kind == "enum":
            added.type_name = f".{file.package}.{name}.Level"
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
        **{message: dict.fromkeys(names, "float") for message, names in rows.items()},
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
        name: {field: "bytes" if kind == _ARRAY else kind for field, kind in fields.items()}
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
