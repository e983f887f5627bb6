"""The names in expressions and MG: operands, functions, keywords."""

import functools
import math
import struct
from collections.abc import Callable

from sautereau.sim_backend.devices.emulators import SERIAL
from sautereau.sim_backend.devices.galil.answers import CommandError
from sautereau.sim_backend.devices.galil.axis import AXES
from sautereau.sim_backend.devices.galil.machine import Machine
from sautereau.sim_backend.devices.galil.memory import OUTPUTS
from sautereau.sim_backend.devices.galil.ports import HANDLES
from sautereau.sim_backend.devices.galil.safety import INPUTS
from sautereau.sim_backend.devices.galil.tasks import THREADS


def switches(machine: Machine, axis: int) -> int:
    """Return the bits of TS.

    7 in motion, 6 error over its limit, 5 motor off, 3 and 2 limit switches inactive, 1 home
    switch, 0 latched.
    """
    state = machine.axes[axis]
    return (
        (state.profile is not None) << 7
        | machine.exceeds_error_limit(axis) << 6
        | (not state.motor_on) << 5
        | machine.limit_allows(axis, "forward") << 3
        | machine.limit_allows(axis, "reverse") << 2
        | machine.home_state(axis) << 1
        | (state.latched is not None)
    )


DATA_RECORD = (len(AXES), 52, 26, 36)
"""Axes, and bytes of general state, of a coordinated motion's and of an axis's, in the data
record."""

AXIS_OPERANDS: dict[str, Callable[[Machine, int], float]] = {
    "TP": Machine.position,
    "DP": Machine.position,
    "IP": Machine.position,
    "RP": Machine.commanded,
    "TE": Machine.error,
    "TD": lambda machine, axis: machine.axes[axis].auxiliary,
    "DE": lambda machine, axis: machine.axes[axis].auxiliary,
    "TT": lambda machine, axis: machine.plant.torque_volts()[axis],
    "TV": lambda machine, axis: machine.axes[axis].filtered_speed,
    "TS": switches,
    "SC": lambda machine, axis: machine.axes[axis].stop_code,
    "PV": lambda machine, axis: machine.axes[axis].free,
    "BT": lambda machine, axis: machine.axes[axis].executed,
    "BG": lambda machine, axis: machine.axes[axis].profile is not None,
    "MO": lambda machine, axis: not machine.axes[axis].motor_on,
    "HM": Machine.home_state,
    "LF": lambda machine, axis: machine.limit_allows(axis, "forward"),
    "LR": lambda machine, axis: machine.limit_allows(axis, "reverse"),
    "PA": lambda machine, axis: machine.axes[axis].stopped_at,
    "PR": lambda machine, axis: machine.axes[axis].distance,
    "JG": lambda machine, axis: abs(machine.axes[axis].jog_speed),
    "AL": lambda machine, axis: machine.axes[axis].latch_armed,
    "RL": lambda machine, axis: machine.axes[axis].latched or 0,
    "BA": lambda machine, axis: machine.axes[axis].brushless,
}
"""Operands of an axis, by command: ``_TPA`` is ``AXIS_OPERANDS["TP"](machine, 0)``."""


def _stored(code: str, index: int = 0) -> Callable[[Machine], float]:
    return lambda machine: machine.config[code][index]


OPERANDS: dict[str, Callable[[Machine], float]] = {
    "TC": lambda machine: machine.error_code,
    "RC": lambda machine: machine.capture.running,
    "RD": lambda machine: machine.capture.index,
    "DM": lambda machine: machine.arrays.free,
    "DA": lambda machine: machine.arrays.unused,
    "DL": lambda machine: machine.limits.labels - len(machine.program.labels),
    "UL": lambda machine: machine.limits.variables - len(machine.variables),
    "OP0": lambda machine: machine.outputs.value,
    "TI0": lambda machine: machine.input_bits,
    "TI1": lambda machine: 0,
    "AB": lambda machine: not machine.abort_active,
    "BN": lambda machine: machine.unit.serial_number,
    "BV": lambda machine: machine.unit.galil.axes,
    "RS": lambda machine: 0,
    "ED": lambda machine: machine.tasks.failed_line,
    "ED0": lambda machine: machine.tasks.failed_line,
    "ED1": lambda machine: machine.tasks.failed_thread,
    "ED4": lambda machine: machine.tasks.current,
    "NO": lambda machine: sum(1 << number for number in machine.tasks.threads),
    "TB": lambda machine: machine.status_byte,
    "CF": lambda machine: ord(machine.ports.unsolicited_port),
    "CW": lambda machine: machine.config["CW"][0],
    "CW4": lambda machine: machine.config["CW"][1],
    "WH": lambda machine: -1 if machine.port == SERIAL else HANDLES.index(machine.port),
    "IA0": lambda machine: 0x7F000001,
    "IA1": lambda machine: 250,
    "IA2": lambda machine: sum(letter not in machine.ports.open for letter in HANDLES),
    "IA3": lambda machine: OPERANDS["WH"](machine),
    "IA4": lambda machine: machine.ports.lost_handle,
    "IA5": lambda machine: 100 if machine.unit.interface == "ethernet" else -1,
    **{f"CN{n}": _stored("CN", n) for n in range(5)},
    **{code: _stored(code) for code in ("TM", "EO", "LZ", "US", "EI")},
    **{f"QZ{n}": lambda machine, n=n: DATA_RECORD[n] for n in range(4)},
    **{f"TA{n}": functools.partial(Machine.amplifier_bits, byte=n) for n in range(4)},
    "PF": lambda machine: machine.config["PF"][0] + machine.config["PF"][1] / 10,
    "VF": lambda machine: machine.config["VF"][0] + machine.config["VF"][1] / 10,
    "AZ2": lambda machine: machine.latching_amplifier,
}
"""Operands of the controller."""


