"""Which controller the stand-in emulates."""

from collections.abc import Callable

from sautereau.rig.schema import Rig
from sautereau.sim_backend.devices.galil.firmware import GalilFirmware
from sautereau.sim_backend.devices.galil.machine import Plant
from sautereau.sim_backend.devices.odrive.firmware import OdriveFirmware
from sautereau.sim_backend.devices.plant import AMPLIFIER_VOLTS


def new_firmware(
    rig: Rig, plant: Plant, on_output: Callable[[int, bool], None], paced: bool
) -> GalilFirmware | OdriveFirmware:
    """Return the firmware of a rig's controller at power-up.

    Args:
        rig: The bench.
        plant: What amplifiers and encoders are wired to.
        on_output: Called with number (from 1) and level when a digital output changes.
        paced: Whether simulated time keeps to the wall clock.
    """
    if rig.controller.kind == "galil":
        return GalilFirmware(plant, on_output=on_output, host_waits=not paced)
    counts = rig.arm.counts_per_revolution
    first, second = rig.arm.gear_ratios
    per_volt = rig.arm.torque_limit / AMPLIFIER_VOLTS
    return OdriveFirmware(
        plant,
        per_turn=(counts / first, counts / second),
        period=rig.controller.sample_period,
        stepped=not paced,
        trigger=rig.controller.trigger_output,
        torque_per_volt=(per_volt / first, per_volt / second),
        on_output=on_output,
    )
