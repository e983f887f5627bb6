"""Measurement data format of ASAM (.mf4, .mdf), by asammdf."""

from pathlib import Path
from typing import Any

import asammdf

from sautereau.daq.convert.readers import Found, refuse, refuse_cut
from sautereau.rig.disk import open_regular


def read(path: str, most: int) -> Found:
    """Return the channels; those of several groups are called ``group(2)/NAME``.

    The times of a group are a channel as well, in s from the start of the measurement.
    """
    arrays, about = {}, {}
    with open_regular(Path(path)) as file:
        mark = file.read(8).strip()
    if mark == b"UnFinMF":
        raise ValueError("it was never finished; finish it with the program that wrote it")
    if mark != b"MDF":  # asammdf would unpack archives as well
        raise ValueError("its first bytes are not MDF")
    try:
        opened: Any = asammdf.MDF(path)
    except Exception as error:  # often of the attributes of its own half-made object
        raise ValueError("it is cut off or damaged") from error
    with opened as mdf:
        sizes = [group.channel_group.cycles_nr for group in mdf.groups]
        refuse(sum(len(g.channels) * n for g, n in zip(mdf.groups, sizes, strict=True)), most)
        begun = mdf.start_time
        known = begun.tzinfo is not None and begun.year > 1980  # or it was not set
        for number, (group, size) in enumerate(zip(mdf.groups, sizes, strict=True)):
            prefix = f"group({number + 1})/" if len(mdf.groups) > 1 else ""
            for index, channel in enumerate(group.channels):
                # A formula is text of a file; asammdf would let numexpr evaluate it.
                formula = _formula(channel.conversion)
                one = mdf.get(group=number, index=index, raw=formula)
                if one.samples.dtype.kind not in "fiu":  # texts, and structures of bytes
                    continue
                name = f"{prefix}{channel.name}"
                name = f"{name} ({index + 1})" if name in arrays else name
                refuse_cut(f"channel {name!r}", len(one.samples), size)
                arrays[name] = one.samples
                about[name] = {"unit": one.unit.strip()} if one.unit.strip() else {}
                about[name] |= {"date": begun.isoformat()} if known else {}
                about[name] |= {"unknown": "a formula as its conversion"} if formula else {}
    return arrays, about, None


def _formula(conversion: Any) -> bool:
    """Return whether a conversion, or one that it refers to, is a formula."""
    inner = (getattr(conversion, "referenced_blocks", None) or {}).values()
    return bool(getattr(conversion, "formula", "")) or any(map(_formula, inner))
