"""Export of a recording for other programs: as a table, as waveforms, or as an xarray Dataset.

A table, in Parquet or CSV, has one row for each sample. Waveforms, in HDF5, TDMS or WAV, are evenly
sampled, each with its start and rate.
"""

import io
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from sautereau.daq.convert.document import (
    DOCUMENT_KEY,
    PARQUET_KEY,
    SIDECAR,
    SIMULATED,
    Parts,
    document_text,
    full_scale,
    volts_name,
)
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.durable import DurableFile
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import Recorded, Signal
from sautereau.daq.file.samples import TOPIC, TYPES, layout_from_metadata
from sautereau.daq.signals.calibration import restored
from sautereau.rig.acquisition import MEASURED, Channel
from sautereau.rig.errors import require

if TYPE_CHECKING:
    import pyarrow as pa

Format = Literal["parquet", "csv", "h5", "wav", "tdms"]  # Formats, by their file extensions
ENDING = ".exporting.part"  # Appended to the name of an exported file until it is complete
TIME = "time [s]"  # Name of the column of times after the trigger
JOINT_UNITS = {"jack_rise": "m", "m1": "N m", "m2": "N m"}
"""Units of the joints' variables, where they are not rad."""


@dataclass(frozen=True)
class Column:
    """One column of an export."""

    name: str
    """Name with its unit: `velocity [V]`."""
    unit: str
    what: str
    """Meaning."""
    values: NDArray[np.float64] | NDArray[np.bool_]
    """Shape (n,); a column of SI values may start later and end earlier than the recording."""
    channel: str = ""
    """Name of the channel; empty for times and `simulated`."""
    start: int = 0
    """Rows of the recording before the first value."""

    @property
    def about(self) -> dict[str, str]:
        """Unit, meaning and channel, as text."""
        found = {"unit": self.unit, "what": self.what, "channel": self.channel}
        return {key: text for key, text in found.items() if text or key != "channel"}

    @property
    def raw(self) -> bool:
        """Whether these are the raw volts of a channel."""
        return self.name == volts_name(self.channel)


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
    ways = {"parquet": to_parquet, "csv": to_csv, "h5": to_hdf5, "wav": to_wav, "tdms": to_tdms}
    parts = ways[to](recorded, columns, document)
    files = {out.with_name(out.name + end): write for end, write in parts.items()}
    with ExitStack() as stack:  # the first file is the last to get its name
        for path, write in files.items():
            write(stack.enter_context(DurableFile(path, ending=ENDING).made()))
    return list(files)


def files_of(to: str, out: Path) -> list[Path]:
    """Return the files that the export to `out` writes."""
    return [out, out.with_name(out.name + SIDECAR)] if to in ("csv", "wav") else [out]


def columns_of(recorded: Recorded, raw: bool) -> Iterator[Column]:
    """Yield the columns of a recording; SI values only without ``raw``."""
    n, rate = recorded.n_samples, recorded.rate
    yield Column(TIME, "s", "time after the trigger", recorded.time)
    for channel in recorded.rig.daq.channels:
        volts = recorded.volts[channel.name]
        yield Column(volts_name(channel.name), "V", "raw volts", volts, channel.name)
        if not raw:
            yield si_values(channel, volts, rate)
    if recorded.simulated:
        made = np.ones(n, dtype=bool)
        yield Column(SIMULATED, "", "the stand-in made these samples", made)


def si_values(channel: Channel, volts: Signal, rate: float) -> Column:
    """Return the SI values of a channel at the times of the rows that have one."""
    n = len(volts)
    early = min(n, ceil(max(0.0, -channel.lag * rate) - 1e-9))
    values = restored(volts, channel, rate, early)[: n - early]
    what = (
        f"scaled by {channel.scale!r} {channel.unit}/V, AC coupling of {channel.high_pass!r} Hz"
        f" inverted, delay of {channel.lag!r} s compensated"
    )
    name = f"{channel.name} [{channel.unit}]"
    if name == volts_name(channel.name):
        name = f"{channel.name}, scaled [V]"
    return Column(name, channel.unit, what, values, channel.name, early)


