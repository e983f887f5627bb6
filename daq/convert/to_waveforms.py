"""Export as evenly sampled waveforms, each with start and rate: HDF5, TDMS and WAV."""

import io
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.daq.convert.columns import Column, counts_of
from sautereau.daq.convert.document import DOCUMENT_KEY, SIDECAR, Parts, full_scale
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.recorded import Recorded
from sautereau.rig.errors import require


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
