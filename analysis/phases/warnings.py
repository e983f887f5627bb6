"""Warnings about uncertain phases of a press, each with a way to improve it."""

from collections.abc import Sequence

import numpy as np

from sautereau.analysis.phases.found import HeldString
from sautereau.analysis.phases.signals import Signals
from sautereau.daq.signals.quality_flags import QualityFlag

WEAK = 0.5e-3
"""s, uncertainty above which a contact or a release gives a warning."""
NEAR = 1e-3
"""s, distance from a contact or release within which a quality flag gives a warning."""
DEVIATIONS = 3.0
"""Standard uncertainties within which the true contact may lie."""


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
