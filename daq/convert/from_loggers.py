"""Import of TDMS files of LabVIEW, and of WAV files of a vibrometer's digital output."""

import itertools
import struct
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from sautereau.daq.convert.document import (
    DOCUMENT_KEY,
    full_scale,
    read_document,
    read_sidecar,
    volts_name,
)
from sautereau.daq.convert.formats import Columns, ImportSource, reading, refuse_rows
from sautereau.daq.errors import RecordingError
from sautereau.rig.disk import open_regular
from sautereau.rig.errors import require

UNIT_PROPERTIES = ("unit_string", "NI_UnitDescription")

NO_DATE = "1904-01-01T00:00"  # LabVIEW's date 0
LEAD_IN = 28
"""Bytes at the start of a TDMS segment: tag, flags, version, length of the rest, and of the
metadata in it."""


def open_tdms(path: Path) -> ImportSource:
    """Open a TDMS file; a column is ``channel``, or ``group/channel`` if that name is repeated.

    Unit, rate and start are those of the waveform properties, if the file has them.

    Raises:
        RecordingError: It is damaged, or not a TDMS file.
        MissingExtraError: npTDMS is not installed.
    """
    require("tdms", f"{path}: TDMS", "nptdms")
    from nptdms import TdmsFile

    with reading("TDMS"), open_regular(path) as file:
        file_metadata = TdmsFile.read_metadata(file)
        missing = _missing_bytes(file, path.stat().st_size)
    if missing:
        statuses = file_metadata.file_status.channel_statuses or {}
        listed = ", ".join(
            f"{name} has {one.read_length} of {one.expected_length}"
            for name, one in statuses.items()
        )
        raise RecordingError(
            f"it is cut off: {missing}; samples of its last block: {listed or 'unknown'}; use a"
            " complete copy"
        )
    channels = [channel for group in file_metadata.groups() for channel in group.channels()]
    plain = [channel.name for channel in channels]
    of = {c.name if plain.count(c.name) == 1 else f"{c.group_name}/{c.name}": c for c in channels}
    properties = {name: dict(channel.properties) for name, channel in of.items()}
    units = {
        name: str(values[key])
        for name, values in properties.items()
        for key in reversed(UNIT_PROPERTIES)
        if values.get(key)
    }
    steps = _numbers(properties, "wf_increment")
    document = file_metadata.properties.get(DOCUMENT_KEY)
    dates = {
        name: str(v["wf_start_time"]) for name, v in properties.items() if "wf_start_time" in v
    }

    def read(names: list[str]) -> Columns:
        refuse_rows(max((len(of[name]) for name in names), default=0))
        with reading("TDMS"), open_regular(path) as opened, TdmsFile.open(opened) as file:
            data = {n: file[of[n].group_name][of[n].name][:] for n in names}
        for name, values in data.items():
            if not np.issubdtype(values.dtype, np.number) or np.iscomplexobj(values):
                raise RecordingError(
                    f"channel {name!r} holds {values.dtype}, not real numbers; give another channel"
                )
        return {name: np.asarray(values, dtype=np.float64) for name, values in data.items()}

    return ImportSource(
        "TDMS",
        tuple(of),
        read,
        units=units,
        rates={name: float(f"{1 / step:.12g}") for name, step in steps.items() if step > 0},
        starts=_numbers(properties, "wf_start_offset"),
        dates={n: f"{date}+00:00" for n, date in dates.items() if not date.startswith(NO_DATE)},
        document=read_document(document) if isinstance(document, str) else None,
    )


def _missing_bytes(file: BinaryIO, size: int) -> str:
    """Return what the segments of a TDMS file declare beyond its size; empty if it is complete."""
    at = 0
    while at < size:
        file.seek(at)
        lead_in = file.read(LEAD_IN)
        if len(lead_in) < LEAD_IN:
            return f"{len(lead_in)} of {LEAD_IN} bytes of its last segment's start are there"
        order = ">" if lead_in[4] & (1 << 6) else "<"  # Big endian
        (length,) = struct.unpack(f"{order}Q", lead_in[12:20])
        if length == 2**64 - 1:
            return "its last segment was never finished"
        at += LEAD_IN + length
    return f"{at - size} bytes are missing at its end" if at > size else ""


