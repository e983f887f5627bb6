"""Commands that report: positions, codes, lists, messages."""

import re
from collections.abc import Iterable

from sautereau.sim_backend.devices.emulators import SERIAL
from sautereau.sim_backend.devices.galil.answers import (
    TEXTS,
    CommandError,
    Unended,
    write_as,
    write_in,
    write_line,
    write_list,
    write_number,
)
from sautereau.sim_backend.devices.galil.commands.call import Call, Handler
from sautereau.sim_backend.devices.galil.grammar import evaluate, split_arguments
from sautereau.sim_backend.devices.galil.machine import Machine
from sautereau.sim_backend.devices.galil.operands import AXIS_OPERANDS, DATA_RECORD

CONTROL_Z = "\x1a"  # Ends what QU and UL upload

_POSITIONS = ("TP", "RP", "TE", "TD", "RL")
_FORMATS = re.compile(r"(?P<before>(?:\{[^}]*\} *)*)(?P<value>.*?)(?P<after>(?: *\{[^}]*\})*)")


def tell(machine: Machine, call: Call) -> str:
    """Report one number of each axis, positions in the format of PF."""
    value = AXIS_OPERANDS[call.code]
    numbers = [value(machine, index) for index in call.axes]
    if call.code not in _POSITIONS:
        return ",".join(write_number(number, 4 if call.code == "TT" else 0) for number in numbers)
    digits, decimals = map(int, machine.config["PF"])
    zeros = machine.config["LZ"][0] == 0
    return ",".join(write_in(number, digits, decimals, zeros=zeros) for number in numbers)


def write_variable(machine: Machine, value: float) -> str:
    """Return a variable or element as ``name=?`` reports it, in the format of VF."""
    digits, decimals = map(int, machine.config["VF"])
    return write_in(value, digits, decimals, zeros=machine.config["LZ"][0] == 0)


def tell_code(machine: Machine, call: Call) -> str:
    """TC: the code of the last refused command, which is then forgotten; with 1 also its text."""
    code, machine.error_code = machine.error_code, 0
    return f"{code} {TEXTS[code]}".rstrip() if call.number() else str(code)


def tell_status(machine: Machine, call: Call) -> str:
    """TB: the status byte."""
    status = machine.status_byte
    return f"{status:03d}" if machine.config["LZ"][0] == 0 else write_number(status, 0)


def tell_ports(machine: Machine, call: Call) -> str:
    """TZ: the inputs and outputs in blocks of 8, as bits from the highest."""
    blocks = (("input", machine.input_bits), ("output", machine.outputs.value))
    return "\r\n".join(
        f"Block 0 (8-1) dedicated as {kind} - value {bits} ({bits >> 4:04b}_{bits & 15:04b})"
        for kind, bits in blocks
    )


def identify(machine: Machine, call: Call) -> str:
    """ID: firmware and hardware."""
    unit = machine.unit
    lines = [f"FW, {unit.revision}", f"DMC, {unit.galil.family}, Rev 11"]
    if unit.amplifier != "none":
        lines.append(f"AMP1, 4{unit.amplifier[1:]}, Rev 6")
    return "\r\n".join(lines)


def _lines(lines: Iterable[str]) -> str | None:
    """Return a list's lines; None for none."""
    return "\r\n".join(lines) or None


def list_program(machine: Machine, call: Call) -> str | None:
    """LS: lines with their numbers and a trailing blank."""
    lines = machine.program.lines
    parts = split_arguments(call.text)
    if len(parts) > 2:
        raise CommandError(4)
    first, last = [
        int(evaluate(part, machine)) if part else default
        for part, default in zip([*parts, "", ""], (0, len(lines) - 1), strict=False)
    ]
    if not 0 <= first <= max(last, 0):
        raise CommandError(11)
    shown = [f"{n} {lines[n]} " for n in range(first, min(last, len(lines) - 1) + 1)]
    return _lines(shown)


def message(machine: Machine, call: Call) -> str | None:
    """MG: strings and numbers, each with its format, to a port if one is given."""
    if not call.text:
        raise CommandError(50)
    answer, port, common, ended = "", "", "", True
    for part in split_arguments(call.text):
        found = _FORMATS.fullmatch(part)
        if found is None:
            raise CommandError(53)
        form = ""
        for word in re.findall(r"\{([^}]*)\}", found["before"] + found["after"]):
            if word == "N":
                ended = False
            elif re.fullmatch(r"\^[0-9]{1,3}", word) and int(word[1:]) < 256:
                answer += chr(int(word[1:]))
            elif re.fullmatch(r"P[12]|E[A-H]", word):
                port = word
            else:
                form = word
        value = found["value"].strip(" ")
        if form and (not value or value.startswith('"')):  # it is that of all numbers
            common = form
        answer += _written(machine, value, form or common, bool(answer))
    answer = answer if ended else Unended(answer)
    if port and not (port == "P1" and machine.port == SERIAL and call.thread is None):
        _tell_port(machine, port, answer)
        return None
    return answer


def _tell_port(machine: Machine, port: str, answer: str) -> None:
    """Send a line to a port other than that of the command; P2 is connected to nothing."""
    if port != "P2":
        machine.tell(write_line(answer), port[1] if port[0] == "E" else SERIAL)


def _written(machine: Machine, value: str, form: str, follows: bool) -> str:
    if not value:
        return ""
    if "{" in value and '"' not in value:
        raise CommandError(53)
    if len(value) > 1 and value[0] == value[-1] == '"' and value.count('"') == 2:
        return value[1:-1]
    if '"' in value:  # a string and an expression without a comma between them
        text, _, rest = value[1:].partition('"')
        return text + _written(machine, rest, form, True)
    number = evaluate(value, machine)
    written = write_as(number, form) if form else write_number(number)
    return " " + written if follows and written.startswith("-") else written


LISTS: dict[str, Handler] = {
    # A bank of inputs.
    "TI": lambda machine, call: write_number(machine.input_bits * (call.number() == 0), 0),
    # A byte of the amplifiers' errors.
    "TA": lambda machine, call: write_number(machine.amplifier_bits(int(call.number())), 0),
    # The axes, and the sizes of the data record, which is not emulated itself.
    "QZ": lambda machine, call: write_list(DATA_RECORD),
    # The program without line numbers.
    "UL": lambda machine, call: _lines([*machine.program.lines, CONTROL_Z]),
    # Labels and their lines.
    "LL": lambda machine, call: _lines(
        f"{label}={line} " for label, line in sorted(machine.program.labels.items())
    ),
    # Variables and their values.
    "LV": lambda machine, call: _lines(
        f"{name} ={write_variable(machine, value)} "
        for name, value in sorted(machine.variables.items())
    ),
    # Arrays and their lengths.
    "LA": lambda machine, call: _lines(f"{name}[{len(v)}]" for name, v in machine.arrays.items()),
}
"""Commands that report something as it is."""
