"""The samples of a recording: as the device gives them, on the wire, and as volts."""

import json
import math
import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

TOPIC = "/daq"  # Topic of the samples of all channels
Samples = NDArray[np.float64] | NDArray[np.int16] | NDArray[np.int32]
"""Volts, or the counts of a converter."""
TYPES = {"int16": "<i2", "int32": "<i4", "float64": "<f8"}
"""Type on the wire of each type of samples."""
_PIECE = 16384  # samples converted at a time, which the cache of a processor holds
# Fields 1 to 4 of a Block, each a tag and 64 bits; the tag of field 5, its length follows.
_HEAD = struct.Struct("<BqBqBdBqB")
_TAGS = (0x09, 0x11, 0x19, 0x21, 0x2A)
_LENGTH = 5


@dataclass(frozen=True)
class Scaling:
    """Type of a device's counts, and the polynomials that convert them to volts."""

    kind: str
    """Type of a count: `int16` or `int32`."""
    coefficients: NDArray[np.float64]
    """Shape (n_channels, n_coefficients), V per count to the power of 0, 1, 2 ..."""


class WireBlock(NamedTuple):
    """Consecutive samples, as a message holds them."""

    t0: int
    """Date of the trigger, ns since 1970."""
    first_sample: int
    """Index of the first sample, counted from the trigger."""
    rate: float
    """Sampling rate, Hz."""
    begin: int
    """Index of the recording's first sample."""
    data: memoryview
    """Samples of one channel after the other."""


def block_head(t0: int, first_sample: int, rate: float, begin: int, size: int) -> bytes:
    """Return the bytes of a Block that precede ``size`` bytes of samples."""
    a, b, c, d, e = _TAGS
    return _HEAD.pack(a, t0, b, first_sample, c, rate, d, begin, e) + varint(size, _LENGTH)


@lru_cache(64)
def varint(value: int, length: int = 1) -> bytes:
    """Return an integer as a varint of at least ``length`` bytes."""
    while value >> 7 * length:
        length += 1
    return bytes(value >> 7 * i & 127 | 128 * (i < length - 1) for i in range(length))


def read_block(data: memoryview) -> WireBlock:
    """Return a Block, its samples without copying them.

    Raises:
        ValueError: It does not start as `block_head` writes it.
    """
    start = _HEAD.size + _LENGTH
    if len(data) < start or (found := _HEAD.unpack_from(data))[::2] != _TAGS:
        raise ValueError("a block has other fields than those of its message")
    if data[_HEAD.size : start] != varint(len(data) - start, _LENGTH):
        raise ValueError(f"a block has another length than that of its {len(data) - start} bytes")
    _, t0, _, first_sample, _, rate, _, begin, _ = found
    return WireBlock(t0, first_sample, rate, begin, data[start:])


@dataclass(frozen=True)
class SampleLayout:
    """Layout of the samples in the blocks of a recording, from the metadata of their topic."""

    names: tuple[str, ...]
    """Names of the channels, in their order."""
    kind: str
    """`int16` or `int32`: counts; `float64`: volts."""
    scaling: tuple[tuple[float, ...], ...]
    """Coefficients of each channel, V per count to the power of 0, 1, 2 ...; empty for volts."""

    @cached_property
    def size(self) -> int:
        """Bytes of one sample of all channels."""
        return len(self.names) * np.dtype(TYPES[self.kind]).itemsize

    def empty(self, n: int) -> NDArray[Any]:
        """Return an array for ``n`` samples of all channels, shape (n_channels, n)."""
        return np.empty((len(self.names), n), TYPES[self.kind])

    def metadata(self, channels: Iterable[Mapping[str, str]]) -> dict[str, str]:
        """Return the metadata of the topic; ``channels`` are the calibrations."""
        described = {"type": self.kind, "channels": json.dumps(self.names)}
        if self.scaling:
            rows = [list(row) for row in self.scaling]
            described["scaling"] = json.dumps(dict(zip(self.names, rows, strict=True)))
        texts = zip(self.names, channels, strict=True)
        return described | {f"channel {name}": json.dumps(text) for name, text in texts}

    def columns(self, data: memoryview) -> NDArray[Any]:
        """Return the samples of a block, shape (n_channels, n), without copying them.

        Raises:
            ValueError: The size is not that of a whole number of samples of all channels.
        """
        return np.frombuffer(data, TYPES[self.kind]).reshape(len(self.names), -1)


def sample_layout(names: Iterable[str], scaling: Scaling | None) -> SampleLayout:
    """Return a layout; without coefficients of zero at the end of each polynomial.

    Args:
        scaling: Scaling of the counts; None for volts.
    """
    if scaling is None:
        return SampleLayout(tuple(names), "float64", ())
    rows = [np.trim_zeros(row, "b").tolist() or [0.0] for row in scaling.coefficients]
    return SampleLayout(tuple(names), scaling.kind, tuple(map(tuple, rows)))


def layout_from_metadata(metadata: Mapping[str, str]) -> SampleLayout:
    """Read back what `SampleLayout.metadata` wrote.

    Raises:
        ValueError: It is invalid.
    """
    try:
        kind, names = metadata["type"], json.loads(metadata["channels"])
        rows = json.loads(metadata["scaling"]) if "scaling" in metadata else {}
        scaling = tuple(tuple(float(c) for c in rows[name]) for name in names) if rows else ()
    except (KeyError, TypeError, OverflowError, RecursionError) as error:
        raise ValueError(f"the metadata of {TOPIC}: {type(error).__name__}: {error}") from error
    if (
        kind not in TYPES
        or not isinstance(names, list)
        or not names
        or not all(isinstance(name, str) for name in names)
        or len(set(names)) != len(names)
        or bool(scaling) == (kind == "float64")
        or not all(row and all(map(math.isfinite, row)) for row in scaling)
    ):
        raise ValueError(f"samples of the type {kind!r}, the channels {names}, scaling {scaling}")
    return SampleLayout(tuple(names), kind, scaling)


def write_volts(
    samples: Samples,
    scaling: Sequence[Sequence[float]],
    into: NDArray[np.float64] | NDArray[np.float32],
) -> None:
    """Write the volts of samples.

    Those of counts x are c0 + x (c1 + x (c2 + ...)), evaluated in this order in doubles.

    Args:
        samples: Shape (n_channels, n).
        scaling: c0, c1, ... of each channel, V per count to the power of 0, 1, ...; none for volts.
        into: Volts, shape (n_channels, n), V.
    """
    if not scaling:
        into[:] = samples
    for row, (*lower, highest) in enumerate(scaling):
        for at in range(0, samples.shape[1], _PIECE):
            x, volts = samples[row, at : at + _PIECE], into[row, at : at + _PIECE]
            if len(lower) == 1:  # four times as fast as the general way
                volts[:] = x
                volts *= highest
            else:
                volts[:] = highest
                for coefficient in lower[:0:-1]:
                    volts *= x
                    volts += coefficient
                if lower:
                    volts *= x
            if lower and lower[0]:
                volts += lower[0]
