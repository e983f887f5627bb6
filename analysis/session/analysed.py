"""One press of a session, analysed once for every table, plot and comparison."""

from dataclasses import dataclass, replace
from functools import reduce
from itertools import pairwise
from pathlib import Path
from typing import Self

import numpy as np

from sautereau.analysis.loading.press import Press, partial_press_of, press_of
from sautereau.analysis.loading.presses import load_first
from sautereau.analysis.model.predict import JackSpeed
from sautereau.analysis.phases import HeldString, Phases, find_phases
from sautereau.analysis.phases.one_signal import find_partial_phases
from sautereau.analysis.press.features import Row, features
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import Recorded, SessionInfo
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.timing import press_law

WINDOW = 6e-3  # Longest window of the smoothing, two periods of the usual strings (s)
LEAST = 20  # Smallest number of samples that are smoothed
BESIDE = 1e-3  # Time before and after the cruise whose samples are kept (s)


@dataclass(frozen=True)
class AnalysedPress:
    """A press with its phases, features and place in a session."""

    press: Press
    phases: Phases
    session: SessionInfo
    features: Row
    """SI units, as `sautereau.analysis.press.features` defines them."""
    speeds: tuple[JackSpeed, ...]
    """Speed of the first jack until the release of each pluck: `jack_speeds`."""

    @property
    def speed(self) -> JackSpeed | None:
        """Speed of the first jack until the first release; None if unknown."""
        return self.speeds[0] if self.speeds else None

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the press."""
        return (*self.press.warnings, *self.phases.warnings)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks about the press, which make no result doubtful."""
        return (*self.press.remarks, *self.phases.remarks)

    def light(self) -> Self:
        """Return the press with no more samples than its repeatability needs: the jack's rise in
        the cruise."""
        press, samples = self.press, {}
        try:
            law = press_law(press.rig.press)
            rows = press.between(law.cruise_start - BESIDE, law.cruise_end + BESIDE)
            if "jack_rise" in press.samples:
                samples["jack_rise"] = press.samples["jack_rise"][rows].copy()
        except TrajectoryError:  # of a rig that describes no press
            rows = slice(0)
        return replace(self, press=replace(press, time=press.time[rows].copy(), samples=samples))


def analyse_recording(recorded: Recorded) -> AnalysedPress:
    """Analyse the press of a recording.

    Raises:
        MissingSignalError: It has no velocity or no force channel.
        AnalysisError: It is too short.
    """
    press = load_first(recorded, press_of)
    return _analysed(press, find_phases(press), recorded.session)


def _analysed(press: Press, phases: Phases, session: SessionInfo) -> AnalysedPress:
    found, speeds = features(press, phases), jack_speeds(press, phases)
    return AnalysedPress(press, phases, session, found, speeds)


def analyse_file(path: Path) -> AnalysedPress:
    """Analyse the press of a recording's file.

    Raises:
        daq.errors.RecordingError: The file is not a complete recording.
        MissingSignalError: It has no velocity or no force channel.
        AnalysisError: It is too short.
    """
    return analyse_recording(read_recording(path))


def analyse_partial(path: Path) -> AnalysedPress:
    """Analyse the press of a recording's file that lacks the force or the velocity.

    What needs that signal is None in its `features`, and assumed in its `phases`, which are for
    `sautereau.analysis.results.press` only.

    Raises:
        daq.errors.RecordingError: The file is not a complete recording.
        AnalysisError: It has both signals or neither, or is too short.
    """
    recorded = read_recording(path)
    press = load_first(recorded, partial_press_of)
    return _analysed(press, find_partial_phases(press), recorded.session)


def jack_speeds(press: Press, phases: Phases) -> tuple[JackSpeed, ...]:
    """Return the speed of the first jack until the release of each pluck; empty without both
    signals.

    The rise is smoothed over `WINDOW` (Savitzky and Golay, 1964) from one contact or release to the
    next. Before the first contact, where the smoothing would mix in how the string slows the jack,
    the acceleration is constant over half of it. If the jack stops or turns, or is recorded in too
    few samples, that pluck and all later ones have none.

    Args:
        press: The recording, at least its `jack_rise` from `WINDOW` before the first contact to the
            last release.
    """
    found: list[JackSpeed] = []
    before = [] if press.missing else _until_contact(press, phases)
    for held in () if press.missing else phases.plucks:
        edges = _edges(phases, held)
        pieces = [_smoothed(press, *ends) for ends in pairwise(edges)]
        known = [piece for piece in pieces if piece is not None and np.all(piece.speed > 0)]
        if len(known) < len(pieces):
            break
        found.append(reduce(JackSpeed.followed_by, [*before, *known]))
    return tuple(found)


def _until_contact(press: Press, phases: Phases) -> list[JackSpeed]:
    """Return the motion before the first contact; nothing if there are too few samples."""
    contact = min((each.contact for each in phases.plucks), default=np.nan)
    rows = press.between(contact - WINDOW / 2, contact)
    time, rise = press.time[rows] - contact, press.samples["jack_rise"][rows]
    if len(rise) < LEAST:
        return []
    half, speed, place = np.polyfit(time, rise, 2)
    ends = np.array([time[0], 0.0])
    motion = half * ends**2 + speed * ends + place, speed + 2 * half * ends, np.full(2, 2 * half)
    return [JackSpeed(*motion)] if np.all(motion[1] > 0) else []


def _edges(phases: Phases, held: HeldString) -> list[float]:
    """Return the instants [s] between which the jack moves smoothly, until the release of a pluck.

    The force on the key bends at each contact and drops at each release. Of instants that are close
    together, one is an edge.
    """
    first = min(phases.plucks, key=lambda each: each.contact)
    # The rise shortly before contact is also used.
    edges = [first.contact - 0.1 * first.pluck_duration]
    least = 0.25 * held.pluck_duration  # Of a piece beside others
    inside = (t for each in phases.plucks for t in (each.contact, each.release))
    for instant in sorted(inside):
        # The first contact bends the force least.
        if instant > first.contact and instant - edges[-1] >= least <= held.release - instant:
            edges.append(instant)
    return [*edges, held.release]


def _smoothed(press: Press, start: float, stop: float) -> JackSpeed | None:
    """Return the smoothed motion between two instants [s]; None if there are too few samples."""
    from scipy.signal import savgol_filter

    rise = press.samples["jack_rise"][press.between(start, stop)]
    if len(rise) < LEAST:
        return None
    # At the ends the motion is that of the first and of the last window.
    window = min(max(round(WINDOW * press.rate), LEAST // 2), len(rise) // 2) | 1
    at = np.linspace(0, len(rise) - 1, min(100, len(rise))).astype(int)
    # Cubic, as the acceleration may change within a window.
    motion = (savgol_filter(rise, window, 3, k, 1 / press.rate) for k in range(3))
    return JackSpeed(*(np.asarray(each, float)[at] for each in motion))
