"""The error properties of an ODrive, and the names of their bits.

From `Firmware/odrive-interface.yaml` of odriverobotics/ODrive, tag fw-v0.5.6: flags without a
`bit` follow the one before them.
"""

DEVICE = "error"
"""Property of the device; those below are an axis's."""
CUT = 9
"""Characters to which the firmware cuts a value: an error of so many digits may be longer."""

_BITS: dict[str, dict[int, str]] = {
    DEVICE: dict(
        enumerate(
            (
                "CONTROL_ITERATION_MISSED",
                "DC_BUS_UNDER_VOLTAGE",
                "DC_BUS_OVER_VOLTAGE",
                "DC_BUS_OVER_REGEN_CURRENT",
                "DC_BUS_OVER_CURRENT",
                "BRAKE_DEADTIME_VIOLATION",
                "BRAKE_DUTY_CYCLE_NAN",
                "INVALID_BRAKE_RESISTANCE",
            )
        )
    ),
    "axis.error": {
        0: "INVALID_STATE",
        6: "MOTOR_FAILED",
        7: "SENSORLESS_ESTIMATOR_FAILED",
        8: "ENCODER_FAILED",
        9: "CONTROLLER_FAILED",
        11: "WATCHDOG_TIMER_EXPIRED",
        12: "MIN_ENDSTOP_PRESSED",
        13: "MAX_ENDSTOP_PRESSED",
        14: "ESTOP_REQUESTED",
        17: "HOMING_WITHOUT_ENDSTOP",
        18: "OVER_TEMP",
        19: "UNKNOWN_POSITION",
    },
    "axis.motor.error": {
        0: "PHASE_RESISTANCE_OUT_OF_RANGE",
        1: "PHASE_INDUCTANCE_OUT_OF_RANGE",
        3: "DRV_FAULT",
        4: "CONTROL_DEADLINE_MISSED",
        7: "MODULATION_MAGNITUDE",
        10: "CURRENT_SENSE_SATURATION",
        12: "CURRENT_LIMIT_VIOLATION",
        16: "MODULATION_IS_NAN",
        17: "MOTOR_THERMISTOR_OVER_TEMP",
        18: "FET_THERMISTOR_OVER_TEMP",
        19: "TIMER_UPDATE_MISSED",
        20: "CURRENT_MEASUREMENT_UNAVAILABLE",
        21: "CONTROLLER_FAILED",
        22: "I_BUS_OUT_OF_RANGE",
        23: "BRAKE_RESISTOR_DISARMED",
        24: "SYSTEM_LEVEL",
        25: "BAD_TIMING",
        26: "UNKNOWN_PHASE_ESTIMATE",
        27: "UNKNOWN_PHASE_VEL",
        28: "UNKNOWN_TORQUE",
        29: "UNKNOWN_CURRENT_COMMAND",
        30: "UNKNOWN_CURRENT_MEASUREMENT",
        31: "UNKNOWN_VBUS_VOLTAGE",
        32: "UNKNOWN_VOLTAGE_COMMAND",
        33: "UNKNOWN_GAINS",
        34: "CONTROLLER_INITIALIZING",
        35: "UNBALANCED_PHASES",
    },
    "axis.encoder.error": dict(
        enumerate(
            (
                "UNSTABLE_GAIN",
                "CPR_POLEPAIRS_MISMATCH",
                "NO_RESPONSE",
                "UNSUPPORTED_ENCODER_MODE",
                "ILLEGAL_HALL_STATE",
                "INDEX_NOT_FOUND_YET",
                "ABS_SPI_TIMEOUT",
                "ABS_SPI_COM_FAIL",
                "ABS_SPI_NOT_READY",
                "HALL_NOT_CALIBRATED_YET",
            )
        )
    ),
    "axis.controller.error": dict(
        enumerate(
            (
                "OVERSPEED",
                "INVALID_INPUT_MODE",
                "UNSTABLE_GAIN",
                "INVALID_MIRROR_AXIS",
                "INVALID_LOAD_ENCODER",
                "INVALID_ESTIMATE",
                "INVALID_CIRCULAR_RANGE",
                "SPINOUT_DETECTED",
            )
        )
    ),
}
"""Names by number of the bit, by property; `axis` stands for `axis0` and `axis1`."""
OF_AXIS = tuple(name.removeprefix("axis.") for name in _BITS if name != DEVICE)
"""Names of an axis's properties."""


def error_names(register: str, digits: str) -> str:
    """Return the names of the bits that are set, empty for none.

    Args:
        register: `DEVICE`, or one of `OF_AXIS` with `axis.` before it.
        digits: The value as the controller has sent it.

    Raises:
        ValueError: It is not a number.
    """
    value = int(digits)
    if not value:
        return ""
    if len(digits) >= CUT:  # which bits are set cannot be known
        return f"an error whose number begins with {digits}; `dump_errors(odrv0)` in odrivetool"
    bits = _BITS[register]
    names = [name for bit, name in bits.items() if value >> bit & 1]
    if unknown := value & ~sum(1 << bit for bit in bits):
        names.append(f"0x{unknown:x}")
    return ", ".join(names)
