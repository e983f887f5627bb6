"""Make sure of the controller at the other end, and set what a press relies on."""

from collections.abc import Mapping

from rig.schema import Controller
from robot.errors import CommandRefused, GarbledAnswer, RobotError, SettingNotTaken
from robot.line import Line

_SAMPLE_PERIODS = (970e-6, 1001e-6)  # s, what firmwares make of TM 1000


def introduce(line: Line, settings: Controller) -> str:
    """Silence the echo, identify the controller, set sample period and error limits.

    Returns:
        Model and firmware, as the controller says them.

    Raises:
        RobotError: No Galil controller with PVT mode, or it does not take the settings.
    """
    line.resynchronise()
    try:
        line.ask("EO 0")
    except CommandRefused:  # the rest of a line that another host broke off
        line.ask("EO 0")
    identity = " ".join(line.ask("\x12\x16").split())
    if "DMC" not in identity:
        raise GarbledAnswer(
            f"port {line.name}: a Galil controller gives its revision as DMC..., this one says"
            f" {identity[:40]!r}; correct controller.port in the rig file"
        )
    try:
        line.read("_PVA")
    except CommandRefused as error:
        raise RobotError(
            f"controller on {line.name}: {identity} has no PVT mode ({error.code} {error.text});"
            " update its firmware, or use a DMC-40x0 or later"
        ) from error
    period = settings.sample_period
    if not _SAMPLE_PERIODS[0] <= period <= _SAMPLE_PERIODS[1]:
        raise RobotError(
            f"rig: controller.sample_period is {period * 1e6:.6g} us, and TM 1000 gives 976 to"
            " 1000 us; correct it as the controller's manual says"
        )
    limit = settings.position_error_limit
    line.ask("TM 1000")
    verify(line, {"_TM": 1000})
    line.ask(f"ER {limit},{limit}", "OE 1,1")
    verify(line, {"_ERA": limit, "_ERB": limit, "_OEA": 1, "_OEB": 1})
    return identity


def verify(line: Line, settings: Mapping[str, int]) -> None:
    """Read operands back and refuse a controller that has not taken their values."""
    values = line.read(*settings)
    faults = [
        f"{name} is {value:g} and should be {wanted}"
        for (name, wanted), value in zip(settings.items(), values, strict=True)
        if value != wanted
    ]
    if faults:
        raise SettingNotTaken(
            f"controller on {line.name} did not take its settings: {', '.join(faults)}; compare"
            " the rig file with the controller's manual"
        )
