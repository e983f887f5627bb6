"""Which driver a rig's controller needs."""

from rig.schema import Rig
from robot.controller import MotionController


def motion_controller(rig: Rig) -> MotionController:
    """Return the driver of the controller of a rig, not yet connected."""
    if rig.controller.kind == "odrive":
        from robot.odrive.driver import OdriveController

        return OdriveController(rig)
    from robot.galil.driver import GalilController

    return GalilController(rig)