def operand(machine: Machine, name: str) -> float:
    """Return the value of an operand such as ``_TPA``, given without its underscore."""
    code, index = name[:2], name[2:]
    if code in ("XQ", "HX", "ZS") and index in ("", *map(str, range(THREADS))):
        return float(machine.tasks.operand(code, int(index or 0)))
    if name in OPERANDS:
        return float(OPERANDS[name](machine))
    if code in machine.unit.galil.absent:
        raise CommandError(58)
    axis = (
        machine.letters.find(index.replace("X", "A").replace("Y", "B")) if len(index) == 1 else -1
    )
    if axis >= 0 and code in AXIS_OPERANDS:
        return float(AXIS_OPERANDS[code](machine, axis))
    if axis >= 0 and code in machine.axes[axis].settings:
        return machine.axes[axis].settings[code]
    raise CommandError(58)


def _degrees(function: Callable[[float], float]) -> Callable[[float], float]:
    return lambda argument: function(math.radians(argument))


def _real(argument: float) -> float:
    """Return the number of which a 32-bit floating-point number has these bits."""
    bits = int(argument) & 0xFFFFFFFF
    value = struct.unpack(">f", bits.to_bytes(4, "big"))[0]
    if not math.isfinite(value):
        raise CommandError(6)
    return value


_FUNCTIONS: dict[str, tuple[float, Callable[[float], float]]] = {
    "@ABS": (math.inf, abs),
    "@INT": (math.inf, math.trunc),
    "@FRAC": (math.inf, lambda argument: math.fmod(argument, 1)),
    "@RND": (math.inf, lambda argument: math.floor(argument + 0.5)),
    "@SQR": (math.inf, lambda argument: math.sqrt(abs(argument))),
    "@COM": (math.inf, lambda argument: float(~int(argument))),
    "@SIN": (32768, _degrees(math.sin)),
    "@COS": (32768, _degrees(math.cos)),
    "@TAN": (32768, _degrees(math.tan)),
    "@ASIN": (1, lambda argument: math.degrees(math.asin(argument))),
    "@ACOS": (1, lambda argument: math.degrees(math.acos(argument))),
    "@FLOT": (math.inf, lambda argument: struct.unpack(">i", struct.pack(">f", argument))[0]),
    "@REAL": (math.inf, _real),
    "@ATAN": (math.inf, lambda argument: math.degrees(math.atan(argument))),
}
"""Functions of a number with the largest magnitude of their argument."""


def function(machine: Machine, name: str, argument: float) -> float:
    """Return the value of a function such as @ABS or @IN."""
    if name in _FUNCTIONS:
        limit, value = _FUNCTIONS[name]
        if abs(argument) > limit:
            raise CommandError(6)
        # 24 bits more than the controller's resolution hide the rounding of sin 180 deg.
        return round(value(argument), 12)
    match name:
        case "@OUT":
            return float(machine.outputs.level(whole(argument, 1, OUTPUTS)))
        case "@IN":
            return float(machine.inputs[whole(argument, 1, INPUTS) - 1])
        case "@AN":
            return 0.0 * whole(argument, 1, 8)
    raise CommandError(57)


def variable(machine: Machine, name: str) -> float:
    """Return a variable, or TIME: samples since power-up, as a number of 32 bits."""
    if name == "TIME":
        return float((machine.samples - machine.started + 2**31) % 2**32 - 2**31)
    if name not in machine.variables:
        raise CommandError(9)
    return machine.variables[name]


def whole(value: float, low: float, high: float) -> int:
    """Return ``value`` as an integer between ``low`` and ``high``; otherwise refuse with code 6."""
    if value != int(value) or not low <= value <= high:
        raise CommandError(6)
    return int(value)
