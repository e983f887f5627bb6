"""What emulated controllers share that keep no motion, so that the host streams it."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Generic, Protocol, TypeVar

from sautereau.sim_backend.devices.emulators import Cubic, Plant, along
from sautereau.trajectory.motion import Floats

LONGEST_WAIT = 60.0  # s, by which the host may advance simulated time at once


class StreamedAxis(Protocol):
    """One axis of such a controller."""

    cubic: Cubic
    """Reference over the sample last ticked, in encoder counts."""

    @property
    def on(self) -> bool:
        """Whether its motor has current."""
        ...

    @property
    def moving(self) -> bool:
        """Whether its setpoint changes."""
        ...

    @property
    def watched(self) -> bool:
        """Whether a watchdog runs while its motor is on."""
        ...

    def sample(self, raw: int, home: int, period: float, *, watching: bool) -> None:
        """Do one sample of the bench.

        Args:
            raw: Encoder counts now.
            home: Encoder counts at the home switch.
            period: s, of the sample.
            watching: Whether the watchdog counts: else the host is infinitely slow, but alive.
        """


AxisT = TypeVar("AxisT", bound=StreamedAxis)


class StreamedController(ABC, Generic[AxisT]):
    """An `Emulator` of two axes, with simulated time that may wait for the host (decision 0002).

    It is not thread-safe; see `GalilFirmware`.

    Args:
        period: s, of one sample of the bench.
        stepped: Whether time waits for the host while that streams setpoints.
    """

    axes: Sequence[AxisT]
    phase = 0.0
    """There is no output that could change within a sample."""

    def __init__(self, plant: Plant, period: float, *, stepped: bool):
        self.plant, self.period, self.stepped = plant, period, stepped
        self._granted = 0

    @property
    @abstractmethod
    def streaming(self) -> bool:
        """Whether the motion is the host's, position by position."""
        ...

    @property
    def motors_on(self) -> tuple[bool, bool]:
        """Whether each axis is powered."""
        first, second = self.axes
        return first.on, second.on

    @property
    def watching(self) -> bool:
        """Whether a watchdog runs while its motor is on."""
        return any(axis.watched for axis in self.axes)

    @property
    def held(self) -> bool:
        """Whether time waits for the host, which streams setpoints."""
        return self.stepped and self.streaming and not self._granted

    @property
    def moving(self) -> bool:
        """Whether time must advance, because a setpoint changes or the host waits."""
        if self.held:
            return False
        return self._granted > 0 or any(axis.moving for axis in self.axes)

    def outgoing(self) -> dict[str, bytes]:
        """Return what the controller has sent by itself: nothing."""
        return {}

    def grant(self, seconds: float | None) -> bool:
        """Let time advance by some seconds; return False where that is refused."""
        if seconds is None or not self.stepped or not 0 <= seconds <= LONGEST_WAIT:
            return False
        self._granted += max(1, round(seconds / self.period))
        return True

    def tick(self) -> None:
        """Do one sample of the bench."""
        watching = not self.stepped or (self.streaming and self._granted > 0)
        self._granted = max(0, self._granted - 1)
        counts, homes = self.plant.encoder_counts(), self.plant.home_counts()
        for axis, raw, home in zip(self.axes, counts, homes, strict=True):
            axis.sample(raw, home, self.period, watching=watching)

    def reference(self, fractions: Floats) -> tuple[Floats, Floats]:
        """Return the reference within the sample last ticked; see `Emulator`."""
        return along((axis.cubic for axis in self.axes), fractions)
