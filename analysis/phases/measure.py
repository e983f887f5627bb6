"""Forces of the finger while a string is held, between a contact and a release that are known."""

import numpy as np

from sautereau.analysis.phases.contact import Contact
from sautereau.analysis.phases.found import HeldString
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.signals import Signals
from sautereau.trajectory.motion import Floats

SIDE = 1e-3
"""s, of the lines on either side of a release, and of the mean before contact."""
GAP = 3
"""Samples beside a release over which it is spread."""


def line_through(x: Floats, y: Floats) -> tuple[float, float]:
    """Return slope and value at 0 of the line with the least squares; arrays of shape (n,)."""
    middle, level = float(x.mean()), float(y.mean())
    away = x - middle
    slope = float(away @ y / (away @ away))
    return slope, level - slope * middle


def measured(signals: Signals, contact: Contact, release: Release) -> HeldString:
    """Return a held string with the finger's forces.

    Args:
        signals: Of the press.
        contact: Its beginning.
        release: Its end.
    """
    time, force, rate = signals.time, signals.force, signals.rate
    first, last = np.searchsorted(time, (contact.time, release.time)).tolist()
    m = max(4, min(int(SIDE * rate), (last - first) // 3))
    # Lines on both sides are carried on to the release.
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
