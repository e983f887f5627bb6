"""Check that a scene can drive a controller and a card, and choose what it leaves open."""

from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.scene import Scene
from sautereau.sim_backend.sensors.simulated import simulated_quantity


def prepared(rig: Rig, scene: Scene) -> tuple[Scene, str]:
    """Return a scene with every choice made, and the accuracy that it reaches, if it asks for one.

    Args:
        rig: The nominal bench.
        scene: The scene to simulate.

    Raises:
        SceneError: The scene has no arm, or faults that cannot occur on this bench; a channel
            measures a quantity that no package simulates; or the accuracy cannot be reached.
    """
    _check(rig, scene)
    if scene.accuracy is None:  # only an accuracy leaves choices open
        return scene, ""
    from sautereau.sim_backend.trade.select import select_solver

    selected = select_solver(rig, scene)
    return selected.scene, str(selected)


def _check(rig: Rig, scene: Scene) -> None:
    """Refuse a scene that cannot drive a controller and a card."""
    faults = []
    if scene.finger == "push":
        faults.append(
            'finger: "push" has no arm for a controller to move; it is for sweeps and `trade`:'
            ' use finger = "ideal" or "servo"'
        )
    elif scene.faults is not None:
        quantities = {channel.quantity for channel in rig.daq.channels}
        faults += scene.faults.conflicts(scene.finger, quantities)
    for i, channel in enumerate(rig.daq.channels):
        try:
            simulated_quantity(channel.quantity)
        except SceneError as error:
            faults.append(f"daq.channels.{i}.quantity: {error}")
    if faults:
        raise SceneError("\n".join(faults))
