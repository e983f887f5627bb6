"""The plucks of a press on a compliant key, which bends, heaves, and rings."""

import math
from dataclasses import replace

from sautereau.analysis.phases.contact import Contact
from sautereau.analysis.phases.event import refine_event
from sautereau.analysis.phases.expected import expected
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.search import Searched, search
from sautereau.analysis.phases.signals import BRIDGED, Signals
from sautereau.analysis.phases.slow import Slow
from sautereau.rig.schema import Rig

SHORTEST = 0.5e-3
"""s, shortest pluck."""
NEAR, LEAST_NEAR, MOST_NEAR = 2.0, 0.25e-3, 1.0e-3
"""Uncertainty of a release before its refinement over that of the search, and its bounds in s."""
CONTACT_STD, RELEASE_STD = (1.9, 0.28e-3, 0.7), (1.2, 0.07e-3, 0.3)
"""Standard uncertainty of an instant over that of its fit; s, what is added to it; and the part of
the pluck's duration, over the fraction of the force that the key's model does not explain. From
presses of the independent simulator, and tested on others."""
LEAST_HIDDEN = 3 * BRIDGED
"""N, least force of a pluck whose release lies in a drop-out, where the inertia is interpolated."""


def compliant_plucks(
    rig: Rig, signals: Signals, way: tuple[int, int]
) -> tuple[list[tuple[Contact, Release]], Searched]:
    """Return the plucks on the way down, and the search that found them.

    Args:
        rig: The bench.
        signals: Of the press.
        way: First and last sample of the way down.
    """
    start, last = (float(signals.time[sample]) for sample in way)
    searched = search(Slow(signals, *way), expected(rig))
    found: list[tuple[Contact, Release]] = []
    for growth in searched.growths:
        near = min(max(NEAR * growth.release_std, LEAST_NEAR), MOST_NEAR)
        others = [other.release for other in searched.growths if other is not growth]
        release = refine_event(signals, growth.release, near, growth.force, start, last, others)
        around = signals.no_velocity[
            slice(*(signals.sample(growth.release + side) for side in (-near, near)))
        ]
        hidden = around.any() and growth.force < LEAST_HIDDEN
        if hidden or release.time - growth.contact < SHORTEST:
            continue
        wrong = searched.residual / growth.force * (release.time - growth.contact)

        def uncertain(std: float, scale: tuple[float, float, float], wrong: float = wrong) -> float:
            return math.hypot(scale[0] * std, scale[1], scale[2] * wrong, signals.instant_std)

        std = uncertain(growth.contact_std, CONTACT_STD)
        contact = Contact(growth.contact, std, growth.significance, growth.force, growth.noise)
        found.append((contact, replace(release, std=uncertain(release.std, RELEASE_STD))))
    return found, searched
