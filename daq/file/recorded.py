"""What a recording holds: the session, samples, plan, joints, events, gaps."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.samples import Samples, Scaling, write_volts
from sautereau.daq.file.trigger_date import Counted
from sautereau.rig.schema import Rig
from sautereau.rig.units import shown

Signal = NDArray[np.float64]

SPLIT = "split"  # Kind of the event of a recording that was a part of another one
MOTION = "motion"  # Kind of the event that is the start of the arm's motion
BY_EDGE = "started, by the trigger's edge"
"""Text of that event if an output of the controller started the acquisition."""
UNCHECKED = (
    "no checksums cover the samples, so that damage to them would not be noticed: another program"
    " has written the file; use it as sautereau wrote it"
)
"""Text about a recording that is not `Recorded.checked`."""
_BEFORE_SESSIONS = {"session": "", "item": "", "warm_up": "false"}
"""Metadata of a recording that was made before sessions had plans."""
_WITHOUT_DESIGN = {"levels": "{}", "block": ""}  # Metadata that a recording lacks without a design


def date_now() -> str:
    """Return the present date as `SessionInfo.started`, in the time zone of this machine.

    Presses of one day are pooled, and days do not end at midnight in UTC everywhere.
    """
    return datetime.now().astimezone().isoformat(timespec="milliseconds")


@dataclass(frozen=True)
class SessionInfo:
    """One press of a session."""

    press: int
    """Number of the press in its session, from 1."""
    started: str
    """Date of the start of the press, ISO 8601 with the time zone."""
    simulated: bool
    """Whether the stand-in made the samples, as the DAQ device itself reports."""
    controller: str
    """Identification of the motor controller."""
    daq: str
    """Product type and serial number of the DAQ device."""
    scene: str = ""
    """Text of the stand-in's scene; empty on the hardware."""
    seed: int | None = None
    """Seed of every random number; None without one."""
    notes: str = ""
    """The operator's notes."""
    session: str = ""
    """Identifier of the session; empty for a single press."""
    item: int | None = None
    """Number of the press in the session's plan, from 1; None without a plan."""
    warm_up: bool = False
    """Whether it is a warm-up press, which is excluded from all results."""
    levels: Mapping[str, str] = field(default_factory=dict)
    """Level of each factor of the session's design; empty without one."""
    block: int | None = None
    """Block of the design, from 1; None without one."""

    @property
    def by_arm(self) -> bool:
        """Whether the arm of the rig made the press: an import names its file as both devices."""
        return self.controller not in ("", self.daq)

    def to_metadata(self) -> dict[str, str]:
        """Return the fields as text, for a Metadata record; without a design, none of it."""
        flags = {False: "false", True: "true", None: ""}
        values = vars(self) | {"levels": json.dumps(dict(self.levels))}
        return {
            name: flags[value] if isinstance(value, bool | None) else str(value)
            for name, value in values.items()
            if self.levels or name not in _WITHOUT_DESIGN
        }


def session_from_metadata(metadata: dict[str, str]) -> SessionInfo:
    """Read back what `SessionInfo.to_metadata` wrote.

    Raises:
        RecordingError: A field is missing or invalid.
    """
    known = _BEFORE_SESSIONS | _WITHOUT_DESIGN | metadata
    missing = [field.name for field in fields(SessionInfo) if field.name not in known]
    if missing:
        raise RecordingError(f"its session metadata lack {', '.join(missing)}")
    if odd := [name for name, value in known.items() if not isinstance(value, str)]:
        raise RecordingError(f"{', '.join(odd)} of its session metadata must be texts")
    for flag in ("simulated", "warm_up"):
        if known[flag] not in ("true", "false"):
            raise RecordingError(f"its session says {flag} = {known[flag]!r}, not true or false")
    texts = ("started", "controller", "daq", "scene", "notes", "session")
    try:
        return SessionInfo(
            press=whole_number(known["press"]),
            seed=whole_number(known["seed"]) if known["seed"] else None,
            item=whole_number(known["item"]) if known["item"] else None,
            block=whole_number(known["block"]) if known["block"] else None,
            levels=_levels(known["levels"]),
            simulated=known["simulated"] == "true",
            warm_up=known["warm_up"] == "true",
            **{name: known[name] for name in texts},
        )
    except ValueError as error:
        raise RecordingError(
            f"press, seed, item or block of its session is not a number: {error}"
        ) from error


