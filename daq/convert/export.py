"""Export of a recording for other programs."""

from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, Literal

from sautereau.daq.convert.columns import columns_of
from sautereau.daq.convert.document import SIDECAR, document_text
from sautereau.daq.convert.to_tables import to_csv, to_parquet
from sautereau.daq.convert.to_waveforms import to_hdf5, to_tdms, to_wav
from sautereau.daq.file.container.durable import DurableFile
from sautereau.daq.file.reading import read_recording

Format = Literal["parquet", "csv", "h5", "wav", "tdms"]
"""Formats, by their file extensions."""
WRITERS = {"parquet": to_parquet, "csv": to_csv, "h5": to_hdf5, "wav": to_wav, "tdms": to_tdms}
"""Given the recording, its columns and its document, returns the parts of a file."""

ENDING = ".exporting.part"
"""Appended to the name of an exported file until it is complete."""


def export(path: str | Path, to: Format, out: Path, *, raw: bool = False) -> list[Path]:
    """Write the raw volts and the SI values of each channel of a recording.

    The name of a column ends with its unit: ``velocity [V]`` holds the raw volts, bit for bit,
    and ``velocity [m/s]`` the measured quantity at the row's time: calibrated, AC coupling
    inverted, sensor delay compensated. It has no values in the last rows, which the sensor
    measured after the end of the recording. Neither offset nor drift is removed. If the stand-in
    made the recording, a table has a column ``simulated``.

    Everything else in the recording is one document in JSON: in the file, or beside a CSV or WAV
    file as ``NAME.csv.json``. No existing file is overwritten, except inside `disk.replacing`.

    Args:
        raw: Whether to write the raw volts only, without the SI values.

    Returns:
        The files written.

    Raises:
        RecordingError: The recording cannot be read, or the file cannot be written.
    """
    recorded = read_recording(path)
    columns = list(columns_of(recorded, raw))
    document = document_text(recorded, {column.name: column.about for column in columns})
    parts = WRITERS[to](recorded, columns, document)
    return _write({out.with_name(out.name + end): write for end, write in parts.items()})


def files_of(to: str, out: Path) -> list[Path]:
    """Return the files that the export to `out` writes."""
    return [out, out.with_name(out.name + SIDECAR)] if to in ("csv", "wav") else [out]


def _write(files: dict[Path, Callable[[BinaryIO], object]]) -> list[Path]:
    """Write all files and return their paths; after an error none of them exists."""
    opened: list[DurableFile] = []
    try:
        for path, write in files.items():
            file = DurableFile(path, ending=ENDING)
            opened.append(file)
            with file.writing():
                write(file.stream)
            file.close()
    except BaseException:
        for file in opened:
            file.abandon()
            file.part_path.unlink(missing_ok=True)
        raise
    for file in reversed(opened):
        file.publish()
    return list(files)
