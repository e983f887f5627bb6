"""Commands that belong to no axis: outputs, formats, memory."""

from sautereau.sim_backend.devices.galil.commands.call import Call
from sautereau.sim_backend.devices.galil.faults import CommandError
from sautereau.sim_backend.devices.galil.formats import write_number
from sautereau.sim_backend.devices.galil.grammar import QUERY, evaluate, split_arguments
from sautereau.sim_backend.devices.galil.machine import Machine
from sautereau.sim_backend.devices.galil.memory import OUTPUTS, Memory
from sautereau.sim_backend.devices.galil.operands import whole

PASSWORD = 8  # Characters in a password

BURN_TIME = 1.0  # s, that BN takes; BP and BV take twice as long


def configure(machine: Machine, call: Call) -> str | None:
    """Set or report numbers of the controller; omitted ones stay."""
    stored = machine.config[call.code]
    if call.query:
        decimals = [argument.decimals for argument in call.entry.arguments]
        pairs = zip(stored, decimals, strict=True)
        return ",".join(write_number(value, digits) for value, digits in pairs)
    if not any(value is not None for value in call.numbers):
        raise CommandError(50)
    for index, value in enumerate(call.numbers):
        if value is not None:
            stored[index] = value
    return None


def format_numbers(machine: Machine, call: Call) -> str | None:
    """PF and VF: digits before and after the point of positions and of variables."""
    stored = machine.config[call.code]
    if call.text == QUERY:
        return f"{stored[0]:.0f}.{stored[1]:.0f}"
    digits, _, rest = call.text.partition(".")
    stored[:] = [
        whole(evaluate(digits, machine), -8, 10),
        whole(evaluate(rest, machine), 0, 4) if rest else stored[1],
    ]
    return None


def set_bit(machine: Machine, call: Call) -> None:
    """SB and CB."""
    machine.outputs.set(whole(call.number(), 1, OUTPUTS), call.code == "SB")


def output_bit(machine: Machine, call: Call) -> None:
    """OB n, expression: an output on if the expression is not zero."""
    parts = split_arguments(call.text)
    if len(parts) != 2:
        raise CommandError(50 if len(parts) < 2 else 4)
    number = whole(evaluate(parts[0], machine), 1, OUTPUTS)
    machine.outputs.set(number, evaluate(parts[1], machine) != 0)


def output_port(machine: Machine, call: Call) -> str | None:
    """OP: all outputs at once."""
    if call.query:
        return write_number(machine.outputs.value, 0)
    levels = int(call.number())
    for number in range(1, OUTPUTS + 1):
        machine.outputs.set(number, bool(levels >> (number - 1) & 1))
    return None


def clear_amplifier(machine: Machine, call: Call) -> None:
    """AZ: clear latched amplifier errors, or have them latched."""
    if call.number() == 2:
        machine.latching_amplifier = True


def burn(machine: Machine, call: Call) -> None:
    """BN: store the parameters so that they survive power-off."""
    if call.thread is None and machine.tasks.threads:
        raise CommandError(17)
    machine.burn()
    machine.occupy(BURN_TIME)


def burn_variables(machine: Machine, call: Call) -> None:
    """BV: store variables and arrays so that they survive power-off."""
    machine.memory.variables = dict(machine.variables)
    machine.memory.arrays = {name: list(values) for name, values in machine.arrays.items()}
    machine.occupy(2 * BURN_TIME)


def set_password(machine: Machine, call: Call) -> None:
    """PW: set the password, given twice, while the program is not locked."""
    first, _, second = call.text.partition(",")
    if machine.locked:
        raise CommandError(106)
    if first != second:
        raise CommandError(138)
    if len(first) > PASSWORD:
        raise CommandError(52)
    machine.password = first


def lock(machine: Machine, text: str) -> str | None:
    """^L^K password,n: lock the program against listing, or with 0 unlock it."""
    if text == QUERY:
        return write_number(machine.locked, 0)
    password, _, state = text.partition(",")
    if password != machine.password:
        raise CommandError(136)
    if state.strip(" ") not in ("", "0", "1"):
        raise CommandError(137)
    machine.locked = state.strip(" ") == "1"
    return None


def reset(machine: Machine, call: Call) -> None:
    """RS: reset as by switching off and on; RS -1 with the factory's values."""
    machine.power_up(factory=call.number() < 0)


def master_reset(machine: Machine) -> None:
    """^R^S: erase what was burned, and reset."""
    machine.memory = Memory()
    machine.power_up()
