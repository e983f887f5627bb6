"""The properties of an ODrive by name, and numbers as its firmware reads and writes them.

From `Firmware/odrive-interface.yaml`, the defaults in `Firmware/MotorControl/*.hpp`, and
`Firmware/fibre-cpp/protocol.hpp` of odriverobotics/ODrive, tag fw-v0.5.6.
"""

import math
import re
import struct
from dataclasses import dataclass
from typing import Literal

_FLOAT = re.compile(r"\s*([+-]?(?:inf(?:inity)?|nan|(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?))", re.I)
_INTEGER = re.compile(r"\s*([+-]?\d+)")


@dataclass(frozen=True)
class Property:
    """What the firmware declares of a property."""

    kind: Literal["float", "integer", "bool"]
    default: float = 0.0
    """At power-up."""
    writable: bool = True

    def scan(self, word: str) -> float | None:
        """Return the number at the head of a word, as `sscanf` does; None for none."""
        found = (_FLOAT if self.kind == "float" else _INTEGER).match(word)
        value = math.nan if found is None else float(found[1])
        if not abs(value) <= 1e10:  # Which the firmware does not limit
            return None
        return float(value != 0) if self.kind == "bool" else single(value, self.kind)

    def show(self, value: float) -> str:
        """Return a value as text, cut where the firmware cuts it."""
        text = f"{single(value):f}" if self.kind == "float" else str(int(value))
        return text[:9]  # It has a buffer of 10


FLOAT, INTEGER, BOOL = Property("float"), Property("integer"), Property("bool")
_READ = {kind: Property(kind, writable=False) for kind in ("float", "integer", "bool")}

ROOT = {"error": INTEGER, "vbus_voltage": _READ["float"]}  # Properties of the device
AXIS = {
    "config.enable_sensorless_mode": BOOL,
    "config.enable_step_dir": BOOL,
    "config.enable_watchdog": BOOL,
    "config.startup_closed_loop_control": BOOL,
    "config.startup_homing": BOOL,
    "config.watchdog_timeout": FLOAT,
    "controller.config.circular_setpoints": BOOL,
    "controller.config.control_mode": Property("integer", 3),
    "controller.config.enable_overspeed_error": Property("bool", 1),
    "controller.config.enable_vel_limit": Property("bool", 1),
    "controller.config.homing_speed": Property("float", 0.25),
    "controller.config.input_filter_bandwidth": Property("float", 2.0),
    "controller.config.inertia": FLOAT,
    "controller.config.input_mode": Property("integer", 1),
    "controller.config.load_encoder_axis": INTEGER,
    "controller.config.pos_gain": Property("float", 20.0),
    "controller.config.vel_gain": Property("float", 1 / 6),
    "controller.config.vel_integrator_gain": Property("float", 2 / 6),
    "controller.config.vel_limit": Property("float", 2.0),
    "controller.config.vel_limit_tolerance": Property("float", 1.2),
    "controller.config.vel_ramp_rate": Property("float", 1.0),
    "controller.error": INTEGER,
    "controller.input_torque": FLOAT,
    "controller.input_vel": FLOAT,
    "controller.trajectory_done": _READ["bool"],
    "current_state": _READ["integer"],
    "encoder.config.cpr": Property("integer", 8192),
    "encoder.error": INTEGER,
    "encoder.is_ready": Property("bool", 1, writable=False),
    "error": INTEGER,
    "is_homed": BOOL,
    "min_endstop.config.debounce_ms": Property("integer", 50),
    "min_endstop.config.enabled": BOOL,
    "min_endstop.config.offset": FLOAT,
    "min_endstop.endstop_state": _READ["bool"],
    "motor.config.current_lim": Property("float", 10.0),
    "motor.config.torque_constant": Property("float", 0.04),
    "motor.config.torque_lim": Property("float", math.inf),
    "motor.current_control.Iq_setpoint": _READ["float"],
    "motor.error": INTEGER,
    "motor.is_calibrated": Property("bool", 1, writable=False),
    "requested_state": INTEGER,
    "trap_traj.config.accel_limit": Property("float", 0.5),
    "trap_traj.config.decel_limit": Property("float", 0.5),
    "trap_traj.config.vel_limit": Property("float", 2.0),
}
"""Properties of an axis, without `axis0.` or `axis1.`. The stand-in's motors are calibrated."""


def single(value: float, kind: str = "float") -> float:
    """Return a number with the precision of 32 bits; an integer as it is."""
    return struct.unpack("f", struct.pack("f", value))[0] if kind == "float" else value
