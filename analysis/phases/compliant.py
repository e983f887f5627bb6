"""The plucks of a press on a compliant key, which bends, heaves, and rings."""

from dataclasses import replace

import numpy as np

from sautereau.analysis.model.choirs import choirs
from sautereau.analysis.phases.contact import Contact, find_contact
from sautereau.analysis.phases.event import refine_event
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.search import Searched, search
from sautereau.analysis.phases.signals import Rows, Signals, rows_of
from sautereau.analysis.phases.slow import Slow
from sautereau.rig.schema import Rig

CONTACT_ROWS, BEFORE = 200, 6
"""Largest number of rows for finding a contact, and samples before the release they end."""
LEAST_GAIN, LIKE_THE_FALL = 20.0, (0.3, 2.5)
"""Least reduction of chi2 by the string, and range of its force over that of the search."""
CERTAIN = 150.0
"""Significance in the search from which on this is not needed."""
SHORTEST = 0.5e-3
"""s, shortest pluck."""


def compliant_plucks(
    rig: Rig,
    signals: Signals,
    rest: Rows,
    way: tuple[int, int],
    before: tuple[float, float],
) -> tuple[list[tuple[Contact, Release]], Searched]:
    """Return the plucks on the way down, and the search that found them.

    Args:
        rig: The bench.
        signals: Of the press.
        rest: Of the key at rest before the press.
        way: First and last sample of the way down.
        before: Time [s] and rise [m] of the jack before which contact is impossible.
    """
    begin, end = way
    slow = Slow(signals, begin, end)
    searched = search(slow, [choir.jack.string_clearance for choir in choirs(rig)])
    start, last = float(signals.time[begin]), float(signals.time[end])
    found: list[tuple[Contact, Release]] = []
    for growth in searched.growths:
        release = refine_event(signals, growth.release, growth.force, start, last)
        held = rows_of(signals, begin, signals.sample(release.time) - BEFORE, most=CONTACT_ROWS)
        if not len(held.time):
            continue
        held = replace(
            held,
            rise=np.interp(held.time, slow.hops, slow.rise(searched.compliance)),
            load=held.load - slow.at(held.time) @ searched.terms,
            variance=held.variance + slow.error(held.time) ** 2,
        )
        others = [(contact.time, earlier) for contact, earlier in found]
        contact = find_contact(
            rig, rest, held, release, signals.instant_std, before, growth.contact, others, slow
        )
        if contact is None or release.time - contact.time < SHORTEST:
            continue
        ratio = contact.at_release / growth.force
        like = contact.gain > LEAST_GAIN and LIKE_THE_FALL[0] < ratio < LIKE_THE_FALL[1]
        if like or growth.significance > CERTAIN:
            found.append((contact, release))
    return found, searched