def counts_of(recorded: Recorded, name: str) -> tuple[NDArray[np.int_], float, float] | None:
    """Return a channel's counts, V per count and V of the count 0.

    None if the recording has volts, or if counts * V per count + V of the count 0 is not the
    volts bit for bit, as with a polynomial of higher degree.
    """
    described = recorded.channels.get(TOPIC)  # none in format 1
    layout = layout_from_metadata(described) if described else None
    if layout is None or not layout.scaling:
        return None
    offset, per_count, *higher = (*layout.scaling[layout.names.index(name)], 0.0)
    volts = recorded.volts[name]
    if not per_count or any(higher):
        return None
    counts = np.rint((volts - offset) / per_count).astype(TYPES[layout.kind])
    same = (counts * per_count + offset).view(np.uint64) == volts.view(np.uint64)
    return (counts, per_count, offset) if same.all() else None


def to_parquet(recorded: Recorded, columns: Sequence[Column], document: str) -> Parts:
    """Return a Parquet file; its schema's metadata hold the document."""
    import pyarrow.parquet as pq

    table = _table(recorded, columns).replace_schema_metadata({PARQUET_KEY: document.encode()})
    return {"": lambda stream: pq.write_table(table, stream, compression="zstd")}


def to_csv(recorded: Recorded, columns: Sequence[Column], document: str) -> Parts:
    """Return a plain table, and the document beside it."""
    from pyarrow import csv

    table, options = _table(recorded, columns), csv.WriteOptions(quoting_style="needed")
    return {
        "": lambda stream: csv.write_csv(table, stream, options),
        SIDECAR: lambda stream: stream.write(document.encode()),
    }


def _table(recorded: Recorded, columns: Sequence[Column]) -> "pa.Table":
    """Return the columns, empty where they have no value."""
    import pyarrow as pa

    arrays, fields = [], []
    for column in columns:
        values = pa.array(column.values)
        after = recorded.n_samples - column.start - len(values)
        before, behind = (pa.nulls(m, values.type) for m in (column.start, after))
        arrays.append(pa.concat_arrays([before, values, behind]))
        fields.append(pa.field(column.name, values.type, metadata=column.about))
    return pa.table(arrays, schema=pa.schema(fields))


def to_hdf5(recorded: Recorded, columns: Sequence[Column], document: str) -> Parts:
    """Return an HDF5 file laid out as in Neurodata Without Borders.

    ``acquisition/NAME/data`` holds the counts or raw volts of a channel, ``processing/NAME/data``
    its SI values. The value in ``unit`` is data * ``conversion`` + ``offset``; all three are
    attributes. ``starting_time`` beside the data is the time of the first value in s after the
    trigger; its attribute ``rate`` is in Hz. The data set ``sautereau`` is the document.
    """
    require("hdf5", "export to HDF5", "h5py")
    import h5py

    held = io.BytesIO()
    with h5py.File(held, "w") as file:
        file[DOCUMENT_KEY] = document
        for column, values, per_count, offset in _waveforms(recorded, columns):
            group = file.create_group(
                f"{'acquisition' if column.raw else 'processing'}/{column.channel}"
            )
            group.attrs["description"] = column.what
            data = group.create_dataset("data", data=values)
            data.attrs.update(unit=column.unit, conversion=per_count, offset=offset)
            start = group.create_dataset("starting_time", data=_start(recorded, column))
            start.attrs.update(rate=recorded.rate, unit="seconds")
    return {"": lambda stream: stream.write(held.getbuffer())}


def to_tdms(recorded: Recorded, columns: Sequence[Column], document: str) -> Parts:
    """Return a TDMS file: a group ``raw`` of counts with their scale, or volts; and ``SI``.

    The waveform properties of each channel are its start, the trigger being time 0, and its
    interval.
    """
    require("tdms", "export to TDMS", "nptdms")
    from nptdms import ChannelObject, RootObject, TdmsWriter

    t0 = np.datetime64(recorded.t0_ns, "ns")
    objects: list[Any] = [RootObject({DOCUMENT_KEY: document})]
    for column, values, per_count, offset in _waveforms(recorded, columns):
        properties: dict[str, Any] = {
            "unit_string": column.unit,
            "description": column.what,
            "wf_start_time": t0,
            "wf_start_offset": _start(recorded, column),
            "wf_increment": 1 / recorded.rate,
        }
        if values.dtype.kind == "i":
            properties |= {
                "NI_Scaling_Status": "unscaled",
                "NI_Number_Of_Scales": 1,
                "NI_Scale[0]_Scale_Type": "Linear",
                "NI_Scale[0]_Linear_Slope": per_count,
                "NI_Scale[0]_Linear_Y_Intercept": offset,
            }
        group = "raw" if column.raw else "SI"
        objects.append(ChannelObject(group, column.name, values, properties))

    def write(stream: Any) -> None:
        with TdmsWriter(stream) as writer:
            writer.write_segment(objects)

    return {"": write}


