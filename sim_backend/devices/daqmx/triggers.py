"""Start and reference triggers of a task, as they are configured."""

import re
from dataclasses import dataclass

from sautereau.sim_backend.devices.daqmx.card import Card, DaqmxError, owner_of
from sautereau.sim_backend.devices.daqmx.inputs import invalid

NONE, DIGITAL_EDGE, ANALOG_EDGE, ANALOG_WINDOW = 10230, 10150, 10099, 10103  # Types of a trigger
RISING, FALLING = 10280, 10171


@dataclass
class Trigger:
    """One trigger; sources and slopes are those of its type."""

    kind: int = NONE
    source: str = ""
    edge: int = RISING

    def verify(self, card: Card) -> None:
        """Refuse what the device, or the stand-in, cannot do."""
        if self.kind == NONE:
            return
        if self.kind != DIGITAL_EDGE:
            raise DaqmxError(
                -200452,
                "The stand-in has no analog comparator: analog triggers can be configured, not"
                " started. Use a digital edge.",
            )
        if self.edge not in (RISING, FALLING):
            raise invalid("DigEdge.Edge", self.edge, "rising or falling")
        self.route(card)

    def route(self, card: Card) -> str:
        """Return the complete name of its source: ``/Dev1/PFI0``.

        Raises:
            DaqmxError: The device has no such terminal.
        """
        return terminal(self.source, card)


def terminal(name: str, card: Card) -> str:
    """Return the complete name of a terminal, ``/Dev1/PFI0``, of the device or its chassis."""
    owner = owner_of(card)
    route = re.fullmatch(r"(?:/(\w+)/)?(A?PFI)(\d+)", name, re.IGNORECASE)
    if route:
        known = (route[1] or owner).lower() == owner.lower()
        local = f"{route[2]}{int(route[3])}".upper()
        if known and local in terminals(card):
            return f"/{owner}/{local}"
    raise DaqmxError(
        -89120,
        "Source terminal to be routed could not be found on the device.\n"
        f"Device: {owner}\nSource Terminal: {name}",
    )


def terminals(card: Card) -> list[str]:
    """Return the trigger terminals without the device."""
    device = card.modules[0].device
    return [*(f"PFI{n}" for n in range(device.triggers)), *device.analog_triggers]
