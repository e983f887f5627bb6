"""What a recording holds, once read."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sautereau.daq.file.session_info import SessionInfo
from sautereau.rig.schema import Rig

Signal = NDArray[np.float64]


@dataclass(frozen=True)
class Plan:
    """The planned motion: arrays of shape (n_points,)."""

    t: Signal
    """s, from the trigger."""
    q1: Signal
    """rad, of joint 1."""
    q2: Signal
    """rad, of joint 2."""
    jack_rise: Signal
    """m."""


@dataclass(frozen=True)
class Joints:
    """The encoders' capture: arrays of shape (n_points,)."""

    t: Signal
    """s, from the trigger, on the controller's clock."""
    q1: Signal
    """rad, of joint 1."""
    q2: Signal
    """rad, of joint 2."""
    e1: Signal = field(default_factory=lambda: np.empty(0))
    """rad, following error of joint 1; empty where the controller does not record it."""
    e2: Signal = field(default_factory=lambda: np.empty(0))
    """rad, of joint 2; as `e1`."""
    m1: Signal = field(default_factory=lambda: np.empty(0))
    """N m, that the controller asked of motor 1; as `e1`."""
    m2: Signal = field(default_factory=lambda: np.empty(0))
    """N m, of motor 2; as `e1`."""


@dataclass(frozen=True)
class Event:
    """Something that happened during the press."""

    time: float
    """s, from the trigger; negative for before it."""
    kind: str
    """One word: `trigger`, `fault`, `aborted`."""
    text: str
    """What happened."""


@dataclass(frozen=True)
class Gap:
    """Consecutive samples of one channel that a recording has lost."""

    channel: str
    """Name of the channel."""
    first_sample: int
    """Index of the first that is missing, from the trigger."""
    stop_sample: int | None
    """Index after the last; None where the recording's end is lost with it."""
    rate: float
    """Hz."""

    @property
    def start(self) -> float:
        """s from the trigger, of the first sample that is missing."""
        return self.first_sample / self.rate

    @property
    def stop(self) -> float | None:
        """s from the trigger, of the sample after the last; None for an unknown end."""
        return None if self.stop_sample is None else self.stop_sample / self.rate

    def __str__(self) -> str:
        if self.stop_sample is None or self.stop is None:
            return (
                f"from sample {self.first_sample} on, {self.start * 1e3:.6g} ms, all of"
                f" {self.channel} is missing to an end that is not known"
            )
        return (
            f"samples {self.first_sample} to {self.stop_sample - 1} of {self.channel} are missing,"
            f" {self.start * 1e3:.6g} ms to {self.stop * 1e3:.6g} ms"
        )


@dataclass(frozen=True)
class Stretch:
    """Consecutive samples of all channels of a recording."""

    t0_ns: int
    """ns since 1970 of the trigger, by the host's clock."""
    rate: float
    """Hz, of every channel."""
    first_sample: int
    """Index of the first sample, from the trigger; negative before it."""
    volts: dict[str, Signal]
    """Raw volts of each channel by name, shape (n_samples,), V."""

    @property
    def n_samples(self) -> int:
        """Samples of each channel."""
        return len(next(iter(self.volts.values())))

    @property
    def time(self) -> Signal:
        """s from the trigger, of each sample; negative before it."""
        return (self.first_sample + np.arange(self.n_samples)) / self.rate


@dataclass(frozen=True)
class Recorded(Stretch):
    """One press as it was recorded."""

    path: Path
    """Of the file."""
    rig: Rig
    """The bench at the time."""
    session: SessionInfo
    """What the press was."""
    plan: Plan | None
    """None where none was written."""
    joints: Joints | None
    """None where none was written."""
    events: tuple[Event, ...]
    """In the order of writing."""
    software: dict[str, str]
    """Versions by name."""
    channels: dict[str, dict[str, str]]
    """Metadata of each topic: unit, and for `/daq/...` the calibration chart."""
    gaps: tuple[Gap, ...]
    """What the file has lost, of all channels; nothing of it is in `volts`."""

    @property
    def simulated(self) -> bool:
        """Whether the stand-in made the samples."""
        return self.session.simulated

    @property
    def complete(self) -> bool:
        """Whether the press was recorded to its end and nothing of it was lost."""
        return not self.gaps and all(event.kind != "aborted" for event in self.events)
