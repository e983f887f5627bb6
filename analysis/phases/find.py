"""The phases of a press: free, held and released once for every string, bottom and return."""

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.phases.contact import Contact, find_contact
from sautereau.analysis.phases.doubts import doubts_of, ending
from sautereau.analysis.phases.found import HeldString, Phases
from sautereau.analysis.phases.measure import line_through, measured
from sautereau.analysis.phases.release import LEAST_FALL, Release, find_falls, refine, robust_std
from sautereau.analysis.phases.signals import LEFT, Signals, signals_of, way_down
from sautereau.analysis.phases.stroke import Rows, rows_of
from sautereau.analysis.press.load import Press
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

FULL_SPEED = 0.95
"""1, share of the median speed above which the jack counts as neither starting nor ending."""
LEAST_SAMPLES = 16
"""Of a way down that phases can be found in."""
STILL = 3e-4
"""1, share of the full rise below which the jack is at rest."""
REST, REST_MARGIN = 40e-3, 2e-3
"""s, of the rest that hum is looked for in, and between that and the motion."""
REST_ROWS, CONTACT_ROWS = 40, 200
"""Rows of the rest and of a way to a release, at most, that contact is found from."""
LEAST_GAIN, LEAST_FALL_GAIN = 20.0, 9.0
"""1, by which a string must lessen the misfit of a free key, and a fall that of a bend."""
LEAST_HELD = 8
"""Rows for which a string is held, at the least."""
LIKE_THE_FALL = 0.4, 2.0
"""1, of the string's force at release to the fall of the load, between which it is a pluck."""
LEAST_SHARE = 0.1
"""1, of the largest fall in a press, below which one is no release."""
BEFORE = 6
"""Samples before a release over which taking back the lag has spread most of it."""
SETTLED = 3
"""Rows after a release from which the next string may be met."""
FELT, FELT_SIGNIFICANCE = 0.1, 6.0
"""N, and standard deviations, by which the load rises where the felt is met."""


