"""Import of TDMS files, as LabVIEW and NI's programs write them."""

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
