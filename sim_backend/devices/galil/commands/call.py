"""A command with its arguments, parsed and checked against the reference's table."""

from collections.abc import Callable
from dataclasses import dataclass, field

from sautereau.sim_backend.devices.galil.answers import CommandError
from sautereau.sim_backend.devices.galil.grammar import (
    QUERY,
    evaluate,
    named_axes,
    parse_axes,
    parse_list,
    split_arguments,
)
from sautereau.sim_backend.devices.galil.machine import Machine
from sautereau.sim_backend.devices.galil.program import Thread
from sautereau.sim_backend.devices.galil.reference import Entry

_SCALED = {"AC": 2, "DC": 2, "SD": 2, "SP": 1, "JG": 1, "HV": 1}
"""Power of 1000/TM by which a resolution grows."""
_BEGINS = ("BG", "BT")
_UNSIGNED = ("SP",)  # Commands that take a negative value as its absolute one


@dataclass
class Call:
    """A command as its handler receives it."""

    entry: Entry
    text: str
    """Arguments as sent."""
    thread: Thread | None
    """Thread of the program that gave the command; None for the host."""
    axes: list[int] = field(default_factory=list)
    """Axes that a mask names."""
    values: dict[int, float | None] = field(default_factory=dict)
    """Numbers by axis; None for a query."""
    numbers: list[float | None] = field(default_factory=list)
    """Arguments in order; None where one is omitted."""
    query: bool = False
    """Whether an argument is a question mark."""

    @property
    def code(self) -> str:
        """Letters of the command."""
        return self.entry.code

    @property
    def given(self) -> list[tuple[int, float]]:
        """The numbers that are set, by axis."""
        return [(index, value) for index, value in self.values.items() if value is not None]

    @property
    def asked(self) -> list[int]:
        """The axes of which a number is asked."""
        return [index for index, value in self.values.items() if value is None]

    def number(self, index: int = 0) -> float:
        """Return an argument or its default.

        Raises:
            CommandError: It is omitted and has no default.
        """
        given = self.numbers[index] if index < len(self.numbers) else None
        if given is None:
            given = self.entry.arguments[index].default
        if given is None:
            raise CommandError(50)
        return given


Handler = Callable[[Machine, Call], str | None]  # Carries out a command; returns the answer


def parse_call(machine: Machine, entry: Entry, text: str, thread: Thread | None) -> Call:
    """Parse a command's arguments, and check validity, ranges and motion.

    Raises:
        CommandError: It is refused.
    """
    if thread is None and not entry.in_terminal:
        raise CommandError(2)
    if thread is not None and not entry.in_program:
        raise CommandError(3)
    call = Call(entry, text, thread)
    if entry.form == "mask":
        call.axes = parse_axes(named_axes(machine, text), machine)
        _check_rest(machine, entry, call.axes)
    elif entry.form == "values":
        values = parse_list(text, machine)
        call.values = values
        call.query = bool(call.asked)
        _check_rest(machine, entry, [axis for axis, _ in call.given])
        scale = (1000 / machine.config["TM"][0]) ** _SCALED.get(entry.code, 0)
        for axis, value in call.given:
            value = abs(value) if entry.code in _UNSIGNED else value
            values[axis] = entry.arguments[0].accept(value, scale)
    else:
        if entry.form == "none" and text:
            raise CommandError(4)
        if entry.form == "numbers":
            _parse_numbers(machine, call)
        if not call.query:
            _check_rest(machine, entry, range(len(machine.axes)))
    return call


def _check_rest(machine: Machine, entry: Entry, axes: range | list[int]) -> None:
    """Refuse a command that is not valid while an axis that it names moves."""
    if entry.in_motion:
        return
    for index in axes:
        axis = machine.axes[index]
        free = entry.code == "DC" and (axis.jogging or axis.stop_code > 1)
        if axis.profile is not None and not free:
            raise CommandError(21 if entry.code in _BEGINS else 7)


def _parse_numbers(machine: Machine, call: Call) -> None:
    parts = split_arguments(call.text)
    arguments = call.entry.arguments
    if len(parts) > len(arguments):
        raise CommandError(4)
    for part, argument in zip(parts, arguments, strict=False):
        call.query |= part == QUERY
        omitted = part in ("", QUERY)
        call.numbers.append(None if omitted else argument.accept(evaluate(part, machine)))
