"""Which driver a rig's controller needs."""

from sautereau.rig.schema import Rig
from sautereau.robot.controller import MotionController


def motion_controller(rig: Rig) -> MotionController:
    """Return the driver of the controller of a rig, not yet connected."""
    if rig.controller.kind == "odrive":
        from sautereau.robot.drivers.odrive.driver import OdriveController

        return OdriveController(rig)
    from sautereau.robot.drivers.galil.driver import GalilController

    return GalilController(rig)
