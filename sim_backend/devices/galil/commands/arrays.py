"""Commands about arrays and the capture that fills them."""

import re
from collections.abc import Callable

from sautereau.sim_backend.devices.galil.answers import CommandError, write_number
from sautereau.sim_backend.devices.galil.commands.call import Call
from sautereau.sim_backend.devices.galil.commands.report import CONTROL_Z
from sautereau.sim_backend.devices.galil.grammar import QUERY, evaluate, parse_axes, split_arguments
from sautereau.sim_backend.devices.galil.machine import Machine
from sautereau.sim_backend.devices.galil.operands import AXIS_OPERANDS, variable, whole
from sautereau.sim_backend.devices.galil.ports import Download


def _recorded_torque(machine: Machine, axis: int) -> float:
    volts = machine.plant.torque_volts()[axis]
    return volts if machine.unit.recorded_torque == "volts" else round(volts / 10 * 32_767)  # 10 V


_AXIS_SOURCES: dict[str, Callable[[Machine, int], float]] = {
    **{code: AXIS_OPERANDS[code] for code in ("TP", "RP", "TE", "TD", "DE", "SC", "RL")},
    "SH": AXIS_OPERANDS["RP"],
    "AF": lambda machine, axis: 0,
    "TS": lambda machine, axis: int(AXIS_OPERANDS["TS"](machine, axis)) & 0b11111,
    "TT": _recorded_torque,
    "TV": lambda machine, axis: int(machine.axes[axis].filtered_speed * 64),
}
_SOURCES: dict[str, Callable[[Machine], float]] = {
    "TIME": lambda machine: variable(machine, "TIME"),
    "_OP": lambda machine: machine.outputs.value,
    "_TI": lambda machine: machine.input_bits,
}


def define(machine: Machine, call: Call) -> str | None:
    """DM: define arrays of zeros, ``X[100],Y[100]``."""
    if call.text == QUERY:
        return write_number(machine.arrays.free, 0)
    sizes = {
        name: whole(evaluate(size, machine), -(2**31), 2**31)
        for name, size in _array_names(call.text).items()
    }
    _check_free(machine)
    machine.arrays.define(sizes)
    return None


def remove(machine: Machine, call: Call) -> str | None:
    """DA: free arrays, ``X[]`` or ``*[]``, and variables, ``x`` or ``*``."""
    if call.text == QUERY:
        return write_number(machine.arrays.unused, 0)
    names = split_arguments(call.text)
    variables = {name for name in names if "[" not in name}
    bracketed = ",".join(name for name in names if "[" in name)
    arrays = _array_names(bracketed) if bracketed else {}
    if arrays:
        _check_free(machine)
    for name in variables - {"*"}:
        variable(machine, name)
    if arrays:
        machine.arrays.remove(set(arrays))
        machine.capture.arrays = []
    for name in list(machine.variables) if "*" in variables else variables:
        machine.variables.pop(name, None)
    return None


def record_into(machine: Machine, call: Call) -> None:
    """RA: choose the arrays into which to record."""
    arrays = [_transferred(machine, name) for name in _array_names(call.text)]
    _check_free(machine, len(arrays))
    machine.capture.arrays = arrays


def record_data(machine: Machine, call: Call) -> None:
    """RD: choose the quantities to record into them."""
    sources = [_source(machine, part) for part in split_arguments(call.text)]
    _check_free(machine, len(sources))
    machine.capture.sources = sources


def _check_free(machine: Machine, recorded: int = 0) -> None:
    """Refuse a command while a capture runs, or to record so much at once."""
    if machine.capture.running:
        raise CommandError(80)
    if recorded > 8:
        raise CommandError(4)


def _source(machine: Machine, text: str) -> Callable[[], float]:
    if text in _SOURCES:
        of_machine = _SOURCES[text]
        return lambda: of_machine(machine)
    code, axis = text[1:3], text[3:]
    if not text.startswith("_") or code not in _AXIS_SOURCES:
        raise CommandError(81)
    if len(axis) != 1:
        raise CommandError(58)
    (index,) = parse_axes(axis, machine)
    value = _AXIS_SOURCES[code]
    return lambda: value(machine, index)


def record(machine: Machine, call: Call) -> str | None:
    """RC n,m: record m times every 2^n samples, from the next sample on; RC 0 stops."""
    if call.query:
        return write_number(machine.capture.running, 0)
    exponent = int(call.number(0))
    if exponent == 0:
        machine.capture.stop()
    else:
        machine.capture.start(exponent, int(call.number(1)))
    return None


def upload(machine: Machine, call: Call) -> str:
    """QU name[],first,last,comma: an array, its elements separated by returns or commas."""
    array, *rest = split_arguments(call.text)
    (name,) = _array_names(array)
    values = _transferred(machine, name)
    if len(rest) > 3:
        raise CommandError(4)
    comma = whole(evaluate(rest[2], machine), 0, 1) if rest[2:] and rest[2] else 0
    first, last = _piece(machine, rest[:2], values)
    text = ("," if comma else "\r").join(map(write_number, values[first : last + 1]))
    return text + (CONTROL_Z if machine.unit.control_z == "attached" else "\r\n" + CONTROL_Z)


def download(machine: Machine, call: Call) -> None:
    """QD name[],first,last: read the elements that follow, separated by commas or returns."""
    array, *rest = split_arguments(call.text)
    (name,) = _array_names(array)
    values = _transferred(machine, name)
    _check_free(machine)
    first, last = _piece(machine, rest, values)

    def store(text: str) -> None:
        numbers = [evaluate(part, machine) for part in re.split("[,\r]+", text.strip("\r"))]
        if len(numbers) > last + 1 - first:
            raise CommandError(84)
        values[first : first + len(numbers)] = numbers

    machine.ports[machine.port].download = Download(store)


def _piece(machine: Machine, parts: list[str], values: list[float]) -> tuple[int, int]:
    """Return the first and the last index of a piece of an array; it has two elements or more."""
    if len(parts) > 2:
        raise CommandError(4)
    first, last = [
        whole(evaluate(part, machine), 0, 2**31) if part else default
        for part, default in zip([*parts, "", ""], (0, len(values) - 1), strict=False)
    ]
    if not first < last < len(values):
        raise CommandError(56)
    return first, last


def _transferred(machine: Machine, name: str) -> list[float]:
    values = machine.arrays.values(name)
    if len(name) > 7:  # Characters
        raise CommandError(57)
    return values


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