def _numbers(properties: Mapping[str, Mapping[str, Any]], key: str) -> dict[str, float]:
    """Return a property of each channel that has it as a finite number."""
    found = {name: values.get(key) for name, values in properties.items()}
    return {
        name: float(value)
        for name, value in found.items()
        if isinstance(value, int | float | np.number) and np.isfinite(value)
    }


def open_wav(path: Path) -> ImportSource:
    """Open a WAV file; its channels are called 1, 2 and so on, in fractions of full scale.

    If the file is an export with its metadata beside it, the values are volts. Integers of b bits
    are divided by 2^(b - 1), which is exact. Integers of 8 bits are unsigned, so 128 is subtracted
    first.

    Raises:
        RecordingError: It is damaged, or not a WAV file.
    """
    from scipy.io import wavfile

    with reading("WAV"), open_regular(path) as file, warnings.catch_warnings():
        if lie := _lie_of_header(file, path.stat().st_size):
            raise RecordingError(
                f"its header and its content differ: {lie}; use a complete copy, or correct its"
                " header, for example with sox --ignore-length"
            )
        file.seek(0)
        # Chunks of notes and markers are no fault; a truncated file is.
        warnings.filterwarnings("ignore", "Chunk", wavfile.WavFileWarning)
        warnings.filterwarnings("error", "Reached EOF", wavfile.WavFileWarning)
        rate, samples = wavfile.read(file)
        if rate <= 0 or not samples.size:
            raise ValueError(f"it has {samples.size} samples at {rate} Hz")
    samples = samples.reshape(len(samples), -1)
    names, scales = tuple(str(i + 1) for i in range(samples.shape[1])), itertools.repeat(1.0)
    document = read_sidecar(path)
    if document is not None:
        channels = document.rig.daq.channels
        names = tuple(volts_name(channel.name) for channel in channels)
        scales = [full_scale(channel) for channel in channels]
        if samples.shape[1] != len(channels):
            raise RecordingError(
                f"it has {samples.shape[1]} channels, and its metadata {len(channels)}; use a copy"
            )
    columns = dict(zip(names, zip(samples.T, scales, strict=False), strict=True))

    def read(requested: list[str]) -> Columns:
        return {name: _fractions(columns[name][0]) * columns[name][1] for name in requested}

    rates = dict.fromkeys(names, float(rate))
    return ImportSource("WAV", names, read, rates=rates, full_scale=True, document=document)


def _lie_of_header(file: BinaryIO, size: int) -> str:
    """Return where the lengths in a WAV file are not those of its content; empty if they are."""
    kind, head, _ = struct.unpack("4s4s4s", file.read(12))
    order = ">" if kind == b"RIFX" else "<"
    (length,) = struct.unpack(f"{order}I", head)
    of_data = None
    if kind == b"RF64":  # its lengths are in its first chunk
        _, length, of_data = struct.unpack("<8sQQ", file.read(24))
    end, at, frame, frames = length + 8, 12, 0, []
    while at < end <= size:
        file.seek(at)
        name, here = struct.unpack(f"{order}4sI", file.read(8).ljust(8, b"\0"))
        here = of_data if of_data is not None and name == b"data" else here
        if min(name) < ord(" ") or max(name) > ord("~") or at + 8 + here > end:
            return f"{end - at} bytes of {size} from byte {at} on are no chunk of this length"
        if name == b"fmt ":
            _, channels, _, _, frame, bits = struct.unpack(f"{order}HHIIHH", file.read(16))
            if not frame or frame != channels * ((bits + 7) // 8):
                return f"{channels} channels of {bits} bits are not {frame} bytes"
        if name == b"data":
            frames.append(here // frame if frame else 0)
            if frames != [here / (frame or 1)]:
                return f"{here} bytes are not samples of {frame} bytes, or not the only samples"
            refuse_rows(frames[0])
        at += 8 + here + here % 2
    if size > max(at, end) or size < end:
        return f"it says {end} bytes and {sum(frames)} samples, and it has {size} bytes"
    return ""


def _fractions(samples: np.ndarray) -> np.ndarray:
    """Return the samples as fractions of full scale; scipy left-aligns 24 bits in 32."""
    if samples.dtype.kind == "f":
        return samples.astype(np.float64)
    zero = 128 if samples.dtype.kind == "u" else 0
    return (samples.astype(np.float64) - zero) / 2.0 ** (8 * samples.dtype.itemsize - 1)
