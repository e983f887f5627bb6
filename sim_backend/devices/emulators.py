"""The emulated controllers: their interface, their registry, and their references."""

import functools
import inspect
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np

from sautereau.rig.registry import Registry
from sautereau.sim_backend.errors import SceneError
from sautereau.trajectory.motion import Floats

Cubic = tuple[float, float, float, float]
"""Coefficients of a0 + a1 f + a2 f^2 + a3 f^3 [counts], where f is the fraction of a sample."""

AMPLIFIER_VOLTS = 9.998  # V, command of an amplifier at the torque limit


class Plant(Protocol):
    """Motors and encoders to which a controller is wired; two axes."""

    def encoder_counts(self) -> tuple[int, int]:
        """Return the raw encoder counts since power-up."""
        ...

    def home_counts(self) -> tuple[int, int]:
        """Return the raw encoder counts at the home switches."""
        ...

    def index(self, axis: int) -> int | None:
        """Return the raw counts of the encoder index that passed in the last sample, or None."""
        ...

    def active(self, switch: str, axis: int) -> bool:
        """Return whether current flows in an input: forward, reverse, home or abort."""
        ...

    def amplifier_fault(self, axis: int) -> bool:
        """Return whether an axis's amplifier reports a fault."""
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
            fractions (array): shape (k,), of the sample, 0 to 1; also extrapolated beyond 1.

        Returns:
            Positions [raw encoder counts] and velocities [counts per sample], shapes (k, 2).
        """
        ...

    @property
    def line_busy(self) -> bool:
        """Whether characters are under way on a serial line, which takes real time for them."""
        ...

    @property
    def phase(self) -> float:
        """Fraction of the sample that has passed when an output changes within a tick."""
        ...

    def outgoing(self) -> Mapping[str, bytes]:
        """Return what the controller has sent by itself since the last call, by port."""
        ...

    def receive(self, data: bytes) -> bytes:
        """Take bytes from the host; return what the controller sends back."""
        ...


SERIAL = "S"  # Letter of the serial port, as `Emulator.outgoing` names it


class Handles(Protocol):
    """What has one handle, named by a letter, for each TCP connection."""

    def connect(self, peer: int) -> str | None:
        """Open a connection from a host's TCP port; return its handle, None if all are in use."""
        ...

    def connected(self, letter: str, /) -> bool:
        """Return whether a handle is open."""
        ...

    def disconnect(self, letter: str, /) -> None:
        """Lose a TCP connection."""

    def receive(self, data: bytes, letter: str = SERIAL) -> bytes:
        """Take bytes from the host at a port; return what the controller sends back."""
        ...


@runtime_checkable
class Networked(Handles, Emulator, Protocol):
    """An emulator with Ethernet as well."""

    def miss_acknowledgement(self, letter: str, /) -> None:
        """Give a handle up after some retries, because its host does not acknowledge a message."""


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
"""Functions that return an `Emulator` at power-up, by the rig's `controller.kind`.

Their arguments are the `Rig`, the `Plant`, an `OnOutput`, and whether simulated time follows real
time; and `unit`, the scene's table `[controller]`, if it has one and the function takes it.
"""


def emulator_of(kind: str, **unit: Any) -> Callable[..., Emulator]:
    """Return the function of `EMULATORS` for a kind of controller, with the scene's table.

    Args:
        kind: The rig's `controller.kind`.
        unit: The scene's table `[controller]` under that name; nothing where it has none.

    Raises:
        SceneError: No package emulates it, or it takes no such table.
    """
    emulate = EMULATORS.get(kind)
    if unit and "unit" not in inspect.signature(emulate).parameters:
        raise SceneError(
            f'controller: the stand-in of a rig with controller.kind = "{kind}" takes no such'
            " table; remove it"
        )
    return functools.partial(emulate, **unit)


def hermite(start: float, step: float, v0: float, v1: float) -> Cubic:
    """Return the cubic over a sample that advances by a step [counts], from velocity v0 to v1."""
    return start, v0, 3 * step - 2 * v0 - v1, v0 + v1 - 2 * step


def along(cubics: Iterable[Cubic], fractions: Floats) -> tuple[Floats, Floats]:
    """Return positions and velocities of two axes within a sample.

    Args:
        cubics: Of both axes.
        fractions (array): shape (k,), of the sample, 0 to 1; also extrapolated beyond 1.

    Returns:
        Positions [counts] and velocities [counts per sample], shapes (k, 2).
    """
    # In plain floats: numpy takes four times as long for the few fractions of a sample.
    (a0, a1, a2, a3), (b0, b1, b2, b3) = cubics
    positions, velocities = [], []
    for f in fractions.tolist():
        positions.append((a0 + f * (a1 + f * (a2 + f * a3)), b0 + f * (b1 + f * (b2 + f * b3))))
        velocities.append((a1 + f * (2 * a2 + 3 * f * a3), b1 + f * (2 * b2 + 3 * f * b3)))
    return np.array(positions), np.array(velocities)
