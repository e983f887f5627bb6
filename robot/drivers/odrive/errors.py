"""The errors of an ODrive's axes, by name."""

from sautereau.robot.drivers.odrive.line import OdriveLine
from sautereau.robot.errors import MotionFault

_ERRORS = {
    "error": {
        0x1: "INVALID_STATE",
        0x40: "MOTOR_FAILED",
        0x100: "ENCODER_FAILED",
        0x200: "CONTROLLER_FAILED",
        0x800: "WATCHDOG_TIMER_EXPIRED",
        0x1000: "MIN_ENDSTOP_PRESSED",
        0x2000: "MAX_ENDSTOP_PRESSED",
        0x4000: "ESTOP_REQUESTED",
        0x20000: "HOMING_WITHOUT_ENDSTOP",
        0x40000: "OVER_TEMP",
        0x80000: "UNKNOWN_POSITION",
    },
    "motor.error": {
        0x8: "DRV_FAULT",
        0x10: "CONTROL_DEADLINE_MISSED",
        0x80: "MODULATION_MAGNITUDE",
        0x400: "CURRENT_SENSE_SATURATION",
        0x1000: "CURRENT_LIMIT_VIOLATION",
    },
    "encoder.error": {
        0x2: "CPR_POLEPAIRS_MISMATCH",
        0x4: "NO_RESPONSE",
        0x20: "INDEX_NOT_FOUND_YET",
    },
    "controller.error": {
        0x1: "OVERSPEED",
        0x2: "INVALID_INPUT_MODE",
        0x20: "INVALID_ESTIMATE",
        0x80: "SPINOUT_DETECTED",
    },
}
"""Bits of the error properties in firmware 0.5.x, from memory: others are given as numbers."""


def error_names(register: str, value: int) -> str:
    """Return the names of the bits that are set in an error property (`motor.error`)."""
    names = [name for bit, name in _ERRORS[register].items() if value & bit]
    if unknown := value & ~sum(_ERRORS[register]):
        names.append(f"0x{unknown:x}")
    return f"{register}: {', '.join(names)}"


def check_errors(line: OdriveLine, what: str) -> None:
    """Refuse to continue with ``what`` where an axis reports an error.

    Raises:
        MotionFault: Lists the errors of both joints.
    """
    faults = [
        f"joint {axis + 1} {error_names(register, value)}"
        for axis in (0, 1)
        for register in _ERRORS
        if (value := int(line.read(f"axis{axis}.{register}")))
    ]
    if faults:
        raise MotionFault(
            f"{what} broke off: {'; '.join(faults)}; remove the cause, then home() again"
        )
