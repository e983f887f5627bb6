"""Commands about ports: echo, unsolicited messages, handles."""

from sautereau.sim_backend.devices.emulators import SERIAL
from sautereau.sim_backend.devices.galil.commands.call import Call
from sautereau.sim_backend.devices.galil.faults import CommandError
from sautereau.sim_backend.devices.galil.machine import Machine
from sautereau.sim_backend.devices.galil.ports import HANDLES


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