def to_wav(recorded: Recorded, columns: Sequence[Column], document: str) -> Parts:
    """Return a WAV file of doubles with the raw volts alone, and the document beside it.

    The value 1 means the smallest power of two, in V, that is not below the channel's range, so
    that no bit changes. The format requires an integer rate; the document holds the exact one.
    """
    from scipy.io import wavfile

    scales = [full_scale(channel) for channel in recorded.rig.daq.channels]
    volts = [column.values for column in columns if column.raw]
    frames = np.stack([v / scale for v, scale in zip(volts, scales, strict=True)], axis=1)

    def write(stream: Any) -> None:
        try:
            wavfile.write(stream, round(recorded.rate), frames)
        except ValueError as error:  # of 4 GB
            raise RecordingError(
                f"export of {recorded.path} to WAV: {error}; export it to another format"
            ) from error

    return {"": write, SIDECAR: lambda stream: stream.write(document.encode())}


def _waveforms(
    recorded: Recorded, columns: Sequence[Column]
) -> Iterator[tuple[Column, NDArray[Any], float, float]]:
    """Yield the columns of channels, with data, V per count and offset of counts, or 1 and 0."""
    for column in columns:
        if column.channel:
            counts = counts_of(recorded, column.channel) if column.raw else None
            values, per_count, offset = counts or (column.values, 1.0, 0.0)
            yield column, values, per_count, offset


def _start(recorded: Recorded, column: Column) -> float:
    """Return the time of the first value of a column, s after the trigger."""
    return (recorded.first_sample + column.start) / recorded.rate


def to_xarray(recorded: Recorded, *, raw: bool = False) -> Any:
    """Return a recording as an xarray Dataset, each variable with its ``units``.

    The channels are variables over ``time``, in s after the trigger: calibrated, AC coupling
    inverted, sensor delays compensated, so that the last rows, which not all sensors show, are
    omitted; neither offset nor drift is removed. Encoders, following errors and torques are
    variables over ``joints_time``, the planned motion over ``plan_time``, both in s after the
    trigger on the controller's clock. The attributes describe the press.

    Args:
        raw: Whether the channels are raw volts, of all rows.

    Raises:
        MissingExtraError: xarray is not installed.
    """
    require("xarray", "to_xarray", "xarray")
    import xarray as xr  # pyright: ignore[reportMissingImports]

    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {"time": ("time", recorded.time, {"units": "s"})}
    if raw:
        for name, volts in recorded.volts.items():
            variables[name] = ("time", volts, {"units": "V"})
    else:
        found = {
            channel: si_values(channel, recorded.volts[channel.name], recorded.rate)
            for channel in recorded.rig.daq.channels
        }
        first = max(column.start for column in found.values())
        stop = min(column.start + len(column.values) for column in found.values())
        coordinates["time"] = ("time", recorded.time[first:stop], {"units": "s"})
        for channel, column in found.items():
            values = column.values[first - column.start : max(first, stop) - column.start]
            about = {"units": column.unit, "long_name": MEASURED.get(channel.quantity).meaning}
            variables[channel.name] = ("time", values, about | {"what": column.what})
    for kind, series in (("joints", recorded.joints), ("plan", recorded.plan)):
        if series is not None:
            coordinates[f"{kind}_time"] = (f"{kind}_time", series.t, {"units": "s"})
            for name, values in vars(series).items():
                if name != "t" and len(values):
                    units = {"units": JOINT_UNITS.get(name, "rad")}
                    variables[f"{kind}_{name}"] = (f"{kind}_time", values, units)
    about = {key: text for key, text in recorded.session.to_metadata().items() if text}
    about |= {"rig": recorded.rig.name, "rate_Hz": recorded.rate, "t0_ns": recorded.t0_ns}
    return xr.Dataset(variables, coordinates, about)
