"""The table `[controller]` of a scene: the bench's motor controller, as it was bought and wired.

That includes what was burned into it before the first connection.
"""

import re
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from sautereau.rig.units import Angle, Section, Time

_FAMILIES = {
    "40": "4000",
    "41": "4103",
    "42": "4200",
    "21": "2103",
    "18": "1806",
    "30": "30010",
    "50": "50000",
    "52": "52000",
}


def _known_model(text: str) -> str:
    if not re.fullmatch(r"DMC[0-9]{4,5}", text) or text[3:5] not in _FAMILIES:
        families = ", ".join(f"DMC{start}.." for start in _FAMILIES)
        raise ValueError(f"model: {text!r} is not a known controller; give one of {families}")
    return text


class ControllerUnit(Section):
    """The Galil controller as it was bought and configured. Behaviour that the manufacturer's
    reference does not specify can be set either way, to test both."""

    model: Annotated[str, AfterValidator(_known_model)] = "DMC4020"
    """Model number, as the controller gives it in its answer to ^R^V."""
    firmware: str = Field(default="1.3a", pattern=r"^[0-9]\.[0-9][a-z][0-9]*(-[A-Z]+)?$")
    """Revision. Firmware `...-FAST` has no PVT mode; before 1.2a there are fewer lines and array
    elements, and `AT n,1` is unknown."""
    serial_number: int = Field(default=12_345, ge=1)
    """Serial number of the processor board."""
    interface: Literal["rs232", "usb", "ethernet"] = "rs232"
    """Port to the host; `ethernet` is a TCP port with eight handles, `tcp://127.0.0.1:port`, that
    never echoes."""
    baud_rate: int = Field(default=0, ge=0, le=921_600)
    """Bits per second at which a serial line carries its characters, 10 bits each, in simulated
    time; 0 for a line that takes no time."""
    input_buffer: int = Field(default=512, ge=16)
    """Characters that wait while parameters are burned; later ones are lost, with error 5."""
    line_length: int = Field(default=80, ge=40, le=80)
    """Characters in a line of a program or of a command."""
    burned: tuple[str, ...] = ("MO",)
    """Commands that were given and burned by `BN` before, such as `"BW 100"` (a brake on the
    output) or `"CN 1"`; without `MO` motors start powered."""
    burned_program: str = ""
    """Program burned by `BP`, with its lines; `#AUTO` runs at power-up."""
    amplifier: Literal["none", "D3040", "D3240", "D3540", "D3547", "D3640"] = "none"
    """Internal amplifier, which limits `TL` at its largest gain."""
    output_inverted: bool = False
    """Whether the output module makes `SB` a falling edge at the card."""
    output_delay: Time = Field(default=0.0, ge=0, le=0.1)
    """s, of the output's optocoupler."""
    index_angles: tuple[Angle, Angle] = (0.1, 0.1)
    """rad, of each joint from its home switch to the encoder's index, which recurs every
    revolution of the motor."""
    limit_switches: bool = False
    """Whether there are limit switches, at the limits of the arm's joints."""
    odd_pvt: Literal["truncate", "refuse"] = "truncate"
    """What happens to odd velocities and times of `PV`."""
    pvt_error_limit: bool = True
    """Whether `ER` with `OE` ends a PVT motion."""
    pvt_soft_limits: bool = True
    """Whether `FL` and `BL` end a PVT motion."""
    underrun: Literal["decelerate", "stop"] = "decelerate"
    """How a PVT motion ends at speed when its buffer is empty."""
    error_routine: bool = True
    """Whether `#CMDERR` is entered after a refused command of a program."""
    recorded_torque: Literal["integer", "volts"] = "integer"
    """What a recorded `_TT` holds: 32767 for 10 V, or volts."""
    at_jitter: int = Field(default=0, ge=0, le=16)
    """Samples by which `AT` may be late."""
    control_z: Literal["line", "attached"] = "line"
    """Place of the control-Z after an upload: on its own line, or after the last number."""
    usb_echo: bool = True
    """Whether a USB port echoes after power-up, as RS-232 does."""

    @property
    def family(self) -> str:
        """Family of the model, as in the reference's lists."""
        return _FAMILIES[self.model[3:5]]

    @property
    def revision(self) -> str:
        """Answer to ^R^V."""
        return f"{self.model} Rev {self.firmware}-SIM sautereau stand-in"

    @property
    def has_pvt(self) -> bool:
        """Whether the firmware has the PVT mode."""
        return not self.firmware.endswith("-FAST")

    @property
    def large_memory(self) -> bool:
        """Whether the firmware is 1.2a or later: 4,000 lines and 24,000 array elements."""
        return self.firmware.split("-")[0] >= "1.2a"