def _levels(text: str) -> dict[str, str]:
    """Return the levels of a design, as `SessionInfo.to_metadata` wrote them."""
    try:
        levels = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"levels of its session is not JSON: {error}") from error
    if not isinstance(levels, dict) or not all(isinstance(v, str) for v in levels.values()):
        raise RecordingError("levels of its session must be texts by their factors")
    return levels


def whole_number(text: str, most: int = 2**64) -> int:
    """Return an integer that is written in digits, from ``-most`` to ``most``.

    Raises:
        ValueError: It is not such an integer.
    """
    if len(text) > 20 or not text.isascii() or not text.removeprefix("-").isdigit():
        raise ValueError(f"{shown(text)} is not an integer")
    if abs(int(text)) > most:
        raise ValueError(f"{text} is beyond the limit of {most}")
    return int(text)


@dataclass(frozen=True)
class Block:
    """Consecutive samples of all channels, as an acquisition reads them."""

    first_sample: int
    """Index of the first sample, counted from the trigger."""
    samples: Samples
    """Shape (n_channels, n), channels in the order of ``daq.channels``: volts as float64, V, or the
    device's counts as int16 or int32."""
    counted: tuple[Counted, ...] = ()
    """Counts of the samples that the device had acquired. They and the arrival of the block limit
    the date of the trigger."""
    scaling: Scaling | None = None
    """Scaling of the counts; None for volts."""

    @property
    def n_samples(self) -> int:
        """Number of samples of each channel."""
        return self.samples.shape[1]

    @property
    def volts(self) -> Signal:
        """Shape (n_channels, n), V."""
        if self.scaling is None:
            return np.asarray(self.samples, dtype=float)
        volts = np.empty(self.samples.shape)
        write_volts(self.samples, self.scaling.coefficients.tolist(), volts)
        return volts

    def finite(self, names: Sequence[str]) -> tuple["Block", str]:
        """Return the samples before the first one that is not finite, and that one as text.

        Args:
            names: Of the channels.
        """
        finite = np.isfinite(self.samples).all(axis=0)
        if finite.all():
            return self, ""
        n = int(finite.argmin())
        values = zip(names, self.samples[:, n].tolist(), strict=True)
        odd = ", ".join(f"{value} V of {name}" for name, value in values if not np.isfinite(value))
        text = (
            f"it gave {odd} at sample {self.first_sample + n}, not a finite number; the"
            f" {self.n_samples - n} samples from there on are not recorded"
        )
        return replace(self, samples=self.samples[:, :n]), text


@dataclass(frozen=True)
class Plan:
    """The planned motion: arrays of shape (n_points,)."""

    t: Signal
    """Time after the trigger, s."""
    q1: Signal
    """Angle of joint 1, rad."""
    q2: Signal
    """Angle of joint 2, rad."""
    jack_rise: Signal
    """Rise of the jack, m."""


@dataclass(frozen=True)
class Joints:
    """What the controller captured of the joints: arrays of shape (n_points,)."""

    t: Signal
    """Time after the trigger on the controller's clock, s."""
    q1: Signal
    """Angle of joint 1, rad."""
    q2: Signal
    """Angle of joint 2, rad."""
    e1: Signal = field(default_factory=lambda: np.empty(0))
    """Following error of joint 1, rad; empty if the controller does not record it."""
    e2: Signal = field(default_factory=lambda: np.empty(0))
    """Following error of joint 2, rad; as `e1`."""
    m1: Signal = field(default_factory=lambda: np.empty(0))
    """Torque that the controller requested of motor 1, N m; as `e1`."""
    m2: Signal = field(default_factory=lambda: np.empty(0))
    """Torque that the controller requested of motor 2, N m; as `e1`."""


@dataclass(frozen=True)
class Event:
    """Something that happened during the press."""

    time: float
    """Time after the trigger, s; negative before it."""
    kind: str
    """One word: `trigger`, `motion`, `fault`, `aborted`."""
    text: str
    """What happened."""
    std: float = 0.0
    """Standard uncertainty of the time, s; 0 where it is exact."""


