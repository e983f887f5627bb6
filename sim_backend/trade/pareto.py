"""The points of a trade that no other point beats in both respects."""

from collections.abc import Sequence


def pareto(errors: Sequence[float], speeds: Sequence[float], margin: float = 0.0) -> list[int]:
    """Return the indices of the points that no other beats, the most accurate first.

    A point is beaten by one that is no worse in both respects and better in one. Of equal
    points the first stays.

    Args:
        errors: Finite, the less the better.
        speeds: Positive and finite, the more the better.
        margin: 1, share by which a less accurate point has to be faster to count as such.
    """
    order = sorted(range(len(errors)), key=lambda i: (errors[i], -speeds[i], i))
    kept: list[int] = []
    for i in order:
        if not kept or speeds[i] > (1 + margin) * speeds[kept[-1]]:
            kept.append(i)
    return kept
