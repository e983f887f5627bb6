"""Commands that set numbers of axes and controller, outputs, ports, and the memory."""

from sautereau.sim_backend.devices.emulators import SERIAL
from sautereau.sim_backend.devices.galil.answers import CommandError, write_list, write_number
from sautereau.sim_backend.devices.galil.commands.call import Call
from sautereau.sim_backend.devices.galil.grammar import (
    QUERY,
    evaluate,
    named_axes,
    parse_axes,
    split_arguments,
)
from sautereau.sim_backend.devices.galil.machine import Machine
from sautereau.sim_backend.devices.galil.memory import OUTPUTS, Memory
from sautereau.sim_backend.devices.galil.operands import whole
from sautereau.sim_backend.devices.galil.ports import HANDLES

BURN_TIME = 1.0  # s, that BN takes; BP and BV take twice as long
LIMITED = {
    "D3040": (2, 7.0),
    "D3240": (2, 5.0),
    "D3540": (2, 5.0),
    "D3547": (2, 5.0),
    "D3640": (0, 5.0),
}
"""Least AG of internal amplifiers at which TL is limited, and the largest TL [V] from there on."""


def setting(machine: Machine, call: Call) -> str | None:
    """Set or report a number stored for every axis."""
    for index, value in call.given:
        machine.axes[index].settings[call.code] = value
    answers = [machine.axes[index].settings[call.code] for index in call.asked]
    return write_list(answers, call.entry.arguments[0].decimals)


def largest_torque(machine: Machine, index: int) -> float:
    """Return the largest TL [V] that the amplifier's gain allows."""
    gain, limit = LIMITED.get(machine.unit.amplifier, (0, 10.0))
    return limit if machine.axes[index].settings["AG"] >= gain else 10.0


def gain(machine: Machine, call: Call) -> str | None:
    """AG and MT: only with the motor off; the largest gain lowers TL."""
    if any(machine.axes[index].motor_on for index, _ in call.given):
        raise CommandError(135)
    answer = setting(machine, call)
    for index, axis in enumerate(machine.axes):
        axis.settings["TL"] = min(axis.settings["TL"], largest_torque(machine, index))
    machine.drive()
    return answer


def torque_limit(machine: Machine, call: Call) -> str | None:
    """TL and OF: pass the voltages to the amplifiers."""
    for index, value in call.given:
        if call.code == "TL" and value > largest_torque(machine, index):
            raise CommandError(6)
    answer = setting(machine, call)
    machine.drive()
    return answer


def encoder_torque(machine: Machine, call: Call) -> str | None:
    """OV: at most TL."""
    if any(value > machine.axes[index].settings["TL"] for index, value in call.given):
        raise CommandError(6)
    return setting(machine, call)


def brake(machine: Machine, call: Call) -> str | None:
    """BW: make an output the brake of its axis."""
    answer = setting(machine, call)
    machine.outputs.update()
    return answer


def define_position(machine: Machine, call: Call) -> str | None:
    """DP: redefine the positions of encoder and reference; nothing moves."""
    counts = machine.plant.encoder_counts()
    for index, value in call.given:
        machine.axes[index].define(int(value), counts[index])
    return write_list([machine.position(index) for index in call.asked])


def define_auxiliary(machine: Machine, call: Call) -> str | None:
    """DE: redefine the position of the auxiliary encoder."""
    for index, value in call.given:
        machine.axes[index].auxiliary = int(value)
    return write_list([machine.axes[index].auxiliary for index in call.asked])


def brushless(machine: Machine, call: Call) -> None:
    """BA: commutate axes sinusoidally; N for none."""
    named = [] if call.text == "N" else parse_axes(call.text, machine)
    for index, axis in enumerate(machine.axes):
        axis.brushless = index in named


def arm_latch(machine: Machine, call: Call) -> None:
    """AL: latch the position at the index, `AL TA`; no other latch is wired."""
    letters = named_axes(machine, call.text).replace(" ", "")
    if not letters or any(letter != "T" for letter in letters[::2]):
        raise CommandError(141)
    for index in parse_axes(letters[1::2], machine):
        machine.axes[index].arm_latch()


# Of no axis


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
    if len(first) > 8:  # Characters
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


def echo(machine: Machine, call: Call) -> str | None:
    """EO: echo characters on or off; only the serial port takes it."""
    if machine.port != SERIAL:
        raise CommandError(1)
    if call.query:
        return f" {machine.config['EO'][0]:.0f}"
    machine.config["EO"][0] = call.number()
    return None


def mark(machine: Machine, call: Call) -> str | None:
    """CW: whether bit 7 of unsolicited characters is set; 0 or nothing gives the copyright."""
    stored = machine.config["CW"]
    first = call.numbers[0] if call.numbers else None
    if len(call.numbers) > 1 and call.numbers[1] is not None:
        stored[1] = call.numbers[1]
    if first:
        stored[0] = first
        return None
    return f"Copyright {machine.unit.model} stand-in" if len(call.numbers) < 2 else None


def unsolicited(machine: Machine, call: Call) -> str | None:
    """CF: send unsolicited messages to a handle, to the serial port S, or to this port I."""
    if call.text == "?":
        return machine.ports.unsolicited_port
    if call.text == "I" and call.thread is None:
        machine.ports.unsolicited_port = machine.port
    elif call.text == SERIAL or (len(call.text) == 1 and call.text in HANDLES):
        machine.ports.unsolicited_port = call.text
    else:
        raise CommandError(4)
    return None


def which_handle(machine: Machine, call: Call) -> str:
    """WH: the port from which this command comes."""
    if machine.port != SERIAL:
        return f"IH{machine.port}"
    return "USB" if machine.unit.interface == "usb" else "RS232"


def tell_handles(machine: Machine, call: Call) -> str:
    """TH: the Ethernet connections."""
    lines = ["CONTROLLER IP ADDRESS 127,0,0,1 ETHERNET ADDRESS 00-50-4C-00-00-00"]
    for letter in HANDLES:
        state = "AVAILABLE"
        if letter in machine.ports.open:
            peer = machine.ports[letter].peer
            state = f"TCP PORT 23 TO IP ADDRESS 127,0,0,1 PORT {peer}"
        lines.append(f"IH{letter} {state}")
    return "\r\n".join(lines)
