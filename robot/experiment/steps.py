"""Plans as programs: generators that request presses, and get the recordings back.

    def plan():
        yield from press(2)
        for speed in ("0.05 m/s", "0.1 m/s"):
            made = yield from press(3, jack_speed=speed)

A plan must request the same again when it runs again with the same recordings and answers: an
interrupted session continues by running its plan from the start, and takes the presses from the
folder that are made already.
"""

from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.plan_table import Row


@dataclass(frozen=True)
class Step:
    """A request for equal presses."""

    repeats: int = 1
    values: Mapping[str, Any] = field(default_factory=dict)
    """Values that differ from the session's rig, as `Rig.with_values` takes them."""
    notes: str = ""


@dataclass(frozen=True)
class Ask:
    """A request to the operator."""

    text: str
    stand_in: str = ""
    """Answer of the stand-in."""


Plan = Generator[Step | Row | Ask, Any, Any]
"""A plan; it is sent the list of recordings for a `Step` or `Row`, and a text for an `Ask`."""


def press(
    n: int = 1, values: Mapping[str, Any] | None = None, /, *, notes: str = "", **named: Any
) -> Plan:
    """Press n times; return the recordings.

    Args:
        n: Number of presses.
        values: Values that differ from the session's rig, by dotted key.
        notes: The operator's, for these recordings.
        named: Values by the last part of their key: `jack_speed="0.1 m/s"`.
    """
    return (yield Step(n, {**(values or {}), **named}, notes))


def scan(name: str, over: Iterable[Any], n: int = 1, /, *, notes: str = "", **named: Any) -> Plan:
    """Press n times at each value of one quantity; return the recordings of each value.

    Args:
        name: Key of the rig's value, dotted or its last part.
        over: Texts with units, or numbers in SI units.
        n: Number of presses at each.
        notes: The operator's.
        named: Further values, the same at all.
    """
    made = []
    for value in over:
        made.append((yield Step(n, {**named, name: value}, notes)))
    return made


def repeat_until(
    enough: Callable[[Sequence[Any]], bool],
    /,
    most: int,
    *,
    least: int = 1,
    notes: str = "",
    **named: Any,
) -> Plan:
    """Press until a criterion holds; return the recordings.

    Args:
        enough: Gets all recordings so far, and returns whether they suffice.
        most: Number of presses after which it always ends.
        least: Number of presses before the criterion is asked.
        notes: The operator's.
        named: Values that differ from the session's rig.
    """
    made: list[Any] = []
    while len(made) < most and (len(made) < least or not enough(made)):
        made += yield Step(1, named, notes)
    return made


def ask(text: str, /, *, stand_in: str = "") -> Plan:
    """Ask the operator with the motors off; return the answer, which is saved with the session.

    Args:
        text: The question. `answers` of the session may answer it in advance.
        stand_in: Answer of the stand-in, where there is no terminal to ask at.
    """
    return (yield Ask(text, stand_in))


def of_rows(rows: Iterable[Row]) -> Plan:
    """Return the plan of a table: its rows in order."""
    for row in rows:  # noqa: UP028 (an iterator has no `send`)
        yield row


def plan_of(what: "Plan | Callable[[], Plan]") -> Plan:
    """Return a plan, given as a generator or as the function that returns it.

    Raises:
        RobotError: It is neither.
    """
    plan = what() if callable(what) else what
    if not isinstance(plan, Generator):
        raise RobotError(
            f"session: {what!r} is no plan; give a number of presses, a plan table, or a function"
            " with `yield from press(...)`"
        )
    return plan
