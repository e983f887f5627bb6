"""Universal files (.uff, .unv), as Polytec and Bruel & Kjaer export them, by pyuff.

A function of time is a dataset 58 of the function type 1 (Structural Dynamics Research
Corporation, universal file formats).
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pyuff

from sautereau.daq.convert.readers import Found, even, refuse, refuse_cut
from sautereau.rig.disk import open_regular

MARK = re.compile(rb"    -1(?:[\r\n]|$| {74})")
"""Begin and end of a dataset; pyuff ignores one without an end."""
FUNCTION, TIME_RESPONSE, EVEN = 58, 1, 1
DIRECTIONS = {0: "", 1: "X", 2: "Y", 3: "Z", 4: "RX", 5: "RY", 6: "RZ"}


def read(path: str, most: int) -> Found:
    """Return the functions of time, by their node and direction: ``1Z``, or by their first line.

    Times of a function that is not evenly spaced are ``NAME times``.
    """
    with open_regular(Path(path)) as file:
        text = file.read()
    refuse(len(text) / 4, most)
    if len(MARK.findall(text)) % 2:
        raise ValueError("it is cut off: its last dataset has no end")
    sets: Any = pyuff.UFF(path)
    numbers = [n for n, kind in enumerate(sets.get_set_types()) if kind == FUNCTION]
    arrays, about, others = {}, {}, 0
    for number in numbers:
        one = sets.read_sets(number)
        if one["func_type"] != TIME_RESPONSE or np.iscomplexobj(one["data"]):
            others += 1
            continue
        place = f"{one['rsp_node']}{DIRECTIONS.get(abs(one['rsp_dir']), '')}"
        place = f"-{place}" if one["rsp_dir"] < 0 else place
        title = one["id1"].strip()
        name = place if one["rsp_node"] else title or str(number + 1)
        name = f"{name} ({number + 1})" if name in arrays else name
        values = np.asarray(one["data"], dtype=float)
        refuse_cut(f"function {name!r}", len(values), one["num_pts"])
        arrays[name] = values[: one["num_pts"]]
        unit = one.get("ordinate_axis_units_lab", "").strip()
        step = one["abscissa_inc"] if one["abscissa_spacing"] == EVEN else 0.0
        about[name] = even(step, one["abscissa_min"], "" if unit == "NONE" else unit)
        if one["abscissa_spacing"] != EVEN:
            arrays[f"{name} times"] = np.asarray(one["x"], dtype=float)[: one["num_pts"]]
            about[f"{name} times"] = {"unit": "s"}
    if not arrays and others:
        raise ValueError(f"its {others} functions are spectra or others, and none is of time")
    return arrays, about, None