def find_phases(press: Press) -> Phases:
    """Find every contact and release in a press; a press without a pluck has none.

    Returns:
        Also what is doubtful: a mute key, a short record and weak evidence are answers.

    Raises:
        AnalysisError: Force or velocity hold samples that are not numbers.
    """
    signals = signals_of(press)
    down = way_down(signals)
    if down is None:
        most = max(0.0, signals.rise.max(initial=0.0)) * 1e3
        warning = (
            f"the key did not go down: the jack rose by {most:.2g} mm at most;"
            " look at the aim and the sign of the vibrometer"
        )
        return Phases(0.0, 0.0, (), 0.0, None, None, (warning,))
    begin, end = down
    time, speed = signals.time, signals.speed
    if end - begin < LEAST_SAMPLES:
        warning = (
            f"the key moved for only {(end - begin) / press.rate * 1e3:.2g} ms of the recording,"
            " too little to find phases in; record for longer"
        )
        mean = float(speed[begin : end + 1].mean())
        return Phases(float(time[begin]), float(time[end]), (), mean, None, None, (warning,))
    plucks = _plucks(press.rig, signals, rows_of(signals, begin, end), begin)
    contact = plucks[0].contact if plucks else float(time[end])
    contact = max(contact, float(time[begin + LEAST_SAMPLES // 2]))
    settled = _at_full_speed(time, speed, time[begin], contact)
    slope, offset = line_through(time[settled], signals.rise[settled])
    held_speed = released_speed = None
    if plucks:
        held_speed = _mean(speed, time, plucks[0].contact, plucks[0].release)
        after = min(plucks[0].release + plucks[0].duration, time[end])
        released_speed = _mean(speed, time, plucks[0].release, after)
    steady = float(time[begin + np.argmax(speed[begin:] >= FULL_SPEED * speed[settled].mean())])
    return Phases(
        start=float(-offset / slope),
        bottom=float(time[end]),
        plucks=tuple(plucks),
        free_speed=float(speed[settled].mean()),
        held_speed=held_speed,
        released_speed=released_speed,
        warnings=(
            *ending(signals, begin),
            *doubts_of(signals, press.quality_flags, plucks, steady),
        ),
        bottomed=_bottomed(signals, begin, plucks),
        returned=_returned(signals, end),
    )


def _plucks(rig: Rig, signals: Signals, rows: Rows, begin: int) -> list[HeldString]:
    """Return the strings held on the way down, in order of time."""
    falls = [
        release
        for fall in find_falls(rows)
        if (release := refine(signals, float(rows.time[fall]), rows.step)).gain > LEAST_FALL_GAIN
        and release.fall > LEAST_FALL
    ]
    found = _met(rig, signals, rows.step, begin, falls)
    largest = max((release.fall for _, release in found), default=0.0)
    large = [release for _, release in found if release.fall > LEAST_SHARE * largest]
    if len(large) < len(found):  # what lies between two plucks is free
        found = _met(rig, signals, rows.step, begin, large)
    return [measured(signals, contact, release) for contact, release in found]


def _met(
    rig: Rig, signals: Signals, step: float, begin: int, falls: list[Release]
) -> list[tuple[Contact, Release]]:
    """Return the falls before which a string was met, and when it was.

    Args:
        rig: The bench.
        signals: Of the press.
        step: s, by which a fall is known before it is refined.
        begin: Sample at which the jack leaves its rest.
        falls: In order of time.
    """
    first, last = _rest(signals, begin)
    rest = rows_of(signals, first, last, max(1, (last - first) // REST_ROWS))
    found = []
    free, before = begin, _place(signals, min(begin, last + int(REST_MARGIN * signals.rate)))
    least, most = LIKE_THE_FALL
    for release in falls:
        until = signals.sample(release.time) - BEFORE
        held = rows_of(signals, free, until, most=CONTACT_ROWS)
        contact = find_contact(rig, rest, held, release, signals.instant_std, before)
        if (
            contact is None
            or contact.gain < LEAST_GAIN
            or release.time - contact.time < LEAST_HELD * step
            or not least * release.fall < contact.at_release < most * release.fall
        ):
            continue
        found.append((contact, release))
        before = _place(signals, signals.sample(contact.time))
        free = until + BEFORE + int(SETTLED * step * signals.rate)
    return found


def _rest(signals: Signals, begin: int) -> tuple[int, int]:
    """Return the samples of the rest before the jack leaves it."""
    still = np.flatnonzero(signals.rise[:begin] < STILL * signals.rise.max())
    last = max(0, int(still[-1]) - int(REST_MARGIN * signals.rate)) if len(still) else 0
    return max(0, last - int(REST * signals.rate)), last


def _place(signals: Signals, sample: int) -> tuple[float, float]:
    """Return time [s] and rise [m] of the jack at a sample."""
    return float(signals.time[sample]), float(signals.rise[sample])


def _bottomed(signals: Signals, begin: int, plucks: list[HeldString]) -> float | None:
    """Return when the load rises for good after the last release, as felt makes it [s]."""
    rows = rows_of(signals, begin, int(np.argmax(signals.rise)) + 1)
    first = int(np.searchsorted(rows.time, plucks[-1].release)) + SETTLED if plucks else 0
    load = rows.load[first:]
    if len(load) < 4 * SETTLED:
        return None
    level = float(np.median(load))
    below = np.flatnonzero(load < level + max(FELT, FELT_SIGNIFICANCE * robust_std(load)))
    risen = int(below[-1]) + 1 if len(below) else 0
    return float(rows.time[first + risen]) if len(load) - risen >= SETTLED else None


def _returned(signals: Signals, end: int) -> float | None:
    """Return when the jack is back at the height at which it counted as leaving its rest [s]."""
    back = np.flatnonzero(signals.rise[end:] < LEFT * signals.rise.max())
    return float(signals.time[end + back[0]]) if len(back) else None


def _at_full_speed(time: Floats, speed: Floats, start: float, end: float) -> NDArray[np.intp]:
    """Return the samples of the later half between two instants [s] that are at full speed."""
    inside = _between(time, (start + end) / 2, end)
    if len(inside) < 8:
        inside = _between(time, start, end)
    full = inside[speed[inside] >= FULL_SPEED * np.median(speed[inside])]
    return full if len(full) >= 8 else inside


def _between(time: Floats, start: float, end: float) -> NDArray[np.intp]:
    """Return the samples from one instant to before another [s]."""
    return np.arange(*np.searchsorted(time, (start, end)))


def _mean(signal: Floats, time: Floats, start: float, end: float) -> float | None:
    """Return the mean from one instant to before another [s]; None where no sample is."""
    inside = signal[slice(*np.searchsorted(time, (start, end)))]
    return float(inside.mean()) if len(inside) else None
