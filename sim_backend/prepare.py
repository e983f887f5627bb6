"""Make a scene ready for a controller and a card, or say why it is not."""

from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.scene import Scene


def prepared(rig: Rig, scene: Scene) -> tuple[Scene, str]:
    """Return a scene with every choice made, and what accuracy it reaches, if one was asked for.

    Args:
        rig: The nominal bench.
        scene: What is to be simulated.

    Raises:
        SceneError: The scene has no arm, or faults that cannot strike on this bench, or it
            asks for an accuracy that cannot be had.
    """
    _check(rig, scene)
    if scene.accuracy is None:  # "auto" needs one
        return scene, ""
    from sautereau.sim_backend.trade.choose import settle

    settled = settle(rig, scene)
    return settled.scene, str(settled)


def _check(rig: Rig, scene: Scene) -> None:
    """Refuse a scene that is none for a controller and a card."""
    faults = []
    if scene.finger == "push":
        faults.append(
            'finger: "push" has no arm for a controller to move; it is for sweeps and `trade`:'
            ' take finger = "ideal" or "servo"'
        )
    elif scene.faults is not None:
        quantities = {channel.quantity for channel in rig.daq.channels}
        faults += scene.faults.misfits(scene.finger, quantities)
    if faults:
        raise SceneError("\n".join(faults))
