"""The first press of a recording in which the key is pressed more than once."""

from dataclasses import replace

import numpy as np

from sautereau.analysis.loading.press import Press

HIGH, LOW = 0.6, 0.35
"""Dimensionless, fractions of the largest deflection: a key that was above the first, below the
second and again above the first was pressed more than once."""


def first_press(press: Press) -> Press:
    """Return a press, up to the lowest place of its key before it is pressed again."""
    if "deflection" not in press.samples:
        return press
    path = press.samples["deflection"]
    high = HIGH * float(path.max(initial=0.0))
    first = int(np.argmax(path > high))
    back = first + int(np.argmax(path[first:] < LOW / HIGH * high))
    again = back + int(np.argmax(path[back:] > high))
    if not first < back < again:
        return press
    end = back + int(np.argmin(path[back:again])) + 1
    warning = (
        f"the key goes down again after {press.time[end - 1] * 1e3:.5g} ms: only the first press is"
        " analysed; save each press as a recording of its own"
    )
    return replace(
        press,
        time=press.time[:end],
        samples={name: column[:end] for name, column in press.samples.items()},
        warnings=(*press.warnings, warning),
    )
