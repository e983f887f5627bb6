"""The kinds of motion controllers, by the name that a rig's `controller.kind` gives."""

from sautereau.rig.errors import RigError
from sautereau.rig.registry import Registry

_BUILT_IN = {
    "galil": "sautereau.robot.drivers.galil.driver:GalilController",
    "odrive": "sautereau.robot.drivers.odrive.driver:OdriveController",
}
CONTROLLERS = Registry("sautereau.controllers", "controller", _BUILT_IN, RigError)
"""Each is called with a `Rig` and returns a `sautereau.robot.controller.MotionController`."""


def known_kind(kind: str) -> str:
    """Return the kind of a controller.

    Raises:
        ValueError: No installed package provides it.
    """
    # Looking through the installed packages takes milliseconds, and rigs are validated often.
    if kind not in _BUILT_IN and kind not in (names := CONTROLLERS.names()):
        raise ValueError(
            f"{kind!r} is unknown; known: {', '.join(names)}. Another package adds one by an entry"
            f" point in the group {CONTROLLERS.group!r}"
        )
    return kind
