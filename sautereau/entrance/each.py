"""Work on several files, of which some may be faulty."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from sautereau.rig.errors import SautereauError
from sautereau.rig.progress import tracked

Item = TypeVar("Item")
Result = TypeVar("Result")


def each(
    items: Sequence[Item], work: Callable[[Item], Result]
) -> tuple[list[Result], list[tuple[Item, SautereauError]]]:
    """Do some work on every item; return the results, and the items without one with their errors.

    Raises:
        SautereauError: No item has a result: that of the first, with the others as notes.
    """
    results: list[Result] = []
    faults: list[tuple[Item, SautereauError]] = []
    for item in tracked(items):
        try:
            results.append(work(item))
        except SautereauError as error:
            faults.append((item, error))
    if faults and not results:
        raise _together(faults)
    return results, faults


def every(items: Sequence[Item], work: Callable[[Item], Result]) -> list[Result]:
    """Do some work on every item, and return the results.

    Raises:
        SautereauError: Of the first item without a result, with those of the others as notes.
    """
    results, faults = each(items, work)
    if faults:
        raise _together(faults)
    return results


def _together(faults: Sequence[tuple[object, SautereauError]]) -> SautereauError:
    first = faults[0][1]
    for _, error in faults[1:]:
        first.add_note(str(error))
    return first
