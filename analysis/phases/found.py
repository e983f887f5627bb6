"""The result of segmenting a press: its phases, its plucks with their forces, and warnings."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.phases.contact import Contact
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.signals import Signals
from sautereau.daq.signals.quality_flags import QualityFlag
from sautereau.trajectory.motion import Floats

SIDE = 1e-3
"""s, length of the lines on either side of a release, and of the mean before contact."""
GAP = 3
"""Samples on either side of a release over which it is spread."""
WEAK = 0.5e-3
"""s, uncertainty above which a contact or a release gives a warning."""
NEAR = 1e-3
"""s, distance from a contact or release within which a quality flag gives a warning."""
DEVIATIONS = 3.0
"""Standard uncertainties within which the true contact may lie."""


@dataclass(frozen=True)
class HeldString:
    """One pluck; times in s after the trigger."""

    contact: float
    release: float
    contact_std: float
    """s, standard uncertainty."""
    release_std: float
    """s, standard uncertainty."""
    contact_force: float
    """N, of the finger at contact."""
    release_force: float
    """N, of the finger just before release."""
    force_drop: float
    """N, fall of the finger force at release."""
    force_slope: float
    """N/m, finger force on key deflection at the laser while the string is held."""

    @property
    def pluck_duration(self) -> float:
        """Time from contact to release [s]."""
        return self.release - self.contact


@dataclass(frozen=True)
class Phases:
    """The phases of a press; times in s after the trigger."""

    start: float
    """s, at which a jack that always had its free speed would have left rest."""
    bottom: float
    """s, at which the jack has reached its full rise."""
    plucks: tuple[HeldString, ...]
    free_speed: float
    """m/s, mean of the jack before contact, after the run-up."""
    held_speed: float | None
    """m/s, mean of the jack while the first string is held; None without a pluck."""
    released_speed: float | None
    """m/s, mean of the jack after the first release, over as long a time as the string was held."""
    warnings: tuple[str, ...]
    bottomed: float | None = None
    """s, at which the key meets its front felt; None where it does not."""
    returned: float | None = None
    """s, at which the key is back at rest; None where it does not return."""
    peak_force: float | None = None
    """N, largest finger force of the complete press; None where it was not evaluated."""


def line_through(x: Floats, y: Floats) -> tuple[float, float]:
    """Return slope and value at 0 of the least-squares line; arrays of shape (n,)."""
    middle, level = float(x.mean()), float(y.mean())
    away = x - middle
    slope = float(away @ y / (away @ away))
    return slope, level - slope * middle


def measured(signals: Signals, contact: Contact, release: Release) -> HeldString:
    """Return a pluck with its finger forces.

    Args:
        signals: Of the press.
        contact: Its start.
        release: Its end.
    """
    time, force, rate = signals.time, signals.force, signals.rate
    first, last = np.searchsorted(time, (contact.time, release.time)).tolist()
    m = max(4, min(int(SIDE * rate), (last - first) // 3))
    # Lines on both sides are extrapolated to the release.
    sides = slice(max(0, last - GAP - m), last - GAP), slice(last + GAP, last + GAP + m)
    before, after = (
        line_through(time[s] - release.time, force[s])[1]
        if len(time[s]) > 2
        else float(force[min(s.start, len(force) - 1)])
        for s in sides
    )
    travel = signals.deflection[first:last] - signals.deflection[first:last].mean()
    return HeldString(
        contact=contact.time,
        release=release.time,
        contact_std=contact.std,
        release_std=release.std,
        contact_force=float(force[max(0, first - m) : max(1, first)].mean()),
        release_force=before,
        force_drop=before - after,
        force_slope=float(travel @ force[first:last] / (travel @ travel)),
    )


def ending(signals: Signals, begin: int) -> list[str]:
    """Return a warning if the recording ends on the way down, which starts at a sample."""
    speed, top = signals.speed[begin:], int(np.argmax(signals.rise[begin:]))
    if top < len(speed) - 2 or speed[top] <= 0.5 * speed.max():
        return []
    return ["the recording ends while the key is still moving down; record for longer"]


def pluck_warnings(
    signals: Signals, marks: Sequence[QualityFlag], plucks: Sequence[HeldString], steady: float
) -> list[str]:
    """Return warnings about plucks.

    Args:
        signals: Of the press.
        marks: Its quality flags.
        plucks: In order of time.
        steady: s after the trigger, end of the run-up.
    """
    found = []
    before = -float("inf")
    for number, held in enumerate(plucks, 1):
        who = f"pluck {number}: " if len(plucks) > 1 else ""
        earliest = held.contact - DEVIATIONS * held.contact_std
        if earliest < before:
            found.append(
                f"{who}contact may precede the release of the previous string at"
                f" {before * 1e3:.5g} ms, which hides it: its uncertainty is"
                f" {held.contact_std * 1e3:.2g} ms; increase the distance between the strings"
            )
        elif earliest < steady:
            found.append(
                f"{who}contact may lie in the run-up, which ends at {steady * 1e3:.5g} ms, where it"
                f" depends on the rig's inertia: its uncertainty is"
                f" {held.contact_std * 1e3:.2g} ms; press more slowly"
            )
        elif held.contact_std > WEAK:
            found.append(
                f"{who}uncertainty of contact {held.contact_std * 1e3:.2g} ms: the slope of the"
                " force hardly changes there; check the noise of the force"
            )
        if held.release_std > WEAK:
            found.append(
                f"{who}uncertainty of release {held.release_std * 1e3:.2g} ms; check the noise of"
                " the force and the sampling rate"
            )
        for what, instant in (("contact", held.contact), ("release", held.release)):
            for mark in marks:
                if mark.start - NEAR < instant < mark.stop + NEAR:
                    found.append(
                        f"{who}{what} at {instant * 1e3:.5g} ms lies in a {mark.kind} of"
                        f" {mark.channel}, {mark.start * 1e3:.5g} to {mark.stop * 1e3:.5g} ms,"
                        " and is determined by the other channel alone"
                    )
        before = held.release
    return found
