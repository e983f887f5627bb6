"""Write a part of a recording into a recording of its own."""

from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from sautereau.daq.convert.importing import new_recording
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.recorded import SPLIT, Event, Recorded

OF_ALL = ("imported", "warning")  # Events about all samples of a file


def write_part(recorded: Recorded, start: int, stop: int, out: Path, press: int) -> None:
    """Write consecutive samples of a recording, bit for bit, with the events during them.

    Time 0 of the new recording is its first sample. Its notes and an event state where it was in
    the other one.

    Args:
        start: Index of the first sample, counted from the first of the recording.
        stop: Index after the last.
        press: Number of the press.

    Raises:
        RecordingError: An arm has made the recording, so that all of it is one press; or the new
            one cannot be written.
    """
    if recorded.arm is not None or recorded.motion is not None:
        raise RecordingError(
            f"recording {recorded.path}: it holds the motion of an arm, and thus one press; it is"
            " not split"
        )
    rate, first = recorded.rate, recorded.first_sample + start
    begin, end = first / rate, (recorded.first_sample + stop) / rate
    text = (
        f"samples {first} to {recorded.first_sample + stop - 1} of {recorded.path.name}: time"
        f" 0 is {begin:.9g} s after its trigger"
    )
    missing = [Event(gap.start, "aborted", str(gap)) for gap in recorded.gaps]
    events = [
        replace(event, time=0.0 if event.kind in OF_ALL else event.time - begin)
        for event in (*recorded.events, *missing)
        if event.kind in OF_ALL or begin <= event.time <= end
    ]
    session = replace(
        recorded.session,
        press=press,
        started=_later(recorded.session.started, begin),
        notes="\n".join(filter(None, (recorded.session.notes, text))),
    )
    volts = np.stack([recorded.volts[c.name][start:stop] for c in recorded.rig.daq.channels])
    t0_ns = recorded.t0_ns + round(begin * 1e9)
    with new_recording(
        out, recorded.rig, session, volts, 0, rate, t0_ns, recorded.t0_std
    ) as recording:
        for event in events:
            recording.event(event.kind, event.text, event.time, event.std)
        recording.event(SPLIT, text, 0.0)


def _later(date: str, seconds: float) -> str:
    """Return an ISO date some seconds later; another text unchanged."""
    try:
        return (datetime.fromisoformat(date) + timedelta(seconds=seconds)).isoformat()
    except (ValueError, OverflowError):
        return date
