"""LabVIEW measurement files (.lvm), by lvm_read."""

from pathlib import Path
from typing import Any

import lvm_read

from sautereau.daq.convert.readers import Found, even, refuse, refuse_cut
from sautereau.rig.disk import open_regular

NAN = float("nan")
KEYS = ("Delta_X", "X0", "Samples", "Y_Unit_Label")  # A value for each channel


def read(path: str, most: int) -> Found:
    """Return the channels; those of several segments are called ``segment(2).NAME``."""
    with open_regular(Path(path)) as file:
        text = file.read().decode("utf-8", "replace").replace("\r\n", "\n")
    refuse(text.count("\t") + text.count("\n"), most)
    # Not `lvm_read.read`: it unpickles a file beside this one.
    lvm: Any = lvm_read.read_str(text)
    arrays, about = {}, {}
    for number in range(lvm["Segments"]):
        segment, prefix = lvm[number], f"segment({number + 1})." if lvm["Segments"] > 1 else ""
        names, data = segment["Channel names"], segment["data"]
        many = lvm.get("X_Columns") == "Multi"  # each channel has a column of times before it
        channel = -1
        for column, name in enumerate(names):
            if name == "Comment" or column >= data.shape[1]:
                continue
            is_time = name == "X_Value"
            channel += is_time if many else not is_time
            known = {key: value[max(channel, 0)] for key, value in segment.items() if key in KEYS}
            values = data[:, column]
            if (samples := known.get("Samples", NAN)) == samples:  # it is given
                refuse_cut(f"channel {name!r}", len(values), int(samples))
                values = values[: int(samples)] if many else values
            key = f"{prefix}{name}"
            key = f"{key} ({channel + 1})" if key in arrays else key
            arrays[key] = values
            step, start = (NAN if is_time else known.get(of, NAN) for of in ("Delta_X", "X0"))
            unit = "s" if is_time else known.get("Y_Unit_Label", "")
            about[key] = even(step, start, unit)
    return arrays, about, None
