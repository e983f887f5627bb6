"""Export of a recording as a table for other programs: Parquet or CSV."""

from collections.abc import Callable
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Literal

import numpy as np

from sautereau.daq.convert.document import PARQUET_KEY, SIMULATED, document_text
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.durable import DurableFile
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import Recorded
from sautereau.daq.signals.calibration import correct, undelayed
from sautereau.rig.faults import fault_list

if TYPE_CHECKING:
    import pyarrow as pa

Format = Literal["parquet", "csv"]
TIME = "time [s]"
"""Name of the column of times after the trigger."""


ENDING = ".exporting.part"
"""Appended to the name of an exported file until it is complete."""


def export(path: str | Path, to: Format, out: Path, *, raw: bool = False) -> list[Path]:
    """Write a recording as a table: a time, and of each channel the volts and the SI values.

    The name of a column ends with its unit: ``velocity [V]`` holds the raw volts, bit for bit,
    and ``velocity [m/s]`` the measured quantity at the row's time: calibrated, AC coupling
    inverted, sensor delay compensated. It is empty in the last rows, which the sensor measured
    after the end of the recording. Neither offset nor drift is removed. If the stand-in made
    the recording, there is a column ``simulated``.

    Parquet holds everything else in its schema's metadata; ``NAME.csv`` is a plain table for
    spreadsheets, with ``NAME.csv.json`` next to it. Nothing is overwritten; a
    file that holds the same already is left as it is.

    Args:
        path: Recording to read.
        to: Format.
        out: File to write.
        raw: Whether to write the raw volts only, without the SI values.

    Returns:
        The files written.

    Raises:
        RecordingError: The recording cannot be read, or the file cannot be written.
    """
    recorded = read_recording(path)
    table, columns = _table(recorded, raw)
    document = document_text(recorded, columns)
    if to == "parquet":
        import pyarrow.parquet as pq

        table = table.replace_schema_metadata({PARQUET_KEY: document.encode()})
        return _write({out: lambda stream: pq.write_table(table, stream, compression="zstd")})
    from pyarrow import csv

    options = csv.WriteOptions(quoting_style="needed")
    return _write(
        {
            out: lambda stream: csv.write_csv(table, stream, options),
            out.with_name(out.name + ".json"): lambda stream: stream.write(document.encode()),
        }
    )


def targets(files: list[Path], to: Format, out: Path | None) -> list[tuple[Path, Path]]:
    """Return each recording with the file to write.

    Args:
        files: Recordings.
        to: Format, and file extension.
        out: File, or existing folder; None for the folder of each recording.

    Raises:
        RecordingError: Several recordings would go into one file.
    """
    if out is not None and not out.is_dir() and len(files) > 1:
        raise RecordingError(
            f"export to {out}: {len(files)} recordings cannot go into one file; give an existing"
            " folder"
        )
    pairs = []
    for file in files:
        name = f"{file.stem}.{to}"
        pairs.append((file, out / name if out and out.is_dir() else out or file.with_name(name)))
    made = [target for _, target in pairs]
    faults = [
        f"{target}: given twice; give another --out"
        for target in dict.fromkeys(made)
        if made.count(target) > 1
    ]
    if faults:
        raise RecordingError(fault_list("export", faults))
    return pairs


def _table(recorded: Recorded, raw: bool) -> "tuple[pa.Table, dict[str, dict[str, str]]]":
    """Return the table, and unit and meaning of its columns."""
    import pyarrow as pa

    n, rate = recorded.n_samples, recorded.rate
    arrays = {TIME: pa.array(recorded.time)}
    columns = {TIME: {"unit": "s", "what": "time after the trigger"}}
    for channel in recorded.rig.daq.channels:
        volts = recorded.volts[channel.name]
        name = f"{channel.name} [V]"
        arrays[name] = pa.array(volts)
        columns[name] = {"unit": "V", "what": "raw volts", "channel": channel.name}
        if raw:
            continue
        early = min(n, ceil(max(0.0, -channel.lag) * rate - 1e-9))
        values = undelayed(correct(volts, channel, rate), channel.lag * rate + early)[: n - early]
        name = f"{channel.name} [{channel.unit}]"
        before, after = (pa.nulls(m, pa.float64()) for m in (early, n - early - len(values)))
        arrays[name] = pa.concat_arrays([before, pa.array(values), after])
        columns[name] = {
            "unit": channel.unit,
            "what": f"scaled by {channel.scale!r} {channel.unit}/V, AC coupling of"
            f" {channel.high_pass!r} Hz inverted, delay of {channel.lag!r} s compensated",
            "channel": channel.name,
        }
    if recorded.simulated:
        arrays[SIMULATED] = pa.array(np.ones(n, dtype=bool))
        columns[SIMULATED] = {"unit": "", "what": "the stand-in made these samples"}
    fields = [pa.field(name, arrays[name].type, metadata=about) for name, about in columns.items()]
    return pa.table(list(arrays.values()), schema=pa.schema(fields)), columns


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
        for file in opened:
            file.check()
    except BaseException:
        for file in opened:
            file.abandon()
            file.part_path.unlink(missing_ok=True)
        raise
    for file in reversed(opened):
        file.publish()
    return list(files)
