"""Import of TDMS files of LabVIEW, and of WAV files of a vibrometer's digital output."""

import itertools
import struct
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sautereau.daq.convert.document import (
    DOCUMENT_KEY,
    full_scale,
    read_document,
    read_sidecar,
    volts_name,
)
from sautereau.daq.convert.formats import Columns, ImportSource, refuse_rows
from sautereau.daq.errors import RecordingError
from sautereau.rig.extras import require

UNIT_PROPERTIES = ("unit_string", "NI_UnitDescription")


def open_tdms(path: Path) -> ImportSource:
    """Open a TDMS file; a column is ``channel``, or ``group/channel`` if that name is repeated.

    Unit, rate and start are those of the waveform properties, if the file has them.

    Raises:
        RecordingError: It is damaged, or not a TDMS file.
        MissingExtraError: npTDMS is not installed.
    """
    require("tdms", f"{path}: TDMS", "nptdms")
    from nptdms import TdmsFile

    try:
        file_metadata = TdmsFile.read_metadata(path)
    except Exception as error:  # nptdms raises many kinds, depending on the bytes
        raise RecordingError(
            f"it is damaged, or not a TDMS file: {type(error).__name__}: {error}"
        ) from error
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
    dates = {str(v["wf_start_time"]) for v in properties.values() if v.get("wf_start_time")}

    def read(names: list[str]) -> Columns:
        refuse_rows(max((len(of[name]) for name in names), default=0))
        try:
            with TdmsFile.open(path) as file:
                data = {n: file[of[n].group_name][of[n].name][:] for n in names}
        except Exception as error:
            raise RecordingError(
                f"its samples cannot be read: {type(error).__name__}: {error}; use a copy of it"
            ) from error
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
        started=f"{min(dates)}+00:00" if dates else None,
        document=read_document(document) if isinstance(document, str) else None,
    )


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

    try:
        _check_chunks(path)
        with warnings.catch_warnings():
            # Chunks of notes and markers are no fault; a truncated file is.
            warnings.filterwarnings("ignore", "Chunk", wavfile.WavFileWarning)
            warnings.filterwarnings("error", "Reached EOF", wavfile.WavFileWarning)
            rate, samples = wavfile.read(path)
        if rate <= 0 or not samples.size:
            raise ValueError(f"it has {samples.size} samples at {rate} Hz")
    except RecordingError:
        raise
    except Exception as error:  # scipy raises many kinds, depending on the bytes
        raise RecordingError(
            f"it is damaged, or not a WAV file: {type(error).__name__}: {error}; use a copy of it"
        ) from error
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


def _check_chunks(path: Path) -> None:
    """Refuse a file that is shorter than its chunks say; scipy would read a part."""
    size = path.stat().st_size
    with path.open("rb") as file:
        name, length, _ = struct.unpack("<4sI4s", file.read(12))
        if name != b"RIFF":
            return
        if length > size - 8:
            raise ValueError(f"its header says {length} bytes, but there are {size - 8}")
        frame = 0
        while len(head := file.read(8)) == 8 and file.tell() < length + 8:
            name, length_here = struct.unpack("<4sI", head)
            end = file.tell() + length_here
            if end > size:
                raise ValueError(f"its chunk {name!r} ends at {end} of {size} bytes")
            if name == b"fmt ":
                _, channels, _, _, frame, bits = struct.unpack("<HHIIHH", file.read(16))
                if not frame or frame != channels * ((bits + 7) // 8):
                    raise ValueError(f"{channels} channels of {bits} bits are not {frame} bytes")
            if name == b"data":
                if not frame or length_here % frame:
                    raise ValueError(f"{length_here} bytes are not samples of {frame} bytes")
                refuse_rows(length_here // frame)
            file.seek(end + length_here % 2)


def _fractions(samples: np.ndarray) -> np.ndarray:
    """Return the samples as fractions of full scale; scipy left-aligns 24 bits in 32."""
    if samples.dtype.kind == "f":
        return samples.astype(np.float64)
    zero = 128 if samples.dtype.kind == "u" else 0
    return (samples.astype(np.float64) - zero) / 2.0 ** (8 * samples.dtype.itemsize - 1)
