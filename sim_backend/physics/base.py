"""The simulated bench as controller and sensors see it, advanced by controller samples."""

import math
from abc import ABC, abstractmethod

from sautereau.analysis.model.string.string import ModalState
from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.drive import Drive
from sautereau.sim_backend.physics.events import Motions, PluckEvents
from sautereau.sim_backend.physics.finger import Finger, Reference
from sautereau.sim_backend.physics.structures import LARGEST_ANGLE
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.motion import Floats

TURNED_OVER = (
    f"the key has turned by {LARGEST_ANGLE:g} rad, the limit of the model; lower the push, or"
    " enable the felt in the scene"
)


class World(ABC):
    """The physics of a scene; the same `Scene`, rig and references give the same bits.

    Args:
        rig: The nominal bench; the true one may differ by the scene's `truth`.
        scene: With its step.
        start: rad, joints when power comes on; None for home and the scene's offset.

    Raises:
        SceneError: The scene has a part of which the rig has no values.
    """

    finger: Finger
    """What presses the key."""

    def __init__(self, rig: Rig, scene: Scene, start: tuple[float, float] | None = None):
        self.rig = rig = scene.true_rig(rig)
        """The true bench."""
        home, offset = rig.arm.home_angles, scene.start_offset
        self.start = start or (home[0] + offset[0], home[1] + offset[1])
        """rad, joints when power came on."""
        self.radians_per_count = rig.arm.radians_per_count
        """rad, of an encoder count."""
        self.samples = 0
        """Controller samples done."""
        self.events = PluckEvents()
        """Events of the strings: ground truth that no recording contains."""

    @property
    def time(self) -> float:
        """Simulated time [s]; advanced by motion and acquisition only."""
        return self.samples * self.rig.controller.sample_period

    @abstractmethod
    def advance(self, reference: Reference, powered: bool) -> Motions:
        """Advance by one controller sample.

        Args:
            reference: Of the arm over this sample, in raw encoder counts.
            powered: Whether the motors are on.

        Raises:
            SceneError: The simulation diverged.
        """

    def string_modes(self, number: int, times: Floats) -> ModalState:
        """Return the upward motion of a string's modes at past times [s], shape (n, modes) each.

        Args:
            number: Of the string, from 1; a channel of the rig measures it.

        Raises:
            SceneError: The scene's strings do not vibrate.
        """
        raise SceneError(f"string {number}: the scene's strings do not vibrate")

    @abstractmethod
    def play(self, drive: Drive) -> Motions:
        """Advance through a complete drive, with the motors on; see `advance`."""


def steps_in_sample(rig: Rig, step: float) -> int:
    """Return the least number of steps in a controller sample, each at most ``step`` [s] long."""
    return math.ceil(rig.controller.sample_period / step - 1e-9)
