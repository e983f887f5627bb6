"""A signal drawn in characters."""

import numpy as np
from numpy.typing import NDArray

_DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
"""Bits of a Braille pattern, by column and by row from the top."""
_BLANK = 0x2800


def trace_lines(values: NDArray[np.float64], width: int, height: int) -> list[str]:
    """Draw a signal in Braille, two columns and four rows of dots to a character.

    Every column shows the range from the smallest to the largest of its samples.

    Args:
        values: Signal, shape (n,), n >= 1; NaN and infinity are not drawn.
        width: In characters.
        height: In lines.
    """
    rows, columns = 4 * height, min(2 * width, len(values))
    finite = values[np.isfinite(values)]
    cells = np.full((height, width), _BLANK)
    if not len(finite):
        return ["".join(map(chr, line)) for line in cells]
    low, span = float(finite.min()), float(np.ptp(finite)) or 1.0
    for column, part in enumerate(np.array_split(values, columns)):
        part = part[np.isfinite(part)]
        if not len(part):
            continue
        ends = ((part.min() - low) / span, (part.max() - low) / span)
        bottom, top = (round(fraction * (rows - 1)) for fraction in ends)
        for row in range(rows - 1 - top, rows - bottom):
            cells[row // 4, column // 2] |= _DOTS[column % 2][row % 4]
    return ["".join(map(chr, line)) for line in cells]


def thinned(values: NDArray[np.float64], stretch: int) -> NDArray[np.float64]:
    """Return the smallest and the largest of every stretch of samples, so that peaks stay.

    Args:
        values: Signal, shape (n,), n >= 1.
        stretch: Length of a stretch, in samples; the last one may be shorter.
    """
    starts = np.arange(0, len(values), stretch)
    ends = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
    return np.stack(ends, -1).ravel()
