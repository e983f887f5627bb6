"""What a recording holds, once read."""

from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from daq.session_info import SessionInfo
from rig.schema import Rig

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
class Recorded:
    """One press as it was recorded."""

    path: Path
    """Of the file."""
    rig: Rig
    """The bench at the time."""
    session: SessionInfo
    """What the press was."""
    t0_ns: int
    """ns since 1970 of the trigger, by the host's clock."""
    rate: float
    """Hz, of every channel."""
    volts: dict[str, Signal]
    """Raw volts of each channel by name, shape (n_samples,), V, from the trigger on."""
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

    @property
    def simulated(self) -> bool:
        """Whether the stand-in made the samples."""
        return self.session.simulated

    @property
    def complete(self) -> bool:
        """Whether the press was recorded to its end; False where it was aborted."""
        return all(event.kind != "aborted" for event in self.events)

    @property
    def n_samples(self) -> int:
        """Samples of each channel."""
        return len(next(iter(self.volts.values())))


class Description(TypedDict):
    """What `describe` tells; JSON-able."""

    path: str
    size: int
    """Bytes."""
    rig: str
    simulated: bool
    complete: bool
    session: dict[str, str]
    rate: float | None
    """Hz; None without samples."""
    n_samples: int
    duration: float
    """s."""
    channels: dict[str, dict[str, str]]
    messages: dict[str, int]
    """Count of each topic."""
    events: list[str]
    software: dict[str, str]
