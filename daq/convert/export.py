"""Write a recording for other programs: Parquet or CSV."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from sautereau.daq.convert.document import document_text
from sautereau.daq.convert.source import SIMULATED
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.durable import DurableFile
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import Recorded
from sautereau.daq.signals.delays import undelayed
from sautereau.daq.signals.sensors import correct
from sautereau.rig.faults import fault_list

if TYPE_CHECKING:
    import pyarrow as pa

Format = Literal["parquet", "csv"]
METADATA_KEY = b"sautereau"
"""Of the document in a Parquet file's schema."""
TIME = "time [s]"
"""Name of the column of times from the trigger."""


def export(path: str | Path, to: Format, out: Path, *, raw: bool = False) -> list[Path]:
    """Write a recording as a table: a time, and of each channel the volts and the SI values.

    Columns are named with their unit: ``velocity [V]`` holds the raw volts, bit for bit, and
    ``velocity [m/s]`` what the sensor felt at the row's time: scaled, its AC coupling undone,
    its lag taken back, and empty in the last rows, which the sensor saw after the end. Neither
    offset nor drift is taken off. Where a stand-in made it, a column ``simulated`` says so.

    Parquet carries all else in its schema's metadata; ``NAME.csv`` is a plain table for
    spreadsheets, and beside it stands ``NAME.csv.json``. Nothing is overwritten.

    Args:
        path: Of the recording.
        to: Format.
        out: File to write.
        raw: Whether to leave out the SI values.

    Returns:
        The files written.

    Raises:
        RecordingError: The recording cannot be read, or the file not be written.
    """
    recorded = read_recording(path)
    table, columns = _table(recorded, raw)
    document = document_text(recorded, columns)
    if to == "parquet":
        return [_write_parquet(table, document, out)]
    return _write_csv(table, document, out)


def targets(files: list[Path], to: Format, out: Path | None) -> list[tuple[Path, Path]]:
    """Return each recording with the file to write, all of them free.

    Args:
        files: Recordings.
        to: Format, and suffix.
        out: File, or folder that is there; None for beside each recording.

    Raises:
        RecordingError: Several would go into one file, or a name is taken.
    """
    if out is not None and not out.is_dir() and len(files) > 1:
        raise RecordingError(
            f"export to {out}: {len(files)} recordings do not go into one file; give a folder that"
            " is there"
        )
    pairs = []
    for file in files:
        name = f"{file.stem}.{to}"
        pairs.append((file, out / name if out and out.is_dir() else out or file.with_name(name)))
    made = [target for _, target in pairs]
    faults = [
        f"{target}: {'it exists and is never overwritten' if target.exists() else 'twice'}; move"
        " it away or give another --out"
        for target in dict.fromkeys(made)
        if target.exists() or made.count(target) > 1
    ]
    if faults:
        raise RecordingError(fault_list("export", faults))
    return pairs


def _table(recorded: Recorded, raw: bool) -> "tuple[pa.Table, dict[str, dict[str, str]]]":
    """Return the table, and unit and meaning of its columns."""
    import pyarrow as pa

    n, rate = recorded.n_samples, recorded.rate
    arrays = {TIME: pa.array(recorded.time)}
    columns = {TIME: {"unit": "s", "what": "time from the trigger"}}
    for channel in recorded.rig.daq.channels:
        volts = recorded.volts[channel.name]
        name = f"{channel.name} [V]"
        arrays[name] = pa.array(volts)
        columns[name] = {"unit": "V", "what": "raw volts", "channel": channel.name}
        if raw:
            continue
        felt = undelayed(correct(volts, channel, rate), channel.lag * rate)
        name = f"{channel.name} [{channel.unit}]"
        unseen = pa.nulls(n - len(felt), pa.float64())
        arrays[name] = pa.concat_arrays([pa.array(felt), unseen])
        columns[name] = {
            "unit": channel.unit,
            "what": f"scaled by {channel.scale!r} {channel.unit}/V, AC coupling of"
            f" {channel.high_pass!r} Hz undone, lag of {channel.lag!r} s taken back",
            "channel": channel.name,
        }
    if recorded.simulated:
        arrays[SIMULATED] = pa.array(np.ones(n, dtype=bool))
        columns[SIMULATED] = {"unit": "", "what": "a stand-in made these samples"}
    fields = [pa.field(name, arrays[name].type, metadata=told) for name, told in columns.items()]
    return pa.table(list(arrays.values()), schema=pa.schema(fields)), columns


def _write_parquet(table: "pa.Table", document: str, out: Path) -> Path:
    import pyarrow.parquet as pq

    table = table.replace_schema_metadata({METADATA_KEY: document.encode()})
    file = DurableFile(out)
    try:
        with file.writing():
            pq.write_table(table, file.stream, compression="zstd")
        file.close()
    except BaseException:
        _discard(file)
        raise
    file.publish()
    return out


def _write_csv(table: "pa.Table", document: str, out: Path) -> list[Path]:
    from pyarrow import csv

    beside = out.with_name(out.name + ".json")
    file = DurableFile(out)
    try:
        with file.writing():
            csv.write_csv(table, file.stream, csv.WriteOptions(quoting_style="needed"))
        file.close()
        sidecar = DurableFile(beside)
        try:
            with sidecar.writing():
                sidecar.stream.write(document.encode())
            sidecar.close()
        except BaseException:
            _discard(sidecar)
            raise
    except BaseException:
        _discard(file)
        raise
    sidecar.publish()
    file.publish()
    return [out, beside]


def _discard(file: DurableFile) -> None:
    """Remove what is half written; the recording it came from still has all of it."""
    file.stream.close()
    file.part_path.unlink(missing_ok=True)
