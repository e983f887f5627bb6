"""The command table, and the commands about arrays, the capture, outputs and messages."""

import re
from collections.abc import Callable

from sautereau.sim_backend.devices.galil.axis import SETTINGS
from sautereau.sim_backend.devices.galil.commands import motion
from sautereau.sim_backend.devices.galil.commands import program as programs
from sautereau.sim_backend.devices.galil.faults import TEXTS, CommandError
from sautereau.sim_backend.devices.galil.grammar import (
    LARGEST_NUMBER,
    evaluate,
    integers,
    parse_axes,
    split_arguments,
    write_number,
)
from sautereau.sim_backend.devices.galil.machine import OUTPUTS, Machine
from sautereau.sim_backend.devices.galil.operands import AXIS_OPERANDS, OPERANDS, whole
from sautereau.sim_backend.devices.galil.program import Thread

Command = Callable[[Machine, str, Thread | None], str | None]
"""Carries out a command, given its arguments and, in a program, its thread; returns the answer."""


def execute(machine: Machine, text: str, thread: Thread | None = None) -> str | None:
    """Carry out one command of the host or of a program; return its answer, if it has one.

    Raises:
        CommandError: It is refused; nothing has changed.
    """
    if text == "\x12\x16":
        return machine.revision
    if text.startswith("'") or (thread is not None and text.startswith("#")):
        return None
    code = text if text in ("ELSE", "ENDIF") else text[:2]
    args = text[len(code) :].strip(" ")
    if code in PROGRAM_COMMANDS:
        if thread is None:
            raise CommandError(2)
        return PROGRAM_COMMANDS[code](machine, args, thread)
    if code not in COMMANDS:
        if programs.assign(machine, text):
            return None
        raise CommandError(1)
    if thread is not None and code in HOST_ONLY:
        raise CommandError(3)
    return COMMANDS[code](machine, args, thread)


def execute_in_program(machine: Machine, text: str, thread: Thread) -> None:
    """Carry out one command of a program; its answer is sent with the host's next read."""
    answer = execute(machine, text, thread)
    if answer is not None:
        machine.unsolicited += answer + "\r\n"


def _echo(machine: Machine, args: str, thread: Thread | None) -> None:
    (level,) = integers(machine, args, (0, 1))
    machine.echo = bool(level)


def _tell_code(machine: Machine, args: str, thread: Thread | None) -> str:
    (form,) = integers(machine, args or "0", (0, 1))
    code, machine.error_code = machine.error_code, 0
    return f"{code} {TEXTS[code]}".rstrip() if form else str(code)


def _sample_time(machine: Machine, args: str, thread: Thread | None) -> str | None:
    if args == "?":
        return write_number(machine.sample_time, 0)
    (machine.sample_time,) = integers(machine, args, (125, 20_000))
    return None


def _message(machine: Machine, args: str, thread: Thread | None) -> str:
    answer = ""
    for part in split_arguments(args):
        if "{" in part and not part.startswith('"'):
            raise CommandError(53)
        if len(part) > 1 and part[0] == part[-1] == '"' and part.count('"') == 2:
            answer += part[1:-1]
        else:
            number = write_number(evaluate(part, machine))
            answer += number if number.startswith(" ") or not answer else " " + number
    return answer


def _set_bit(machine: Machine, name: str, args: str) -> None:
    machine.set_output(integers(machine, args, (1, OUTPUTS))[0], name == "SB")


def _output_port(machine: Machine, args: str, thread: Thread | None) -> None:
    (levels,) = integers(machine, args, (0, 2**OUTPUTS - 1))
    for number in range(1, OUTPUTS + 1):
        machine.set_output(number, bool(levels >> (number - 1) & 1))


def _tell_inputs(machine: Machine, args: str, thread: Thread | None) -> str:
    return write_number(OPERANDS["TI"](machine), 0)


def _define_arrays(machine: Machine, args: str, thread: Thread | None) -> None:
    """DM: define arrays of zeros, ``X[100],Y[100]``."""
    sizes = {
        name: whole(evaluate(size, machine), -LARGEST_NUMBER, LARGEST_NUMBER)
        for name, size in _array_names(args).items()
    }
    machine.arrays.define(sizes)


def _remove_arrays(machine: Machine, args: str, thread: Thread | None) -> None:
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


def _record_arrays(machine: Machine, args: str, thread: Thread | None) -> None:
    """RA: choose the arrays into which to record."""
    arrays = [machine.arrays.values(name) for name in _array_names(args)]
    if machine.capture.running:
        raise CommandError(80)
    machine.capture.arrays = arrays


def _record_data(machine: Machine, args: str, thread: Thread | None) -> None:
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


def _record(machine: Machine, args: str, thread: Thread | None) -> None:
    """RC n,m: record m times every 2^n samples, from the next sample on; RC 0 stops."""
    exponent, *count = integers(machine, args, (0, 8), (-LARGEST_NUMBER, LARGEST_NUMBER))
    if exponent == 0:
        machine.capture.stop()
    else:
        machine.capture.start(exponent, *count)


def _upload(machine: Machine, args: str, thread: Thread | None) -> str:
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


def _no_operation(machine: Machine, args: str, thread: Thread | None) -> None:
    """Do nothing: NO starts a comment."""


def _of(function: Callable[[Machine, str, str], str | None], name: str) -> Command:
    return lambda machine, args, thread: function(machine, name, args)


COMMANDS: dict[str, Command] = {
    **{name: _of(motion.setting, name) for name in SETTINGS},
    **{name: _of(motion.tell, name) for name in ("TP", "RP", "TE", "TD", "TT", "TS", "SC")},
    **{name: _of(motion.aim, name) for name in ("PA", "PR", "JG")},
    **{name: _of(_set_bit, name) for name in ("SB", "CB")},
    "MO": motion.motor_off,
    "SH": motion.servo_here,
    "DP": motion.define_position,
    "DE": motion.define_auxiliary,
    "HM": motion.home,
    "BG": motion.begin,
    "PV": motion.segment,
    "BT": motion.begin_pvt,
    "ST": motion.stop,
    "AB": motion.abort,
    "EO": _echo,
    "TC": _tell_code,
    "TM": _sample_time,
    "MG": _message,
    "OP": _output_port,
    "TI": _tell_inputs,
    "DM": _define_arrays,
    "DA": _remove_arrays,
    "RA": _record_arrays,
    "RD": _record_data,
    "RC": _record,
    "QU": _upload,
    "DL": programs.download,
    "LS": programs.list_program,
    "XQ": programs.run,
    "HX": programs.halt,
    "BP": programs.burn,
    "RS": programs.reset,
    "NO": _no_operation,
}
"""Commands of the host and of programs, by their two letters."""

PROGRAM_COMMANDS: dict[str, Callable[[Machine, str, Thread], None]] = {
    "EN": programs.end,
    "AM": programs.after_motion,
    "WT": programs.wait,
    "AI": programs.after_input,
    "AT": programs.at_time,
    "JP": programs.jump,
    "JS": programs.call,
    "IF": programs.branch,
    "ELSE": programs.otherwise,
    "ENDIF": programs.end_branch,
    "RE": programs.end_of_error,
}
"""Commands that the host may not give, by their two letters; ELSE and ENDIF by their words."""

HOST_ONLY = frozenset({"DL", "LS", "QU", "EO", "BP", "RS"})
"""Commands that a program may not give."""
