"""The command table, and the commands about outputs and messages."""

from collections.abc import Callable

from sautereau.sim_backend.devices.galil.axis import SETTINGS
from sautereau.sim_backend.devices.galil.commands import arrays, motion
from sautereau.sim_backend.devices.galil.commands import program as programs
from sautereau.sim_backend.devices.galil.faults import TEXTS, CommandError
from sautereau.sim_backend.devices.galil.grammar import (
    evaluate,
    split_arguments,
    write_number,
)
from sautereau.sim_backend.devices.galil.machine import OUTPUTS, Machine
from sautereau.sim_backend.devices.galil.operands import Operands, integers
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
    if code not in COMMANDS:
        if programs.assign(machine, text):
            return None
        raise CommandError(1)
    if thread is None and code in PROGRAM_ONLY:
        raise CommandError(2)
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
    names, answer = Operands(machine), ""
    for part in split_arguments(args):
        if "{" in part and not part.startswith('"'):
            raise CommandError(53)
        if len(part) > 1 and part[0] == part[-1] == '"' and part.count('"') == 2:
            answer += part[1:-1]
        else:
            number = write_number(evaluate(part, names))
            answer += number if number.startswith(" ") or not answer else " " + number
    return answer


def _set_bit(machine: Machine, args: str, thread: Thread | None) -> None:
    machine.set_output(integers(machine, args, (1, OUTPUTS))[0], True)


def _clear_bit(machine: Machine, args: str, thread: Thread | None) -> None:
    machine.set_output(integers(machine, args, (1, OUTPUTS))[0], False)


def _output_port(machine: Machine, args: str, thread: Thread | None) -> None:
    (levels,) = integers(machine, args, (0, 2**OUTPUTS - 1))
    for number in range(1, OUTPUTS + 1):
        machine.set_output(number, bool(levels >> (number - 1) & 1))


def _tell_inputs(machine: Machine, args: str, thread: Thread | None) -> str:
    return write_number(sum(level << bit for bit, level in enumerate(machine.inputs)), 0)


def _no_operation(machine: Machine, args: str, thread: Thread | None) -> None:
    """Do nothing: NO starts a comment."""


def _of(function: Callable[[Machine, str, str], str | None], name: str) -> Command:
    return lambda machine, args, thread: function(machine, name, args)


COMMANDS: dict[str, Command] = {
    **{name: _of(motion.setting, name) for name in SETTINGS},
    **{name: _of(motion.tell, name) for name in ("TP", "RP", "TE", "TD", "TT", "TS", "SC")},
    **{name: _of(motion.aim, name) for name in ("PA", "PR", "JG")},
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
    "SB": _set_bit,
    "CB": _clear_bit,
    "OP": _output_port,
    "TI": _tell_inputs,
    "DM": arrays.define,
    "DA": arrays.remove,
    "RA": arrays.record_arrays,
    "RD": arrays.record_data,
    "RC": arrays.record,
    "QU": arrays.upload,
    "DL": programs.download,
    "LS": programs.list_program,
    "XQ": programs.run,
    "HX": programs.halt,
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
    "BP": programs.burn,
    "RS": programs.reset,
    "NO": _no_operation,
}
"""Every command by its two letters; ELSE and ENDIF by their words."""

PROGRAM_ONLY = frozenset({"EN", "AM", "WT", "AI", "AT", "JP", "JS", "IF", "ELSE", "ENDIF", "RE"})
"""Commands that the host may not give."""

HOST_ONLY = frozenset({"DL", "LS", "QU", "EO", "BP", "RS"})
"""Commands that a program may not give."""
