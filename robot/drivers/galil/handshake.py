"""Identify the controller, and set and verify what a press relies on."""

from collections.abc import Mapping

from sautereau.rig.schema import Controller, Rig
from sautereau.robot.drivers.galil.dmc import software_limit_settings, software_limits
from sautereau.robot.drivers.galil.line import Line
from sautereau.robot.drivers.limits import Limits
from sautereau.robot.errors import CommandRefused, GarbledAnswer, RobotError, SettingNotTaken

_SAMPLE_PERIODS = (970e-6, 1001e-6)  # s, what firmwares make of TM 1000
_VOLTAGE_STEP = 5e-4  # V, to which the controller rounds TL and OF


def introduce(line: Line, settings: Controller) -> str:
    """Identify the controller, and switch its echo on.

    Returns:
        Model and firmware, as the controller reports them.

    Raises:
        RobotError: It is no Galil controller with PVT mode, or it has no echo.
    """
    line.resynchronise()
    try:
        line.ask("EO 0")
    except CommandRefused:  # the rest of a line that another host broke off
        line.ask("EO 0")
    identity = " ".join(line.ask("\x12\x16").split())
    if "DMC" not in identity:
        raise GarbledAnswer(
            f"port {line.name}: a Galil controller gives its revision as DMC..., this one answers"
            f" {identity[:40]!r}; correct controller.port in the rig file"
        )
    try:
        line.read("_PVA")
    except CommandRefused as error:
        raise RobotError(
            f"controller on {line.name}: {identity} has no PVT mode ({error.code} {error.text});"
            " update its firmware, or use a DMC-40x0 or later"
        ) from error
    line.ask("EO 1")
    line.echo = True
    try:
        verify(line, {"_EO": 1})
    except GarbledAnswer as error:
        raise SettingNotTaken(
            f"controller on {line.name}: {identity} does not echo what it receives, so that a"
            f" command corrupted on the line would be executed ({error}); connect it by a"
            " serial line or USB"
        ) from error
    return identity


def set_limits(line: Line, rig: Rig, limits: Limits) -> None:
    """Set sample period, following error, torque and software limits, and read them back.

    Raises:
        RobotError: The controller would not enforce a limit of the rig, or it does not take
            the settings.
    """
    settings, error = rig.controller, rig.controller.position_error_limit
    faults = []
    period = settings.sample_period
    if not _SAMPLE_PERIODS[0] <= period <= _SAMPLE_PERIODS[1]:
        faults.append(
            f"controller.sample_period is {period * 1e6:.6g} us, and TM 1000 gives 976 to"
            " 1000 us; correct it as the controller's manual says"
        )
    room = int((limits.upper - limits.lower).min()) // 2
    if error > room:
        faults.append(
            f"controller.position_error_limit is {error} counts, more than half of the smaller"
            f" joint range, {room} counts; lower it"
        )
    if faults:
        raise RobotError(f"rig: {'; '.join(faults)}")
    line.ask("TM 1000")
    line.ask(f"ER {error},{error}", "OE 1,1")
    line.ask(f"TL {settings.full_torque:.4f},{settings.full_torque:.4f}", "OF 0,0")
    line.ask(*software_limits(limits))
    verify(line, {"_TM": 1000, "_ERA": error, "_ERB": error, "_OEA": 1, "_OEB": 1})
    torque = settings.full_torque
    verify(line, {"_TLA": torque, "_TLB": torque, "_OFA": 0, "_OFB": 0}, _VOLTAGE_STEP)
    verify(line, software_limit_settings(limits))


def verify(line: Line, settings: Mapping[str, float], tolerance: float = 0.0) -> None:
    """Read operands back, and refuse a controller that has not taken their values."""
    values = line.read(*settings)
    faults = [
        f"{name} is {value:g} and should be {due:g}"
        for (name, due), value in zip(settings.items(), values, strict=True)
        if abs(value - due) > tolerance
    ]
    if faults:
        raise SettingNotTaken(
            f"controller on {line.name} did not take its settings: {', '.join(faults)}; compare"
            " the rig file with the controller's manual"
        )
