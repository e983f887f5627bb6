"""Find the port of the motor controller, and tell which controller it is."""

from collections.abc import Iterable
from pathlib import Path

from sautereau.rig.load import with_values
from sautereau.rig.schema import Rig
from sautereau.robot.drivers.registry import motion_controller
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.setup.step import Ask, Found, ask_first

BAUD_RATES = (115_200, 19_200, 57_600, 38_400, 9_600)
"""Bits a second that controllers are set to, the usual ones first."""


def find_port(rig: Rig, ask: Ask, ports: Iterable[str] | None = None) -> Found:
    """Ask every serial port of this machine, that of the rig first, who is there.

    Args:
        rig: The bench.
        ask: Asked before anything is sent to a port that is not the rig's.
        ports: Those to try; None for all that this machine has.

    Raises:
        RobotError: No port has a controller that can be used, with what each one said.
    """
    mine = rig.controller.port
    others = [port for port in (_ports() if ports is None else ports) if port != mine]
    said = []
    if "://" in mine or Path(mine).exists():
        found = _try(rig, mine, said)
        if found is not None:
            return found
    else:
        said.append(f"{mine} (controller.port) is not there")
    if others:
        ask_first(
            ask,
            "port",
            f"Send {', '.join(others)} a question that only a {rig.controller.kind} controller"
            " understands? Whatever else hangs there may take it for something else.",
        )
    for port in others:
        found = _try(rig, port, said)
        if found is not None:
            return found
    raise RobotError(
        "setup port: no controller that can be used was found; plug it in and switch it on, or"
        " mend what was said:\n  " + "\n  ".join(said)
    )


def identify(rig: Rig, ask: Ask) -> Found:
    """Connect as a press does: identity, PVT mode, limits and program are set and read back.

    Nothing moves, and nothing is asked; the motors are switched off.

    Raises:
        RobotError: No controller, or it lacks what a press needs.
    """
    with motion_controller(rig) as controller:
        settings = rig.controller
        simulated = ", SIMULATED" if controller.simulated else ""
        return Found(
            (
                f"controller: {controller.identity}{simulated}, on {settings.port}",
                "it has taken the rig's limits; its motors are off",
            )
        )


def _ports() -> list[str]:
    from serial.tools import list_ports

    return sorted(port.device for port in list_ports.comports())


def _try(rig: Rig, port: str, said: list[str]) -> Found | None:
    """Return what is at a port, at whatever baud rate; else add why it is no use."""
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
    said += [f"at {', '.join(map(str, at))} baud: {reason}" for reason, at in reasons.items()]
    return None
