"""The names in expressions and MG: operands, functions, keywords."""

from collections.abc import Callable

from sautereau.sim_backend.devices.galil.axis import AXES, SETTINGS
from sautereau.sim_backend.devices.galil.faults import CommandError
from sautereau.sim_backend.devices.galil.machine import INPUTS, OUTPUTS, Machine
from sautereau.sim_backend.devices.galil.program import THREADS


def home_switch(machine: Machine, axis: int) -> bool:
    """Return the level of the home switch: on beyond the home position."""
    return machine.plant.encoder_counts()[axis] >= machine.plant.home_counts()[axis]


def switches(machine: Machine, axis: int) -> int:
    """Return the bits of TS.

    7 in motion, 6 error over its limit, 5 motor off, 3 and 2 limit switches off, 1 home switch.
    """
    state = machine.axes[axis]
    over = 0 <= state.settings["ER"] < abs(machine.error(axis))
    return (
        (state.profile is not None) << 7
        | over << 6
        | (not state.motor_on) << 5
        | 0b1100
        | home_switch(machine, axis) << 1
    )


AXIS_OPERANDS: dict[str, Callable[[Machine, int], float]] = {
    "TP": Machine.position,
    "RP": Machine.commanded,
    "TE": Machine.error,
    "TD": lambda machine, axis: machine.axes[axis].auxiliary,
    "TT": lambda machine, axis: machine.plant.torque_volts()[axis],
    "TS": switches,
    "SC": lambda machine, axis: machine.axes[axis].stop_code,
    "PV": lambda machine, axis: machine.axes[axis].free,
    "BT": lambda machine, axis: machine.axes[axis].executed,
    "BG": lambda machine, axis: machine.axes[axis].profile is not None,
    "MO": lambda machine, axis: not machine.axes[axis].motor_on,
    "HM": home_switch,
    "LF": lambda machine, axis: 1,
    "LR": lambda machine, axis: 1,
}
"""Operands of an axis, by command: ``_TPA`` is ``AXIS_OPERANDS["TP"](machine, 0)``."""

OPERANDS: dict[str, Callable[[Machine], float]] = {
    "TM": lambda machine: machine.sample_time,
    "TC": lambda machine: machine.error_code,
    "RC": lambda machine: machine.capture.running,
    "RD": lambda machine: machine.capture.index,
    "DM": lambda machine: machine.arrays.free,
    "EO": lambda machine: machine.echo,
    "OP": lambda machine: sum(level << bit for bit, level in enumerate(machine.outputs)),
    "TI": lambda machine: sum(level << bit for bit, level in enumerate(machine.inputs)),
}
"""Operands of the controller."""


def operand(machine: Machine, name: str) -> float:
    """Return the value of an operand such as ``_TPA``, given without its underscore."""
    code, index = name[:2], name[2:]
    if code in ("XQ", "HX") and (index or "0") in "01234567"[:THREADS]:
        thread = machine.threads.get(int(index or 0))
        if code == "HX":
            return float(thread is not None)
        return float(-1 if thread is None else thread.line)
    if not index and code in OPERANDS:
        return float(OPERANDS[code](machine))
    axis = AXES.find(index.replace("X", "A").replace("Y", "B")) if index else -1
    if axis >= 0 and code in AXIS_OPERANDS:
        return float(AXIS_OPERANDS[code](machine, axis))
    if axis >= 0 and code in SETTINGS:
        return machine.axes[axis].settings[code]
    raise CommandError(58)


def function(machine: Machine, name: str, argument: float) -> float:
    """Return the value of @OUT, @IN, @ABS or @INT."""
    match name:
        case "@OUT":
            return float(machine.outputs[whole(argument, 1, OUTPUTS) - 1])
        case "@IN":
            return float(machine.inputs[whole(argument, 1, INPUTS) - 1])
        case "@ABS":
            return abs(argument)
        case "@INT":
            return float(int(argument))
    raise CommandError(57)


def variable(machine: Machine, name: str) -> float:
    """Return a variable, or TIME: samples since power-up, modulo 2^31."""
    if name == "TIME":
        return float(machine.samples % 2**31)
    if name not in machine.variables:
        raise CommandError(9)
    return machine.variables[name]


def whole(value: float, low: float, high: float) -> int:
    """Return ``value`` as an integer between ``low`` and ``high``; otherwise refuse with code 6."""
    if value != int(value) or not low <= value <= high:
        raise CommandError(6)
    return int(value)
