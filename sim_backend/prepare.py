"""What a bench needs of a scene: parts that fit it, and every choice made."""

from sautereau.rig.schema import Rig
from sautereau.sim_backend.devices.emulators import emulator_of
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.scene import Scene
from sautereau.sim_backend.sensors.simulated import SIMULATED


def prepared(rig: Rig, scene: Scene) -> tuple[Scene, str]:
    """Return a scene with every choice made, and the accuracy that it reaches, if it asks for one.

    Raises:
        SceneError: As of `Bench`.
    """
    faults = []
    if scene.finger == "push":
        faults.append(
            'finger: "push" has no arm for a controller to move; it is for sweeps and `trade`:'
            ' use finger = "ideal" or "servo"'
        )
    elif scene.faults is not None:
        quantities = {channel.quantity for channel in rig.daq.channels}
        faults += scene.faults.conflicts(scene.finger, quantities)
    unit = {} if scene.controller is None else {"unit": scene.controller}
    try:
        emulator_of(rig.controller.kind, **unit)
    except SceneError as error:
        faults.append(str(error))
    for i, channel in enumerate(rig.daq.channels):
        try:
            SIMULATED.get(channel.quantity)
        except SceneError as error:
            faults.append(f"daq.channels.{i}.quantity: {error}")
    if faults:
        raise SceneError("\n".join(faults))
    if scene.accuracy is None:  # only an accuracy leaves choices open
        return scene, ""
    from sautereau.sim_backend.trade.select import select_solver

    selected = select_solver(rig, scene)
    return selected.scene, str(selected)
