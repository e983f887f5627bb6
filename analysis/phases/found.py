"""The result of segmenting a press: its phases, its plucks with their forces, and warnings."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sautereau.analysis.phases.contact import Contact
from sautereau.analysis.phases.expected import Expected
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.search import Growth
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
"""s, largest distance of a quality flag from a contact or release for a warning."""
GOOD = 4.0
"""Variance of the residuals over the noise below which the fit of a rigid key is good."""
RIGID = 10.0
"""Variance of the residuals over the noise below which the fit of a rigid key is fair."""
FAIR = 15e-3
"""N, rms of the residuals below which the fit of a compliant key is fair."""
FAR = 3.0
"""Distance of a pluck from every string that the rig expects, in standard deviations, above which
it gives a warning."""
DEVIATIONS = 3.0
"""Number of standard uncertainties by which the true contact may be earlier."""


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
    """N at the finger, fall of the load at release: of finger force less the key's inertia."""
    force_slope: float
    """N/m, finger force on key deflection at the laser while the string is held."""

    @property
    def pluck_duration(self) -> float:
        """Time from contact to release [s]."""
        return self.release - self.contact


@dataclass(frozen=True)
class Fit:
    """How well the load was explained."""

    model: Literal["rigid", "compliant", "by hand"]
    """Of the key: rigid, or one that bends, heaves and rings; or the instants were set by hand."""
    noise: float
    """Dimensionless, largest variance of the residuals over that of the noise."""
    compliance: float = 0.0
    """s^2, k in the relation s = F + k F'' - m v' of load, force and velocity."""
    residual: float = 0.0
    """N, rms of the load that is not explained: of the smoothed load on a compliant key, of the
    load on a rigid key without a pluck, otherwise 0."""
    negligible: bool = False
    """Whether the load that a rigid key does not explain shifts contacts by less than the least
    uncertainty of a contact on a compliant key."""

    @property
    def verdict(self) -> Literal["good", "fair", "poor", "by hand"]:
        """Whether instants and uncertainties can be relied on."""
        if self.model == "by hand":
            return "by hand"
        if self.model == "rigid":
            fair = self.negligible or self.noise < RIGID
            return "good" if self.noise < GOOD else "fair" if fair else "poor"
        return "fair" if self.residual < FAIR else "poor"


@dataclass(frozen=True, repr=False)
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
    fit: Fit | None = None
    """How well the load was explained; None where it was not evaluated."""
    missed: tuple[tuple[float, float], ...] = ()
    """s, start and end of stretches in which the load climbs and collapses without a pluck."""

    def __repr__(self) -> str:
        plucks = (f"{p.contact * 1e3:.3f} to {p.release * 1e3:.3f} ms" for p in self.plucks)
        return f"<Phases: string held {', '.join(plucks) or 'never'} after the trigger>"


def line_through(x: Floats, y: Floats) -> tuple[float, float]:
    """Return slope and value at 0 of the least-squares line; arrays of shape (n,)."""
    middle, level = float(x.mean()), float(y.mean())
    away = x - middle
    slope = float(away @ y / (away @ away))
    return slope, level - slope * middle


