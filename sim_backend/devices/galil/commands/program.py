"""Commands about programs: download, run, jump, branch, wait."""

from sautereau.sim_backend.devices.galil.answers import CommandError
from sautereau.sim_backend.devices.galil.commands.call import Call
from sautereau.sim_backend.devices.galil.commands.report import write_variable
from sautereau.sim_backend.devices.galil.commands.settings import BURN_TIME
from sautereau.sim_backend.devices.galil.grammar import evaluate, parse_assignment, split_arguments
from sautereau.sim_backend.devices.galil.machine import Machine
from sautereau.sim_backend.devices.galil.motion import StopCode
from sautereau.sim_backend.devices.galil.operands import whole
from sautereau.sim_backend.devices.galil.ports import Download
from sautereau.sim_backend.devices.galil.program import Program, Thread
from sautereau.sim_backend.devices.galil.tasks import THREADS


def assign(machine: Machine, text: str) -> str | None:
    """Carry out ``name=value``, ``name[index]=value`` or the query ``name=?``.

    Returns:
        The answer to a query, empty for an assignment; None if it is neither.
    """
    parts = parse_assignment(text)
    if parts is None:
        return None
    name, index, value = parts
    place = None if index is None else evaluate(index, machine)
    if value.strip(" ") in ("", "?"):
        if place is not None:
            return write_variable(machine, machine.arrays.element(name, place))
        return write_variable(machine, evaluate(name, machine))
    result = evaluate(value, machine)
    if name.startswith("~"):
        axis = machine.letters.find(value.strip(' "')) if '"' in value else int(result)
        machine.variable_axes[name] = whole(axis, 0, len(machine.letters) - 1)
    elif place is None:
        machine.set_variable(name, result)
    else:
        machine.arrays.set_element(name, place, result)
    return ""


def no_operation(machine: Machine, call: Call) -> None:
    """Do nothing: NO starts a comment, ENDIF ends a branch."""


def download(machine: Machine, call: Call) -> None:
    """DL: read the following lines as the program, from a line or label on or, for #, its end."""
    if machine.tasks.threads:
        raise CommandError(17)
    lines, place = machine.program.lines, call.text
    if place.startswith("#"):
        first = len(lines) if place == "#" else machine.program.line_of(place)
    else:
        first = whole(evaluate(place, machine), 0, len(lines)) if place else 0

    def store(text: str) -> None:
        machine.program = Program()  # what remains after an error
        machine.program = Program.parse(text, machine.limits)

    kept = "".join(f"{line}\r" for line in lines[:first])
    machine.ports[machine.port].download = Download(store, kept)


def edit(machine: Machine, call: Call) -> None:
    """ED: the line editor is not emulated."""
    raise CommandError(17 if machine.tasks.threads else 141)


def burn(machine: Machine, call: Call) -> None:
    """BP: store the program so that it survives power-off."""
    machine.memory.program = machine.program
    machine.occupy(2 * BURN_TIME)


def run(machine: Machine, call: Call) -> None:
    """XQ: run the program from a label, in a thread."""
    place, *rest = split_arguments(call.text)
    if len(rest) > 1:
        raise CommandError(4)
    number = whole(evaluate(rest[0], machine), 0, THREADS - 1) if rest else 0
    threads = machine.tasks.threads
    if number in threads:
        raise CommandError(19)
    line = machine.program.line_of(place)
    threads[number] = Thread(machine.program, line, hosted=call.thread is None)


def halt(machine: Machine, call: Call) -> None:
    """HX: end a thread, or all of them."""
    machine.tasks.halt([int(call.number())] if call.text else range(THREADS))


def _of_program(call: Call) -> Thread:
    """Return the thread of a command that the table allows in programs only."""
    if call.thread is None:
        raise CommandError(2)
    return call.thread


def end(machine: Machine, call: Call) -> None:
    """EN: return from a subroutine, or end the thread."""
    _of_program(call).end(keep_trip_point=call.number(0) == 1)


def end_error(machine: Machine, call: Call) -> None:
    """RE: return from the automatic subroutine of an error; with 1 its trip point continues."""
    _of_program(call).end_error(keep_trip_point=call.number() == 1)


