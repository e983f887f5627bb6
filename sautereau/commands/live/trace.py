"""A signal drawn in characters."""

import numpy as np
from numpy.typing import NDArray

_DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
"""Bits of a Braille pattern, by column and by row from the top."""
_BLANK = 0x2800


def trace_lines(values: NDArray[np.float64], width: int, height: int) -> list[str]:
    """Draw a signal in Braille, two columns and four rows of dots to a character.

    Every column holds the least and the largest of its samples and all between.

    Args:
        values: Shape (n,), n >= 1; what is no number is not drawn.
        width: Characters.
        height: Lines.
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
        bottom, top = (round(share * (rows - 1)) for share in ends)
        for row in range(rows - 1 - top, rows - bottom):
            cells[row // 4, column // 2] |= _DOTS[column % 2][row % 4]
    return ["".join(map(chr, line)) for line in cells]


def thinned(values: NDArray[np.float64], stretch: int) -> NDArray[np.float64]:
    """Return the least and the largest of even stretches: every peak stays.

    Args:
        values: Shape (n,), n >= 1.
        stretch: Samples of one; the last is shorter.
    """
    starts = np.arange(0, len(values), stretch)
    ends = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
    return np.stack(ends, -1).ravel()
