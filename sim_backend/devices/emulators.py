"""The emulated controllers: what the stand-in needs of one, and the registry of those there are."""

from collections.abc import Callable
from typing import Protocol

from sautereau.rig.registry import Registry
from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.trajectory.motion import Floats

AMPLIFIER_VOLTS = 9.998
"""V, command of an amplifier at the torque limit."""


class Plant(Protocol):
    """Motors and encoders to which a controller is wired; two axes."""

    def encoder_counts(self) -> tuple[int, int]:
        """Return the raw encoder counts since power-up."""
        ...

    def home_counts(self) -> tuple[int, int]:
        """Return the raw encoder counts at the home switches."""
        ...

    def torque_volts(self) -> tuple[float, float]:
        """Return the commands to the amplifiers [V]."""
        ...

    def drive(self, offsets: tuple[float, float], limits: tuple[float, float]) -> None:
        """Add offsets [V] to the loops' commands from now on, and limit [V] the sums."""
        ...


class Emulator(Protocol):
    """A controller as its serial line shows it. One thread at a time calls it."""

    @property
    def motors_on(self) -> tuple[bool, bool]:
        """Whether each axis is powered."""
        ...

    @property
    def moving(self) -> bool:
        """Whether simulated time must advance, for a motion or a program."""
        ...

    @property
    def watching(self) -> bool:
        """Whether it needs time only if that is paced, as a watchdog does."""
        ...

    @property
    def held(self) -> bool:
        """Whether simulated time must not advance before the host's next command."""
        ...

    def tick(self) -> None:
        """Do one controller sample."""
        ...

    def reference(self, fractions: Floats) -> tuple[Floats, Floats]:
        """Return the reference within the sample last ticked, before any tick its start.

        Where a motor is off it is the encoder's position at that tick.

        Args:
            fractions (array): shape (k,), of the sample, 0 to 1; also extrapolated beyond 1.

        Returns:
            Positions [raw encoder counts] and velocities [counts per sample], shapes (k, 2).
        """
        ...

    def receive(self, data: bytes) -> bytes:
        """Take bytes from the host; return what the controller sends back."""
        ...


OnOutput = Callable[[int, bool], None]
"""Called with number (from 1) and level when a digital output changes."""

EMULATORS = Registry(
    "sautereau.emulators",
    "emulated controller",
    {
        "galil": "sautereau.sim_backend.devices.galil.firmware:emulate",
        "odrive": "sautereau.sim_backend.devices.odrive.firmware:emulate",
    },
    SceneError,
)
"""Functions with the arguments of `new_emulator`, by the rig's `controller.kind`."""


def new_emulator(rig: Rig, plant: Plant, on_output: OnOutput, paced: bool) -> Emulator:
    """Return the emulator of a rig's controller at power-up.

    Args:
        rig: The bench.
        plant: Motors and encoders.
        on_output: Called when a digital output changes.
        paced: Whether simulated time follows real time.

    Raises:
        SceneError: No package provides an emulator of this controller.
    """
    return EMULATORS.get(rig.controller.kind)(rig, plant, on_output, paced)
