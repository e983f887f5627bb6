"""Commands that store a number for an axis."""

from sautereau.sim_backend.devices.galil.commands.call import Call
from sautereau.sim_backend.devices.galil.faults import CommandError
from sautereau.sim_backend.devices.galil.formats import write_list
from sautereau.sim_backend.devices.galil.grammar import named_axes, parse_axes
from sautereau.sim_backend.devices.galil.machine import Machine

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
    named = [] if call.text == "N" else parse_axes(call.text)
    for index, axis in enumerate(machine.axes):
        axis.brushless = index in named


def arm_latch(machine: Machine, call: Call) -> None:
    """AL: latch the position at the index, `AL TA`; no other latch is wired."""
    letters = named_axes(machine, call.text).replace(" ", "")
    if not letters or any(letter != "T" for letter in letters[::2]):
        raise CommandError(141)
    for index in parse_axes(letters[1::2]):
        machine.axes[index].arm_latch()
