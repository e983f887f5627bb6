"""Commands about programs: download, run, jump, branch, wait."""

from sautereau.sim_backend.devices.galil.faults import CommandError
from sautereau.sim_backend.devices.galil.grammar import (
    LARGEST_NUMBER,
    evaluate,
    integers,
    parse_assignment,
    parse_axes,
    split_arguments,
)
from sautereau.sim_backend.devices.galil.machine import INPUTS, Machine
from sautereau.sim_backend.devices.galil.operands import whole
from sautereau.sim_backend.devices.galil.program import THREADS, Thread


def assign(machine: Machine, text: str) -> bool:
    """Carry out ``name=value`` or ``name[index]=value``; return whether it is one."""
    parts = parse_assignment(text)
    if parts is None:
        return False
    name, index, value = parts
    result = evaluate(value, machine)
    if index is None:
        machine.set_variable(name, result)
    else:
        machine.arrays.set_element(name, evaluate(index, machine), result)
    return True


def download(machine: Machine, args: str, thread: Thread | None) -> None:
    """DL: read the following lines as the program."""
    if args:
        raise CommandError(4)
    if machine.threads:
        raise CommandError(17)
    machine.download = ""


def list_program(machine: Machine, args: str, thread: Thread | None) -> str:
    """LS: print the program with its line numbers."""
    return "\r\n".join(f"{number} {line}" for number, line in enumerate(machine.program.lines))


def burn(machine: Machine, args: str, thread: Thread | None) -> None:
    """BP: store the program so that it survives power-off."""
    if machine.threads:
        raise CommandError(17)
    machine.burned = machine.program


def reset(machine: Machine, args: str, thread: Thread | None) -> None:
    """RS: reset as by switching off and on; ``#AUTO`` of the stored program runs."""
    machine.power_up()


def run(machine: Machine, args: str, thread: Thread | None) -> None:
    """XQ: run the program from a label, in a thread."""
    place, *rest = split_arguments(args)
    (number,) = integers(machine, ",".join(rest), (0, THREADS - 1)) if rest else (0,)
    if number in machine.threads:
        raise CommandError(19)
    line = machine.program.line_of(place)
    machine.threads[number] = Thread(machine.program, line, hosted=thread is None)


def halt(machine: Machine, args: str, thread: Thread | None) -> None:
    """HX: end a thread, or all of them."""
    numbers = integers(machine, args, (0, THREADS - 1)) if args else range(THREADS)
    machine.halt_threads(numbers)


def end(machine: Machine, args: str, thread: Thread) -> None:
    """EN: return from a subroutine, or end the thread."""
    thread.end()


def end_of_error(machine: Machine, args: str, thread: Thread) -> None:
    """RE: return from #POSERR; with 1 the interrupted trip point continues."""
    (keep,) = integers(machine, args or "0", (0, 1))
    thread.end_interrupt(keep_trip_point=bool(keep))


def jump(machine: Machine, args: str, thread: Thread) -> None:
    """JP: continue at a label, if the condition holds."""
    place, holds = _conditional(machine, args)
    if holds:
        thread.jump(place)


def call(machine: Machine, args: str, thread: Thread) -> None:
    """JS: run a subroutine, if the condition holds."""
    place, holds = _conditional(machine, args)
    if holds:
        thread.call(place)


def branch(machine: Machine, args: str, thread: Thread) -> None:
    """IF: continue after ELSE or ENDIF if the condition does not hold."""
    if not evaluate(args, machine):
        thread.skip("ELSE", "ENDIF")


def otherwise(machine: Machine, args: str, thread: Thread) -> None:
    """ELSE: the branch before it has run; continue after ENDIF."""
    thread.skip("ENDIF")


def end_branch(machine: Machine, args: str, thread: Thread) -> None:
    """ENDIF: do nothing."""


def after_motion(machine: Machine, args: str, thread: Thread) -> None:
    """AM: wait until the axes' profiles have ended."""
    axes = [machine.axes[index] for index in parse_axes(args)]
    thread.wait = lambda: all(axis.profile is None for axis in axes)


def wait(machine: Machine, args: str, thread: Thread) -> None:
    """WT n: wait n samples; at TM 1000 they are the manual's milliseconds of 1/1024 s."""
    until = machine.samples + integers(machine, args, (0, LARGEST_NUMBER - 1), (0, 1))[0]
    thread.wait = lambda: machine.samples >= until


def at_time(machine: Machine, args: str, thread: Thread) -> None:
    """AT n: wait until n samples after the reference; 0 sets it, -n advances it by n."""
    limits = (1 - LARGEST_NUMBER, LARGEST_NUMBER - 1), (0, 1)
    after = integers(machine, args, *limits)[0]
    if after == 0:
        thread.reference = machine.samples
        return
    until = thread.reference + abs(after)
    if after < 0:
        thread.reference = until
    thread.wait = lambda: machine.samples >= until


def after_input(machine: Machine, args: str, thread: Thread) -> None:
    """AI n: wait for input n to be high, or low for -n."""
    (number,) = integers(machine, args, (-INPUTS, INPUTS))
    if number == 0:
        raise CommandError(6)
    thread.wait = lambda: machine.inputs[abs(number) - 1] == (number > 0)


def _conditional(machine: Machine, args: str) -> tuple[str, bool]:
    place, *condition = split_arguments(args)
    if len(condition) > 1:
        raise CommandError(4)
    if place.startswith(("(", "_")) or (place and place[0].isdigit()):
        place = str(whole(evaluate(place, machine), 0, 9999))
    return place, not condition or bool(evaluate(condition[0], machine))
