"""Find the port of the motor controller, and identify the controller."""

from collections.abc import Iterable
from pathlib import Path

from sautereau.rig.load import with_values
from sautereau.rig.schema import Rig
from sautereau.robot.drivers.registry import motion_controller
from sautereau.robot.drivers.serial_port import machine_ports
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.setup.step import Ask, Found, ask_first

BAUD_RATES = (115_200, 19_200, 57_600, 38_400, 9_600)
"""Bits per second that controllers are set to, the usual ones first."""


def find_port(rig: Rig, ask: Ask, ports: Iterable[str] | None = None) -> Found:
    """Try to connect at every serial port of this machine, that of the rig first.

    Args:
        ask: Asked before anything is sent to a port that is not the rig's.
        ports: Those to try; None for all of this machine.

    Raises:
        RobotError: No port has a usable controller; the message lists the answer of each.
    """
    mine = rig.controller.port
    others = [port for port in (machine_ports() if ports is None else ports) if port != mine]
    answers = []
    if "://" in mine or Path(mine).exists():
        if found := _try(rig, mine, answers):
            return found
    else:
        answers.append(f"{mine} (controller.port) does not exist")
    if others:
        ask_first(
            ask,
            "port",
            f"Send {', '.join(others)} a question that only a {rig.controller.kind} controller"
            " understands? Any other device on them may misinterpret it.",
        )
    for port in others:
        if found := _try(rig, port, answers):
            return found
    raise RobotError(
        "setup port: no usable controller was found; plug it in and switch it on, or fix what was"
        " reported:\n  " + "\n  ".join(answers)
    )


def identify(rig: Rig, ask: Ask) -> Found:
    """Connect as a press does: the controller is identified, and its limits are set and verified.

    Nothing moves, and the operator is not asked; the motors are switched off.

    Raises:
        RobotError: There is no controller, or a press cannot be made with it.
    """
    with motion_controller(rig) as controller:
        settings = rig.controller
        simulated = ", SIMULATED" if controller.simulated else ""
        return Found(
            (
                f"controller: {controller.identity}{simulated}, on {settings.port}",
                "it uses the limits of the rig; its motors are off",
            )
        )


def _try(rig: Rig, port: str, answers: list[str]) -> Found | None:
    """Return what is at a port, at any baud rate; None with the reasons added to ``answers``."""
    settings = rig.controller
    rates = dict.fromkeys((settings.baud_rate, *BAUD_RATES))
    if "://" in port:
        rates = {settings.baud_rate: None}
    reasons: dict[str, list[int]] = {}
    for rate in rates:
        values = {"controller.port": port, "controller.baud_rate": rate}
        try:
            with motion_controller(with_values(rig, values)) as controller:
                identity = controller.identity
        except RobotError as error:
            reasons.setdefault(str(error), []).append(rate)
            continue
        now = {"controller.port": settings.port, "controller.baud_rate": settings.baud_rate}
        changed = {key: value for key, value in values.items() if value != now[key]}
        return Found((f"port: {port} at {rate} baud is {identity}",), changed)
    answers += [f"at {', '.join(map(str, at))} baud: {reason}" for reason, at in reasons.items()]
    return None
