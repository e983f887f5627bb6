"""The first press of a recording in which the key is pressed more than once."""

from dataclasses import replace

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.drift import HIGH, LOW, block_means
from sautereau.analysis.loading.press import Press


def first_press(press: Press) -> Press:
    """Return a press, up to the lowest place of its key before it is pressed again.

    Of the force alone, it is the press up to the pause before the next one.
    """
    end = _end_by_force(press) if press.missing == "velocity" else _end_by_key(press)
    if end is None:
        return press
    warning = (
        f"the key goes down again after {press.time[end - 1] * 1e3:.5g} ms: only the first press is"
        " analysed; `sautereau split` writes each press into a recording of its own"
    )
    return replace(
        press,
        time=press.time[:end],
        samples={name: column[:end] for name, column in press.samples.items()},
        warnings=(*press.warnings, warning),
    )


def _end_by_key(press: Press) -> int | None:
    """Return the row after the first press; None if there is no other one."""
    path = press.samples["deflection"]
    high = HIGH * float(path.max(initial=0.0))
    first = int(np.argmax(path > high))
    back = first + int(np.argmax(path[first:] < LOW / HIGH * high))
    again = back + int(np.argmax(path[back:] > high))
    return back + int(np.argmin(path[back:again])) + 1 if first < back < again else None


def _end_by_force(press: Press) -> int | None:
    """Return the same by the force alone."""
    from sautereau.analysis.loading.presses import block_size, find_presses

    force, rate = press.samples["force"], press.rate
    try:
        means = block_means(force, block_size(rate))
        found = find_presses({"force": means}, rate, len(force), press.rig).presses
    except AnalysisError:
        return None
    return found[0].stop if len(found) > 1 else None
