"""Commands about arrays and the capture: DM, DA, RA, RD, RC, QU."""

import re
from collections.abc import Callable

from sautereau.sim_backend.devices.galil.faults import CommandError
from sautereau.sim_backend.devices.galil.grammar import (
    LARGEST_NUMBER,
    evaluate,
    parse_axes,
    split_arguments,
    whole,
    write_number,
)
from sautereau.sim_backend.devices.galil.machine import Machine
from sautereau.sim_backend.devices.galil.operands import AXIS_OPERANDS, Operands, integers
from sautereau.sim_backend.devices.galil.program import Thread


def define(machine: Machine, args: str, thread: Thread | None) -> None:
    """DM: define arrays of zeros, ``X[100],Y[100]``."""
    names = Operands(machine)
    sizes = {
        name: whole(evaluate(size, names), -LARGEST_NUMBER, LARGEST_NUMBER)
        for name, size in _array_names(args).items()
    }
    machine.arrays.define(sizes)


def remove(machine: Machine, args: str, thread: Thread | None) -> None:
    """DA: free the memory of arrays, ``X[]`` or ``*[]``."""
    names = _array_names(args)
    if machine.capture.running:
        raise CommandError(80)
    for name in names:
        if name != "*":
            machine.arrays.values(name)
    for name in names:
        machine.arrays.remove(name)
    machine.capture.arrays = []


def record_arrays(machine: Machine, args: str, thread: Thread | None) -> None:
    """RA: choose the arrays into which to record."""
    arrays = [machine.arrays.values(name) for name in _array_names(args)]
    if machine.capture.running:
        raise CommandError(80)
    machine.capture.arrays = arrays


def record_data(machine: Machine, args: str, thread: Thread | None) -> None:
    """RD: choose the quantities to record into them."""
    sources = [_source(machine, part) for part in split_arguments(args)]
    if machine.capture.running:
        raise CommandError(80)
    machine.capture.sources = sources


def _source(machine: Machine, text: str) -> Callable[[], float]:
    code, axis = text[1:3], text[3:]
    if not text.startswith("_") or code not in ("TP", "RP", "TE", "TD", "TT", "TS", "SC"):
        raise CommandError(81)
    if len(axis) != 1:
        raise CommandError(58)
    (index,) = parse_axes(axis)
    value = AXIS_OPERANDS[code]
    return lambda: value(machine, index)


def record(machine: Machine, args: str, thread: Thread | None) -> None:
    """RC n,m: record m times every 2^n samples, from the next sample on; RC 0 stops."""
    exponent, *count = integers(machine, args, (0, 8), (-LARGEST_NUMBER, LARGEST_NUMBER))
    if exponent == 0:
        machine.capture.stop()
    else:
        machine.capture.start(exponent, *count)


def upload(machine: Machine, args: str, thread: Thread | None) -> str:
    """QU name[],first,last,comma: print an array, one element per line or with commas."""
    array, *numbers = split_arguments(args)
    (name,) = _array_names(array)
    values = machine.arrays.values(name)
    bounds = integers(machine, ",".join(numbers), *[(0, LARGEST_NUMBER)] * 3) if numbers else []
    first, last, comma = (bounds + [0, len(values) - 1, 0][len(bounds) :])[:3]
    if not first <= last < len(values):
        raise CommandError(56)
    return ("," if comma else "\r\n").join(map(write_number, values[first : last + 1]))


def _array_names(args: str) -> dict[str, str]:
    """Return the text between the brackets of each ``NAME[...]``."""
    found = {}
    for part in split_arguments(args):
        array = re.fullmatch(r"([A-Za-z0-9]+|\*) *\[(.*)\]", part)
        if not array:
            raise CommandError(55 if part else 50)
        if array[1] in found:
            raise CommandError(57)
        found[array[1]] = array[2]
    return found
