"""What is weak about the phases of a press, each with what to do about it."""

from collections.abc import Sequence

import numpy as np

from sautereau.analysis.phases.found import HeldString
from sautereau.analysis.phases.signals import Signals
from sautereau.daq.signals.quality_flags import QualityFlag

WEAK = 0.5e-3
"""s, uncertainty from which on a contact or a release is weak."""
NEAR = 1e-3
"""s, beside a contact or release, in which a doubtful stretch may move it."""
DEVIATIONS = 3.0
"""Standard uncertainties within which a contact may be."""


def ending(signals: Signals, begin: int) -> list[str]:
    """Return whether the recording ends on the way down, which begins at a sample."""
    speed, top = signals.speed[begin:], int(np.argmax(signals.rise[begin:]))
    if top < len(speed) - 2 or speed[top] <= 0.5 * speed.max():
        return []
    return ["the recording ends while the key still goes down; record for longer"]


def doubts_of(
    signals: Signals, marks: Sequence[QualityFlag], plucks: Sequence[HeldString], steady: float
) -> list[str]:
    """Return what is weak about plucks.

    Args:
        signals: Of the press.
        marks: Stretches of it that are not to be believed.
        plucks: In order of time.
        steady: s, when the run-up ends.
    """
    found = []
    before = -float("inf")
    for number, held in enumerate(plucks, 1):
        who = f"pluck {number}: " if len(plucks) > 1 else ""
        earliest = held.contact - DEVIATIONS * held.contact_std
        if earliest < before:
            found.append(
                f"{who}contact may come before the release of the string before, at"
                f" {before * 1e3:.5g} ms, which hides it: it is uncertain by"
                f" {held.contact_std * 1e3:.2g} ms; set the strings further apart"
            )
        elif earliest < steady:
            found.append(
                f"{who}contact may lie in the run-up, which ends at {steady * 1e3:.5g} ms, and"
                f" rests on the rig's inertia there: it is uncertain by"
                f" {held.contact_std * 1e3:.2g} ms; press more slowly"
            )
        elif held.contact_std > WEAK:
            found.append(
                f"{who}contact is uncertain by {held.contact_std * 1e3:.2g} ms: the force hardly"
                " bends there; look at the noise of the force"
            )
        if held.release_std > WEAK:
            found.append(
                f"{who}release is uncertain by {held.release_std * 1e3:.2g} ms; look at the noise"
                " of the force and at the sampling rate"
            )
        for what, instant in (("contact", held.contact), ("release", held.release)):
            for mark in marks:
                if mark.start - NEAR < instant < mark.stop + NEAR:
                    found.append(
                        f"{who}{what} at {instant * 1e3:.5g} ms lies at a {mark.kind} of"
                        f" {mark.channel}, {mark.start * 1e3:.5g} to {mark.stop * 1e3:.5g} ms,"
                        " and rests on the other channel"
                    )
        before = held.release
    return found
