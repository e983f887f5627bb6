"""TDMS files, as LabVIEW and NI's programs write them."""

from pathlib import Path

import numpy as np

from sautereau.daq.convert.source import Columns, Source
from sautereau.daq.errors import RecordingError

UNIT_PROPERTIES = ("unit_string", "NI_UnitDescription")


def open_tdms(path: Path) -> Source:
    """Open a TDMS file; a column is ``group/channel``, or the channel where it is the only one.

    Unit, rate and start come from the properties of a waveform, where the file has them.

    Raises:
        RecordingError: It is damaged, or no TDMS file.
    """
    from nptdms import TdmsFile

    try:
        found = TdmsFile.read_metadata(path)
    except Exception as error:  # nptdms raises whatever the bytes lead it to
        raise RecordingError(
            f"it is no TDMS file, or damaged: {type(error).__name__}: {error}"
        ) from error
    channels = [channel for group in found.groups() for channel in group.channels()]
    plain = [channel.name for channel in channels]
    of = {c.name if plain.count(c.name) == 1 else f"{c.group_name}/{c.name}": c for c in channels}
    properties = {name: dict(channel.properties) for name, channel in of.items()}
    units = {
        name: str(told[key])
        for name, told in properties.items()
        for key in reversed(UNIT_PROPERTIES)
        if told.get(key)
    }
    steps = {name: float(told.get("wf_increment", 0)) for name, told in properties.items()}
    dates = {str(t["wf_start_time"]) for t in properties.values() if t.get("wf_start_time")}

    def read(names: list[str]) -> Columns:
        try:
            with TdmsFile.open(path) as file:
                data = {n: file[of[n].group_name][of[n].name][:] for n in names}
        except Exception as error:
            raise RecordingError(
                f"its samples cannot be read: {type(error).__name__}: {error}; take it from its"
                " copy"
            ) from error
        for name, values in data.items():
            if not np.issubdtype(values.dtype, np.number) or np.iscomplexobj(values):
                raise RecordingError(
                    f"its channel {name!r} holds {values.dtype}, no real numbers; give another"
                )
        return {name: np.asarray(values, dtype=np.float64) for name, values in data.items()}

    return Source(
        "TDMS",
        tuple(of),
        read,
        units=units,
        rates={name: float(f"{1 / step:.12g}") for name, step in steps.items() if step > 0},
        starts={
            name: float(told["wf_start_offset"])
            for name, told in properties.items()
            if "wf_start_offset" in told
        },
        started=f"{min(dates)}+00:00" if dates else None,
    )
