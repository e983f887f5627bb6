"""The interface of every acquisition device, and the function that opens a rig's device."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol, Self

from sautereau.daq.file.recorded import Block
from sautereau.daq.file.samples import Scaling
from sautereau.rig.acquisition import Daq
from sautereau.rig.registry import SOURCES
from sautereau.rig.schema import Rig


@dataclass(frozen=True)
class InputSettings:
    """One input as the device has accepted it."""

    name: str
    terminal: str
    """Terminal with the device's name: ``Dev1/ai0``."""
    sensor: str
    range: float
    """Requested range, largest magnitude, V."""
    device_low: float
    """Lower end of the device's input range, V."""
    device_high: float
    """Upper end of the device's input range, V."""
    terminal_configuration: str | None
    """How it is referenced to ground: `rse`, `nrse`, `diff`, `pseudo_diff`; None if unknown."""
    coupling: str | None
    """`ac` or `dc`; None if unknown."""
    excitation: float | None
    """Current for the sensor, A; None if the device supplies none."""
    delay: float
    """Delay of its samples after the signal at the terminal, s; negative if the input is sampled
    later than the first one."""


@dataclass(frozen=True)
class SourceSettings:
    """An acquisition as the device has accepted it: the result of a dry run."""

    device: str
    """Product type, serial number and name of the device."""
    simulated: bool
    channels: tuple[InputSettings, ...]
    requested_rate: float
    """Sampling rate that the rig requests, Hz."""
    rate: float
    """Sampling rate of every channel, Hz."""
    n_samples: int | None
    """Samples of each channel; None to continue until it is stopped."""
    pre_trigger_samples: int
    """Samples of each channel before the edge, included in ``n_samples``."""
    buffer: int
    """Samples of each channel that the buffer holds."""
    block: int
    """Samples of each channel read at a time."""
    trigger: str
    """Terminal whose edge starts it; empty if it starts immediately."""


class Source(Protocol):
    """An acquisition of all channels of a rig's ``daq``, as a context manager.

    Entering it opens and reserves the device, leaving it frees the device, also after an error.
    Without `start` it is a dry run. Every fault is a `sautereau.daq.errors.DaqError`.
    """

    @property
    def n_samples(self) -> int | None:
        """Number of samples of each channel, those before the edge included; None if endless."""
        ...

    @property
    def rate(self) -> float:
        """Actual sampling rate of every channel, Hz; known after entering."""
        ...

    @property
    def simulated(self) -> bool:
        """Whether the device reports that it is simulated; known after entering."""
        ...

    @property
    def scaling(self) -> Scaling | None:
        """What the counts in its blocks are; None if they are volts. Known after entering."""
        ...

    @property
    def device_description(self) -> str:
        """Product and name of the device; empty before entering."""
        ...

    def settings(self) -> SourceSettings:
        """Return the acquisition as the device has accepted it."""
        ...

    def of_device(self, rig: Rig) -> Rig:
        """Return a rig whose channels have the delays that the device reports."""
        ...

    def start(self) -> None:
        """Arm it: the trigger's edge starts it; without a trigger it starts now.

        Returns when enough samples before the edge have been acquired.
        """
        ...

    def blocks(self) -> Iterator[Block]:
        """Yield consecutive blocks; the index of the first is negative with a pre-trigger."""
        ...

    def stop(self) -> None:
        """End it, complete or not."""
        ...

    def __enter__(self) -> Self:
        """Open and reserve the device."""
        ...

    def __exit__(self, *exception: object) -> None:
        """Free the device."""
        ...


def open_source(daq: Daq, duration_s: float | None, *, triggered: bool = True) -> Source:
    """Return the acquisition that ``daq.driver`` names, not yet entered.

    Args:
        daq: The rig's table of the acquisition.
        duration_s: Duration after the trigger's edge or the start, s; None to continue until the
            context is left.
        triggered: Whether the trigger's edge starts it, with ``daq.pre_trigger`` recorded before
            the edge; if not, `Source.start` starts it.

    Raises:
        DaqError: The settings are impossible for any device of that kind.
    """
    return SOURCES.get(daq.driver)(daq, duration_s, triggered=triggered)
