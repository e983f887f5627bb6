"""Whether a recording is whole, byte for byte, before anything in it is believed."""

import struct
import zlib

from mcap.opcode import Opcode
from mcap.stream_reader import MAGIC_SIZE
from mcap.writer import MCAP0_MAGIC

from daq.errors import RecordingError
from daq.provenance import PROFILE

_PREFIX = struct.Struct("<BQ")  # opcode and length of a record
_FOOTER = struct.Struct("<BQQQI")  # prefix, summary start, summary offset start, CRC
_DATA_END = struct.Struct("<BQI")  # prefix, CRC of all before
_CRC_SIZE = 4


def check_whole(data: bytes) -> None:
    """Refuse a file that is not ours, that ends too early, or in which a byte has changed.

    Two checksums cover the file: the data section's, from the first byte to the DataEnd
    record, and the summary's, from there to the footer.

    Raises:
        RecordingError: Says what is wrong and what is left; the caller names the file.
    """
    if not data:
        raise RecordingError("it is empty: nothing was recorded; delete it and press again")
    if not data.startswith(MCAP0_MAGIC):
        if MCAP0_MAGIC.startswith(data):
            raise RecordingError(_truncated(len(data)))
        raise RecordingError("it is no MCAP file; give a recording that sautereau has made")
    _check_profile(data)
    if len(data) < MAGIC_SIZE + _FOOTER.size + MAGIC_SIZE or not data.endswith(MCAP0_MAGIC):
        raise RecordingError(_truncated(len(data)))
    at = len(data) - MAGIC_SIZE - _FOOTER.size
    opcode, length, summary, _, crc = _FOOTER.unpack_from(data, at)
    if opcode != Opcode.FOOTER or length != _FOOTER.size - _PREFIX.size:
        raise RecordingError(_truncated(len(data)))
    if not MAGIC_SIZE + _DATA_END.size <= summary <= at:
        raise RecordingError(_corrupted("its footer"))
    view = memoryview(data)
    if zlib.crc32(view[summary : len(data) - MAGIC_SIZE - _CRC_SIZE]) != crc:
        raise RecordingError(_corrupted("its summary"))
    end = summary - _DATA_END.size
    opcode, length, crc = _DATA_END.unpack_from(data, end)
    if opcode != Opcode.DATA_END or length != _CRC_SIZE or zlib.crc32(view[:end]) != crc:
        raise RecordingError(_corrupted("its data"))


def _check_profile(data: bytes) -> None:
    """Read the header record, which follows the magic bytes."""
    start = MAGIC_SIZE + _PREFIX.size
    expected = struct.pack("<I", len(PROFILE)) + PROFILE.encode("ascii")
    found = data[start : start + len(expected)]
    if found != expected[: len(found)] or data[MAGIC_SIZE : MAGIC_SIZE + 1] not in (
        b"",
        bytes([Opcode.HEADER]),
    ):
        raise RecordingError(
            "it is an MCAP file, but its header does not say that sautereau has made it; give"
            " another file, or take it from its copy if it is damaged"
        )


def _truncated(size: int) -> str:
    return (
        f"it is cut short: {size} bytes and no end, as after a crash or a full disk; keep it: the"
        " samples up to the damage are in it, and a command to recover them is planned for a"
        " later version"
    )


def _corrupted(where: str) -> str:
    return (
        f"it is corrupted: the checksum of {where} does not match; take it from its copy, or keep"
        " it: samples outside the damage are in it, and a command to recover them is planned"
        " for a later version"
    )
