"""The world of a scene, by its engine."""

from sautereau.rig.acquisition import OF_STRING
from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.base import World
from sautereau.sim_backend.scene import Scene


def new_world(rig: Rig, scene: Scene, start: tuple[float, float] | None = None) -> World:
    """Return the world of a scene, by the scene's engine.

    Args:
        rig: The nominal bench; the true one may differ by the scene's `truth`.
        scene: With a chosen step and engine.
        start: rad, joints when power comes on; None for home and the scene's offset.

    Raises:
        SceneError: The scene cannot be simulated, or a choice is left to its accuracy.
    """
    scene = scene.with_engine()
    auto = [name for name in ("engine", "string") if getattr(scene, name) == "auto"]
    if scene.step is None:
        auto.insert(0, "step")
    if auto:
        raise SceneError(
            f"scene: {', '.join(auto)} is left to the accuracy of {scene.accuracy}; choose it first"
            " with `sautereau.sim_backend.trade.select.select_solver`"
        )
    of_strings = [own.name for own in rig.daq.channels if own.quantity in OF_STRING]
    if of_strings and scene.string != "modal":
        raise SceneError(
            f"daq.channels: {', '.join(of_strings)}: a scene with string = {scene.string!r} has no"
            ' vibrating string to measure; give it string = "modal", or remove the channels'
        )
    if scene.engine == "exact":
        from sautereau.sim_backend.physics.exact_world import ExactWorld

        return ExactWorld(rig, scene, start)
    from sautereau.sim_backend.physics.rigid.engine import RigidWorld

    return RigidWorld(rig, scene, start)
