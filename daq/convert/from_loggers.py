"""Import of TDMS files of LabVIEW, and of WAV files of a vibrometer's digital output."""

import struct
import warnings
from pathlib import Path

import numpy as np

from sautereau.daq.convert.formats import Columns, ImportSource
from sautereau.daq.errors import RecordingError

UNIT_PROPERTIES = ("unit_string", "NI_UnitDescription")


def open_tdms(path: Path) -> ImportSource:
    """Open a TDMS file; a column is ``channel``, or ``group/channel`` if that name is repeated.

    Unit, rate and start are those of the waveform properties, if the file has them.

    Raises:
        RecordingError: It is damaged, or not a TDMS file.
    """
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
    steps = {name: float(values.get("wf_increment", 0)) for name, values in properties.items()}
    dates = {str(v["wf_start_time"]) for v in properties.values() if v.get("wf_start_time")}

    def read(names: list[str]) -> Columns:
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
        starts={
            name: float(values["wf_start_offset"])
            for name, values in properties.items()
            if "wf_start_offset" in values
        },
        started=f"{min(dates)}+00:00" if dates else None,
    )


def open_wav(path: Path) -> ImportSource:
    """Open a WAV file; its channels are called 1, 2 and so on, in fractions of full scale.

    Integers of b bits are divided by 2^(b - 1), which is exact; those of 8 bits are unsigned,
    and 128 is subtracted first.

    Raises:
        RecordingError: It is damaged, or not a WAV file.
    """
    from scipy.io import wavfile

    try:
        _check_length(path)
        with warnings.catch_warnings():
            # Chunks of notes and markers are no fault; a truncated file is.
            warnings.filterwarnings("ignore", "Chunk", wavfile.WavFileWarning)
            warnings.filterwarnings("error", "Reached EOF", wavfile.WavFileWarning)
            rate, samples = wavfile.read(path)
    except (ValueError, EOFError, OSError, struct.error, wavfile.WavFileWarning) as error:
        raise RecordingError(f"it is damaged, or not a WAV file: {error}") from error
    samples = samples.reshape(len(samples), -1)
    names = tuple(str(i + 1) for i in range(samples.shape[1]))

    def read(requested: list[str]) -> Columns:
        return {name: _fractions(samples[:, int(name) - 1]) for name in requested}

    rates = dict.fromkeys(names, float(rate))
    return ImportSource("WAV", names, read, rates=rates, full_scale=True)


def _check_length(path: Path) -> None:
    """Refuse a file that is shorter than its header says; scipy would read what there is."""
    with path.open("rb") as file:
        name, size = struct.unpack("<4sI", file.read(8))
    actual = path.stat().st_size - 8
    if name == b"RIFF" and size > actual:
        raise ValueError(f"its header says {size} bytes, but there are {actual}")


def _fractions(samples: np.ndarray) -> np.ndarray:
    """Return the samples as fractions of full scale; scipy left-aligns 24 bits in 32."""
    if samples.dtype.kind == "f":
        return samples.astype(np.float64)
    zero = 128 if samples.dtype.kind == "u" else 0
    return (samples.astype(np.float64) - zero) / 2.0 ** (8 * samples.dtype.itemsize - 1)
