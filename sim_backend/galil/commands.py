"""The command table, and the commands about programs, outputs and messages."""

from collections.abc import Callable

from sim_backend.galil import array_commands as arrays
from sim_backend.galil import motion_commands as motion
from sim_backend.galil.axis import SETTINGS
from sim_backend.galil.faults import TEXTS, CommandError
from sim_backend.galil.grammar import (
    LARGEST_NUMBER,
    evaluate,
    parse_axes,
    split_arguments,
    write_number,
)
from sim_backend.galil.machine import INPUTS, OUTPUTS, Machine
from sim_backend.galil.operands import Operands, integers
from sim_backend.galil.program import THREADS, Thread

Command = Callable[[Machine, str, Thread | None], str | None]
"""Carries out a command, given its arguments and, in a program, its thread; returns the answer."""


def execute(machine: Machine, text: str, thread: Thread | None = None) -> str | None:
    """Carry out one command of the host's or of a program's; return its answer, if it has one.

    Raises:
        CommandError: It is refused; nothing has changed.
    """
    if text == "\x12\x16":
        return machine.revision
    if text.startswith("'") or (thread is not None and text.startswith("#")):
        return None
    code, args = text[:2], text[2:].strip(" ")
    if code not in COMMANDS:
        raise CommandError(1)
    if thread is None and code in PROGRAM_ONLY:
        raise CommandError(2)
    if thread is not None and code in HOST_ONLY:
        raise CommandError(3)
    return COMMANDS[code](machine, args, thread)


def execute_in_program(machine: Machine, text: str, thread: Thread) -> None:
    """Carry out one command of a program; what it says goes to whoever reads next."""
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


def _download(machine: Machine, args: str, thread: Thread | None) -> None:
    if args:
        raise CommandError(4)
    if machine.threads:
        raise CommandError(17)
    machine.download = ""


def _list(machine: Machine, args: str, thread: Thread | None) -> str:
    return "\r\n".join(f"{number} {line}" for number, line in enumerate(machine.program.lines))


def _run(machine: Machine, args: str, thread: Thread | None) -> None:
    place, *rest = split_arguments(args)
    (number,) = integers(machine, ",".join(rest), (0, THREADS - 1)) if rest else (0,)
    if number in machine.threads:
        raise CommandError(19)
    machine.threads[number] = Thread(machine.program, machine.program.line_of(place))


def _halt(machine: Machine, args: str, thread: Thread | None) -> None:
    numbers = integers(machine, args, (0, THREADS - 1)) if args else range(THREADS)
    machine.halt_threads(numbers)


def _end(machine: Machine, args: str, thread: Thread | None) -> None:
    if thread is not None:
        thread.running = False


def _after_motion(machine: Machine, args: str, thread: Thread | None) -> None:
    axes = [machine.axes[index] for index in parse_axes(args)]
    if thread is not None:
        thread.wait = lambda: all(axis.profile is None for axis in axes)


def _wait(machine: Machine, args: str, thread: Thread | None) -> None:
    """WT n: wait n samples; at TM 1000 those are the milliseconds of 1/1024 s of the manual."""
    until = machine.samples + integers(machine, args, (0, LARGEST_NUMBER - 1), (0, 1))[0]
    if thread is not None:
        thread.wait = lambda: machine.samples >= until


def _after_input(machine: Machine, args: str, thread: Thread | None) -> None:
    (number,) = integers(machine, args, (-INPUTS, INPUTS))
    if number == 0:
        raise CommandError(6)
    if thread is not None:
        thread.wait = lambda: machine.inputs[abs(number) - 1] == (number > 0)


def _no_operation(machine: Machine, args: str, thread: Thread | None) -> None:
    """Do nothing: NO begins a comment."""


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
    "DL": _download,
    "LS": _list,
    "XQ": _run,
    "HX": _halt,
    "EN": _end,
    "AM": _after_motion,
    "WT": _wait,
    "AI": _after_input,
    "NO": _no_operation,
}
"""Every command by its two letters."""

PROGRAM_ONLY = frozenset({"EN", "AM", "WT", "AI"})
"""Commands that the host may not give."""

HOST_ONLY = frozenset({"DL", "LS", "QU", "EO"})
"""Commands that a program may not give."""