def clear_stack(machine: Machine, call: Call) -> None:
    """ZS: forget where subroutines return to; with 1 only the innermost."""
    _of_program(call).clear_stack(1 if call.number() == 1 else 16)


def jump(machine: Machine, call: Call) -> None:
    """JP: continue at a label, if the condition holds."""
    line = _destination(machine, call)
    if line is not None:
        _of_program(call).jump(line)


def call(machine: Machine, call: Call) -> None:
    """JS: run a subroutine, if the condition holds; it takes no arguments here."""
    line = _destination(machine, call)
    if line is not None:
        _of_program(call).call(line)


def branch(machine: Machine, call: Call) -> None:
    """IF: continue after ELSE or ENDIF if the condition does not hold."""
    if not evaluate(call.text, machine):
        _of_program(call).skip("ELSE", "ENDIF")


def otherwise(machine: Machine, call: Call) -> None:
    """ELSE: the branch before it has run; continue after ENDIF."""
    _of_program(call).skip("ENDIF")


def after_motion(machine: Machine, call: Call) -> None:
    """AM: wait until the axes' profiles have ended."""
    axes = [machine.axes[index] for index in call.axes]
    _of_program(call).wait = lambda: all(axis.profile is None for axis in axes)


def motion_complete(machine: Machine, call: Call) -> None:
    """MC: wait until profiles have ended and encoders are there, or until TW has passed."""
    moving = [index for index in call.axes if machine.axes[index].profile is not None]
    ended: dict[int, int] = {}
    forward = {index: machine.axes[index].velocity >= 0 for index in moving}

    def complete() -> bool:
        for index in list(moving):
            axis = machine.axes[index]
            if axis.profile is not None:
                forward[index] = axis.velocity > 0 if axis.velocity else forward[index]
                continue
            since = machine.samples - ended.setdefault(index, machine.samples)
            error = machine.error(index)
            limit = axis.settings["TW"]
            if error <= 0 if forward[index] else error >= 0:
                moving.remove(index)
            elif 0 <= limit <= since:
                moving.remove(index)
                axis.stop_code = StopCode.NOT_IN_POSITION
                machine.tasks.raise_once("#MCTIME")
        return not moving

    _of_program(call).wait = complete


def wait(machine: Machine, call: Call) -> None:
    """WT n: wait n milliseconds of 1/1024 s, or n samples with a second argument of 1."""
    until = machine.samples + _samples(machine, call)
    _of_program(call).wait = lambda: machine.samples >= until


def at_time(machine: Machine, call: Call) -> None:
    """AT n: wait until n ms after the reference; 0 sets it, -n resets it at the end of the wait.

    Older firmware does not know the second argument, with which n is in samples.
    """
    if len(call.numbers) > 1 and not machine.unit.large_memory:
        raise CommandError(4)
    thread = _of_program(call)
    if call.number(0) == 0:
        thread.reference = machine.samples
        return
    after = _samples(machine, call)
    until = thread.reference + abs(after)
    late = until + (machine.samples * 40503 >> 5) % (machine.unit.at_jitter + 1)

    def reached() -> bool:
        if machine.samples < late:
            return False
        if after < 0:
            thread.reference = until
        return True

    thread.wait = reached


def _samples(machine: Machine, call: Call) -> int:
    """Return the duration of WT or AT in samples; by default it is scaled by TM."""
    scale = 1 if call.number(1) == 1 else 1000 / machine.config["TM"][0]
    return round(call.number(0) * scale)


def after_input(machine: Machine, call: Call) -> None:
    """AI n: wait for input n to be high, or low for -n."""
    number = int(call.number())
    if number == 0:
        raise CommandError(6)
    inputs = machine.inputs
    _of_program(call).wait = lambda: inputs[abs(number) - 1] == (number > 0)


def _destination(machine: Machine, call: Call) -> int | None:
    """Return the line to which JP or JS goes; None if its condition does not hold."""
    place, *condition = split_arguments(call.text)
    if len(condition) > 1:
        raise CommandError(4)
    if not place:
        raise CommandError(50)
    line = whole(evaluate(place, machine), 0, 9999)
    if line >= machine.limits.lines:
        raise CommandError(11)
    return line if not condition or evaluate(condition[0], machine) else None
