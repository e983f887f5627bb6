"""The motor controller in numbers: its line, its limits, its switches, what was measured of it."""

from typing import Annotated, Literal

from pydantic import Field

from sautereau.rig.registry import CONTROLLERS, NameIn
from sautereau.rig.units import Angle, Section, Time, Voltage

Fraction = Annotated[float, Field(strict=True, gt=0, le=1)]


class Controller(Section):
    """The motor controller."""

    kind: Annotated[str, NameIn(CONTROLLERS, imported=False)] = "galil"
    """`galil` (DMC-4x), `odrive` (3.x with firmware 0.5.6), or a kind of another package."""
    port: str = Field(min_length=1)
    """Serial device; or `tcp://host:port` of a controller on Ethernet (the port of a Galil is 23);
    or pyserial's `socket://` or `rfc2217://` for a serial port behind a network."""
    baud_rate: int = Field(strict=True, gt=0)
    """Bits per second of a serial port."""
    timeout: Time = Field(gt=0)
    """s, maximum time to wait for an answer of the controller."""
    sample_period: Time = Field(gt=0)
    """s, duration of one controller sample. With TM 1000 it is 976 us, not 1 ms."""
    segment_limit: int = Field(strict=True, ge=8)
    """Number of PVT segments that the controller's FIFO holds for each axis."""
    position_error_limit: int = Field(strict=True, gt=0)
    """Following error, in counts, at which the controller switches the motors off."""
    full_torque: Voltage = Field(default=9.998, gt=0, le=9.998)
    """V, command to the amplifier that corresponds to `arm.torque_limit`."""
    watchdog_period: Time = Field(default=0.5, ge=0.1, le=5)
    """s, time without a command from the host after which the controller switches the motors
    off."""
    encoder_loss_torque: Fraction = 0.6
    """Dimensionless, fraction of the torque limit. If an encoder does not move at a larger torque,
    it counts as lost, and its motor is switched off. The fraction must be larger than the weight of
    the arm needs."""
    encoder_loss_time: Time = Field(default=0.1, ge=0.01, le=5)
    """s, time for which an encoder may be at rest at that torque."""

    trigger_output: int = Field(strict=True, ge=1, le=16)
    """Digital output wired to the acquisition's trigger input."""
    trigger_delay: Time = Field(default=0.49e-3, ge=-0.05, le=0.05)
    """s, time from the output's edge at the acquisition to the start of the motion. The output is
    set when its command runs, the motion starts at the next sample, and the output's circuit delays
    the edge."""
    trigger_delay_std: Time = Field(default=0.28e-3, ge=0, le=0.05)
    """s, standard uncertainty of `trigger_delay`."""

    limit_switches: Literal["active_low", "active_high", "none"] = "active_low"
    """State of the input at which a joint stops: grounded (`active_low`), or open (`active_high`,
    with normally closed switches, so that a broken wire also stops the arm). `none` if there are no
    limit switches."""
    home_grounded: Literal["below", "above"] = "below"
    """Side of home on which the home switch grounds its input: `below` is towards smaller
    angles."""
    home_approach: Literal["forward", "backward"] = "forward"
    """Direction of the final search for home: `forward` is towards larger angles."""
    home_index: bool = Field(default=False, strict=True)
    """Whether home is the next index of the encoder beyond the switch, in the direction
    of `home_approach`."""
    home_travel: Angle = Field(default=3.2, gt=0)
    """rad, maximum travel of a joint in the search for home. The controller stops it there."""
    home_torque: Fraction = 0.5
    """Dimensionless, maximum torque during homing, as a fraction of the torque limit."""
    home_tolerance: int = Field(default=100, strict=True, gt=0)
    """Maximum difference, in counts, between two searches for the same home switch."""

    verified: str = ""
    """Model, firmware and serial number of the controller that `sautereau setup verify` has
    verified. Written by that command."""
    verified_settings: str = ""
    """Settings in the memory of the controller at the verification."""
    verified_on: str = ""
    """Date of the verification."""
    verified_results: tuple[str, ...] = ()
    """Results of the steps of the verification, and what they could not measure."""
