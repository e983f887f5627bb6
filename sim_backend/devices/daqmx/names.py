"""Lists of names with ranges, as the driver writes them."""

import re
from collections.abc import Iterable

from sautereau.sim_backend.devices.daqmx.driver_errors import DaqmxError

MOST_CHANNELS = 1024
"""Channels that one range may name."""
_SPAN = re.compile(r"(.*?)(\d+):(?:.*?)(\d+)")


def split_names(text: str) -> Iterable[str]:
    """Yield the names of a list with ranges: ``"a, b0:2"`` has a, b0, b1, b2."""
    for part in (part.strip() for part in text.split(",")):
        span = _SPAN.fullmatch(part)
        if not span:
            yield part
            continue
        first, last = int(span[2]), int(span[3])
        if abs(last - first) > MOST_CHANNELS:
            raise DaqmxError(-200170, f"More than {MOST_CHANNELS} channels: {part}")
        step = 1 if last >= first else -1
        for number in range(first, last + step, step):
            yield f"{span[1]}{number}"
