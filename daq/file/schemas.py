"""Messages to and from their bytes on the wire."""

import math
from collections.abc import Mapping
from functools import cache, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sautereau.daq.file.descriptors import ARRAYS, ERROR, FRAME, INFO, LOG, SCENE, TRANSFORMS, twins
from sautereau.daq.file.recorded import Event

THICKNESS = 3.0  # Pixels, of lines in space


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
        line = entity.lines.add(thickness=THICKNESS, scale_invariant=True)
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


@lru_cache(64)
def varint(value: int, length: int = 1) -> bytes:
    """Return an integer as a varint of at least ``length`` bytes."""
    while value >> 7 * length:
        length += 1
    return bytes(value >> 7 * i & 127 | 128 * (i < length - 1) for i in range(length))


def decode(name: str, data: bytes) -> Any:
    """Return a message as its twin; convert its array fields with `doubles`."""
    message = twins()[name]()
    message.ParseFromString(data)
    return message


def doubles(field: bytes) -> NDArray[np.float64]:
    """Return an array field of a decoded message, shape (n,), without copying."""
    return np.frombuffer(field, dtype="<f8")
