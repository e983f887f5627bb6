"""The motion controller that a rig names, by `controller.kind`."""

from sautereau.rig.registry import CONTROLLERS
from sautereau.rig.schema import Rig
from sautereau.robot.controller import MotionController


def motion_controller(rig: Rig) -> MotionController:
    """Return the controller of a rig, not yet connected.

    Raises:
        RigError: No installed package provides `controller.kind`, or importing it failed.
    """
    return CONTROLLERS.get(rig.controller.kind)(rig)
