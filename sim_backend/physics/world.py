"""The simulated bench as controller and sensors see it, advanced by controller samples."""

from typing import Protocol

from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.drive import Drive
from sautereau.sim_backend.physics.events import Motions, PluckEvents
from sautereau.sim_backend.physics.finger import Finger, Reference
from sautereau.sim_backend.scene import Scene


class World(Protocol):
    """The physics of a scene; the same `Scene`, rig and references give the same bits."""

    rig: Rig
    """The true bench."""
    start: tuple[float, float]
    """rad, joints when power came on."""
    radians_per_count: float
    """rad, of an encoder count."""
    samples: int
    """Controller samples done."""
    events: PluckEvents
    """Events of the strings: ground truth that no recording contains."""

    @property
    def time(self) -> float:
        """Simulated time [s]; advanced by motion and acquisition only."""
        ...

    @property
    def finger(self) -> Finger:
        """What presses the key."""
        ...

    def advance(self, reference: Reference, powered: bool) -> Motions:
        """Advance by one controller sample.

        Args:
            reference: Of the arm over this sample, in raw encoder counts.
            powered: Whether the motors are on.

        Raises:
            SceneError: The simulation diverged.
        """
        ...

    def play(self, drive: Drive) -> Motions:
        """Advance through a complete drive, with the motors on; see `advance`."""
        ...


def new_world(rig: Rig, scene: Scene, start: tuple[float, float] | None = None) -> World:
    """Return the world of a scene, by the scene's engine.

    Args:
        rig: The nominal bench; the true one may differ by the scene's `truth`.
        scene: With a chosen step and engine.
        start: rad, joints when power comes on; None for home and the scene's offset.

    Raises:
        SceneError: The scene cannot be simulated, or a choice is left to its accuracy.
    """
    auto = [name for name in ("engine", "plectrum", "string") if getattr(scene, name) == "auto"]
    if scene.step is None:
        auto.insert(0, "step")
    if auto:
        raise SceneError(
            f"scene: {', '.join(auto)} is left to the accuracy of {scene.accuracy}; choose it first"
            " with `sautereau.sim_backend.trade.select.select_solver`"
        )
    if scene.engine == "exact":
        from sautereau.sim_backend.physics.exact.engine import ExactWorld

        return ExactWorld(rig, scene, start)
    from sautereau.sim_backend.physics.rigid.engine import RigidWorld

    return RigidWorld(rig, scene, start)
