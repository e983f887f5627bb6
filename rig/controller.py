"""The motor controller in numbers: its line, its limits, its switches, what was measured of it."""

from typing import Annotated, Literal

from pydantic import Field

from sautereau.rig.registry import CONTROLLERS, NameIn
from sautereau.rig.section import Angle, Section, Time, Voltage

Fraction = Annotated[float, Field(strict=True, gt=0, le=1)]


class Controller(Section):
    """The motor controller."""

    kind: Annotated[str, NameIn(CONTROLLERS, imported=False)] = "galil"
    """`galil` (DMC-4x), `odrive` (3.x with firmware 0.5.6), `dynamixel` (bus
    servos of the X series), or a kind of another package."""
    port: str = Field(min_length=1)
    """Serial device, `tcp://host:port` of a controller on Ethernet (a Galil's port is 23), or
    pyserial's `socket://` or `rfc2217://` of a port behind a network."""
    baud_rate: int = Field(strict=True, gt=0)
    """Bits per second of a serial port."""
    timeout: Time = Field(gt=0)
    """s, longest wait for an answer of the controller."""
    sample_period: Time = Field(gt=0)
    """s, of one controller sample; with TM 1000 it is 976 us, not 1 ms."""
    segment_limit: int = Field(strict=True, ge=8)
    """PVT segments that the controller's FIFO holds for each axis."""
    position_error_limit: int = Field(strict=True, gt=0)
    """Counts of following error at which the controller switches the motors off."""
    full_torque: Voltage = Field(default=9.998, gt=0, le=9.998)
    """V, command to an amplifier that corresponds to `arm.torque_limit`."""
    watchdog_period: Time = Field(default=0.5, ge=0.1, le=5)
    """s, time without a command from the host; then the controller switches the motors off."""
    encoder_loss_torque: Fraction = 0.6
    """Dimensionless, fraction of the torque limit: an encoder that is at rest at more torque
    than this counts as lost, and its motor is switched off. More than the weight needs."""
    encoder_loss_time: Time = Field(default=0.1, ge=0.01, le=5)
    """s, that an encoder may be at rest at that torque."""

    trigger_output: int = Field(strict=True, ge=1, le=16)
    """Digital output wired to the acquisition's trigger input."""
    trigger_delay: Time = Field(default=0.49e-3, ge=-0.05, le=0.05)
    """s, from the output's edge at the acquisition to the start of the motion: the output is set
    when its command is interpreted, the motion starts at the next sample, and the output's
    circuit delays the edge."""
    trigger_delay_std: Time = Field(default=0.28e-3, ge=0, le=0.05)
    """s, standard uncertainty of that delay."""

    limit_switches: Literal["active_low", "active_high", "none"] = "active_low"
    """Input of a limit switch at which the joint stops: grounded (`active_low`), open
    (`active_high`, with normally closed switches, so that a broken wire stops the arm too), or
    `none` where there are no limit switches."""
    home_grounded: Literal["below", "above"] = "below"
    """The side of home, towards smaller or larger angles, on which the home switch grounds its
    input."""
    home_approach: Literal["forward", "backward"] = "forward"
    """Direction in which home is found in the end: towards larger angles, or smaller."""
    home_index: bool = Field(default=False, strict=True)
    """Whether home is the encoder's next index beyond the switch, in that direction."""
    home_travel: Angle = Field(default=3.2, gt=0)
    """rad, farthest that a joint travels to find its home; the controller stops it there."""
    home_torque: Fraction = 0.5
    """Dimensionless, fraction of the torque limit while home is sought."""
    home_tolerance: int = Field(default=100, strict=True, gt=0)
    """Counts by which a home switch may differ from its position when it is found again."""

    verified: str = ""
    """Controller that `sautereau setup verify` has verified: its model, firmware and serial
    number, written by that command."""
    verified_settings: str = ""
    """Settings that the controller kept in its memory when it was verified."""
    verified_on: str = ""
    """Date of that verification."""
    verified_results: tuple[str, ...] = ()
    """What each of its steps has found, and what it could not measure."""