def measured(signals: Signals, contact: Contact, release: Release) -> HeldString:
    """Return a pluck with its finger forces.

    Args:
        release: Its end.
    """
    time, force, rate = signals.time, signals.force, signals.rate
    first, last = np.searchsorted(time, (contact.time, release.time)).tolist()
    m = max(4, min(int(SIDE * rate), (last - first) // 3))
    # The line before is extrapolated to the release.
    side = slice(max(0, last - GAP - m), last - GAP)
    if len(time[side]) > 2:
        before = line_through(time[side] - release.time, force[side])[1]
    else:
        before = float(force[min(side.start, len(force) - 1)])
    travel = signals.deflection[first:last] - signals.deflection[first:last].mean()
    return HeldString(
        contact=contact.time,
        release=release.time,
        contact_std=contact.std,
        release_std=release.std,
        contact_force=float(force[max(0, first - m) : max(1, first)].mean()),
        release_force=before,
        force_drop=release.fall,
        force_slope=float(travel @ force[first:last] / (travel @ travel)),
    )


def fit_warnings(
    fit: Fit, further: Sequence[Growth], plucks: Sequence[HeldString], strings: int
) -> list[str]:
    """Return warnings about a poor fit, growths without a pluck, and missing or surplus plucks.

    Args:
        fit: How well the load was explained.
        further: Growths without a pluck.
        strings: Number of strings of the rig.
    """
    found = [
        f"from {growth.contact * 1e3:.5g} to {growth.release * 1e3:.5g} ms the load climbs by"
        f" {growth.force:.3g} N and collapses, and no pluck was found there; plot the phases, and"
        " check the number of strings in the rig"
        for growth in further
    ]
    if 0 < len(plucks) < strings:
        found.append(
            f"plucks of {len(plucks)} of the rig's {strings} strings were found: two may be"
            " released together, or the press is too short; check the rise of the jack"
        )
    elif len(plucks) > strings and fit.model != "by hand":
        found.append(
            f"{len(plucks)} plucks were found, but the rig has {strings}"
            f" string{'s' * (strings > 1)}: a jump of the jack's speed may look like a pluck; plot"
            " the phases, and check the strings and the key's inertia in the rig"
        )
    if fit.verdict == "poor":
        left = (
            f"{fit.residual * 1e3:.2g} mN rms of the load are not explained"
            if fit.residual
            else f"the load that is not explained is {math.sqrt(fit.noise):.2g} times its noise"
        )
        found.append(
            f"the key rings and bends, or the rig is of another instrument: {left}, so contact and"
            " release may be wrong by more than their uncertainties; press more slowly, or check"
            " them in a plot"
        )
    return found


def exchange_warnings(contacts: Sequence[Contact]) -> list[str]:
    """Return a warning if contacts of strings held at once may belong to each other's release."""
    which = [f"{number}" for number, c in enumerate(contacts, 1) if c.exchange_std > WEAK]
    if not which:
        return []
    return [
        f"contacts of plucks {' and '.join(which)}: the strings are held at once, and their"
        " contacts explain the load as well if they are exchanged, so half their distance is in"
        " their uncertainties; press each string alone"
    ]


def unlike_the_rig(signals: Signals, plucks: Sequence[HeldString], strings: Expected) -> list[str]:
    """Return warnings about plucks whose place and force are far from every string of the rig.

    Args:
        plucks: In order of time.
    """
    found = []
    for number, held in enumerate(plucks, 1):
        instants = [held.contact, held.release]
        contact, release = np.interp(instants, signals.time, signals.rise).tolist()
        force = held.force_drop
        place = strings.place_deviations(np.array(contact), np.array(release - contact))
        off = np.hypot(np.hypot(*place.T), strings.force_deviations(force))
        nearest = int(np.argmin(off))
        if off[nearest] > FAR:
            who = f"pluck {number}: " if len(plucks) > 1 else ""
            found.append(
                f"{who}its {force:.2g} N from {contact * 1e3:.2f} to {release * 1e3:.2f} mm of rise"
                f" are not like the rig's string, {strings.forces[nearest]:.2g} N from"
                f" {strings.contacts[nearest] * 1e3:.2f} to"
                f" {(strings.contacts + strings.climbs)[nearest] * 1e3:.2f} mm, so it may be no"
                " pluck; plot the phases, and check the clearance and the plectrum in the rig"
            )
    return found


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
        plucks: In order of time.
        steady: s after the trigger, end of the run-up.
    """
    found = []
    then = "was not measured" if signals.missing else "is determined by the other channel alone"
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
        elif earliest < steady and signals.missing != "force":
            found.append(
                f"{who}contact may lie in the run-up, which ends at {steady * 1e3:.5g} ms, where it"
                f" depends on the rig's inertia: its uncertainty is"
                f" {held.contact_std * 1e3:.2g} ms; press more slowly"
            )
        elif held.contact_std > WEAK and not signals.missing:
            found.append(
                f"{who}uncertainty of contact {held.contact_std * 1e3:.2g} ms: the slope of the"
                " force hardly changes there; check the noise of the force"
            )
        if held.release_std > WEAK and not signals.missing:
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
                        f" and {then}"
                    )
        before = held.release
    return found
