"""The properties of the emulated ODrive by name: `axis0.error`, `gpio1.state`.

`gpio1.state` to `gpio8.state` are the stand-in's own (docs/decisions/0006).
"""

from sautereau.sim_backend.devices.odrive.axis import TORQUE_CONSTANT, OdriveAxis
from sautereau.sim_backend.devices.odrive.machine import OUTPUTS, Machine
from sautereau.sim_backend.devices.odrive.words import number

_SUPPLY = 24.0  # V
_INTEGERS = frozenset(
    {
        "config.enable_watchdog",
        "controller.config.circular_setpoints",
        "controller.config.control_mode",
        "controller.config.input_mode",
        "encoder.config.cpr",
        "min_endstop.config.enabled",
    }
)


def value_of(machine: Machine, name: str) -> str | None:
    """Return the value of a property as text, or None if there is none."""
    if (output := _output(name)) is not None:
        return str(int(machine.outputs[output - 1]))
    if name == "vbus_voltage":
        return f"{_SUPPLY:.6f}"
    index, axis, rest = _named(machine, name)
    if axis is None:
        return None
    if rest == "motor.current_control.Iq_setpoint":
        return f"{machine.torque(index) / TORQUE_CONSTANT:.6f}"
    integers = {
        "current_state": axis.state,
        "error": axis.error,
        "motor.error": 0,
        "encoder.error": 0,
        "controller.error": 0,
        "controller.trajectory_done": axis.done,
        "is_homed": axis.homed,
        "min_endstop.endstop_state": axis.pressed,
    }
    if rest in integers:
        return str(int(integers[rest]))
    if rest not in axis.settings:
        return None
    value = axis.settings[rest]
    return str(int(value)) if rest in _INTEGERS else f"{value:.6f}"


def write(machine: Machine, name: str, word: str | None) -> list[str]:
    """Set a property to the value of a word; return the firmware's error messages."""
    value = None if word is None else number(word)
    output = _output(name)
    _, axis, rest = _named(machine, name)
    known = output is not None or (
        axis is not None and (rest == "requested_state" or rest in axis.settings)
    )
    if not known:
        return ["invalid property"]
    if value is None:
        return ["not implemented"]
    if output is not None:
        machine.set_output(output, value != 0)
    elif axis is not None and rest == "requested_state":
        axis.request(int(value))
    elif axis is not None:
        axis.settings[rest] = float(int(value)) if rest in _INTEGERS else value
        if rest == "config.watchdog_timeout":
            axis.feed()
        axis.look_at_endstop()
    return []


def _named(machine: Machine, name: str) -> tuple[int, OdriveAxis | None, str]:
    """Return number and axis from the head of a property's name, and the rest of the name."""
    head, _, rest = name.partition(".")
    for index, axis in enumerate(machine.axes):
        if head == f"axis{index}":
            return index, axis, rest
    return 0, None, ""


def _output(name: str) -> int | None:
    """Return the number of the output whose level a property is."""
    for output in range(1, OUTPUTS + 1):
        if name == f"gpio{output}.state":
            return output
    return None