@dataclass(frozen=True)
class Gap:
    """Consecutive missing samples of one channel of a recording."""

    channel: str
    """Name of the channel."""
    first_sample: int
    """Index of the first missing sample, counted from the trigger."""
    stop_sample: int | None
    """Index after the last; None if the end of the recording is unknown."""
    rate: float
    """Sampling rate, Hz."""

    @property
    def start(self) -> float:
        """Time of the first missing sample after the trigger, s."""
        return self.first_sample / self.rate

    @property
    def stop(self) -> float | None:
        """Time after the trigger of the sample after the last, s; None for an unknown end."""
        return None if self.stop_sample is None else self.stop_sample / self.rate

    def document(self) -> dict[str, Any]:
        """Return the gap as JSON, with its times instead of the rate."""
        names = ("channel", "first_sample", "stop_sample", "start", "stop")
        return {name: getattr(self, name) for name in names}

    def __str__(self) -> str:
        if self.stop_sample is None or self.stop is None:
            return (
                f"samples of {self.channel} from {self.first_sample} ({self.start * 1e3:.6g} ms"
                " after the trigger) to an unknown end are missing"
            )
        return (
            f"samples {self.first_sample} to {self.stop_sample - 1} of {self.channel} are missing,"
            f" {self.start * 1e3:.6g} ms to {self.stop * 1e3:.6g} ms after the trigger"
        )


@dataclass(frozen=True, repr=False)
class Stretch:
    """Consecutive samples of all channels of a recording."""

    t0_ns: int
    """Date of the trigger by the host's clock, ns since 1970."""
    rate: float
    """Sampling rate of every channel, Hz."""
    first_sample: int
    """Index of the first sample, counted from the trigger; negative before it."""
    volts: dict[str, Signal]
    """Raw volts of each channel by name, shape (n_samples,), V."""

    def __repr__(self) -> str:
        of = f"{self.n_samples} samples of {', '.join(self.volts)} at {self.rate:g} Hz"
        return f"<{type(self).__name__}: {of}>"

    @property
    def n_samples(self) -> int:
        """Number of samples of each channel."""
        return len(next(iter(self.volts.values())))

    @property
    def time(self) -> Signal:
        """Time of each sample after the trigger, s; negative before it."""
        first = self.first_sample
        return np.arange(first, first + self.n_samples, dtype=float) / self.rate


@dataclass(frozen=True, repr=False)
class Recorded(Stretch):
    """One press as it was recorded."""

    path: Path
    """The file."""
    rig: Rig
    """The rig as it was when recorded."""
    session: SessionInfo
    """Description of the press."""
    plan: Plan | None
    """Planned motion; None if none was recorded."""
    joints: Joints | None
    """Captured motion; None if none was recorded."""
    events: tuple[Event, ...]
    """In the order of their times, except for what was known only after the samples."""
    software: dict[str, str]
    """Versions by name."""
    channels: dict[str, dict[str, str]]
    """Metadata of each topic: unit, and for `/daq/...` the calibration."""
    gaps: tuple[Gap, ...]
    """Missing samples of all channels of the file; none of them is in `volts`."""
    t0_std: float | None = None
    """Standard uncertainty of the date of the trigger, s; None if it is unknown."""
    checked: bool = True
    """Whether checksums cover the samples. Another program may have written the file without."""

    @property
    def simulated(self) -> bool:
        """Whether the stand-in made the samples."""
        return self.session.simulated

    @property
    def after_press(self) -> bool:
        """Whether an earlier press of the recording of which this was a part precedes it."""
        return self.session.press > 1 and any(event.kind == SPLIT for event in self.events)

    @property
    def motion(self) -> Event | None:
        """Start of the arm's motion, to which its plan and its joints are aligned.

        A recording without such an event was started by the trigger's edge.
        """
        for event in self.events:
            if event.kind == MOTION:
                return event
        if self.joints is None:
            return None
        controller = self.rig.controller
        return Event(controller.trigger_delay, MOTION, BY_EDGE, controller.trigger_delay_std)

    @property
    def origin(self) -> float:
        """Time from which the analysis counts, s after the trigger.

        It is 0 if the trigger's edge started the acquisition. Otherwise it is the start of the
        motion, which excludes the delay of the host.
        """
        motion = self.motion
        return 0.0 if motion is None or motion.text == BY_EDGE else motion.time

    @property
    def arm(self) -> Joints | Plan | None:
        """Captured motion of the arm, or its plan without one; times count from `origin`."""
        arm = self.joints or self.plan
        return None if arm is None else replace(arm, t=arm.t - self.origin)

    @property
    def events_and_gaps(self) -> tuple[Event, ...]:
        """Events, the gaps among them, so that no file made of the rest counts as complete."""
        gaps = (Event(gap.start, "aborted", str(gap)) for gap in self.gaps)
        return *self.events, *gaps

    @property
    def complete(self) -> bool:
        """Whether the press was recorded to its end and no sample is missing."""
        return not self.gaps and all(event.kind != "aborted" for event in self.events)
