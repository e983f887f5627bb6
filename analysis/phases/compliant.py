"""The plucks of a press on a compliant key, which bends, heaves, and rings."""

import math
from dataclasses import replace
from itertools import permutations

import numpy as np
from scipy.ndimage import uniform_filter1d

from sautereau.analysis.phases.contact import Contact
from sautereau.analysis.phases.event import refine_event
from sautereau.analysis.phases.expected import Expected
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.saw_teeth import EXCHANGED, SawTeeth, Solved
from sautereau.analysis.phases.search import Growth, Searched, row_noise, search
from sautereau.analysis.phases.signals import BRIDGED, Signals
from sautereau.analysis.phases.slow import Slow
from sautereau.trajectory.motion import Floats

HIGH = 0.7
"""Rise of the jack over the full one, from which on the key may meet its front felt."""
BEYOND = 3e-3
"""m, rise of the jack above the last release that the rig expects, up to which that may be."""
EDGE = 3.0
"""Widths from there at which a release must be seen completely."""
SIGNIFICANT, CLEARLY = 12.0, 30.0
"""Least significance of a pluck, and of one that only a shorter way shows."""
SHORTEST = 0.5e-3
"""s, shortest pluck."""
NEAR, LEAST_NEAR, MOST_NEAR = 2.0, 0.25e-3, 1.0e-3
"""Uncertainty of a release before its refinement over that of the search, and its bounds in s."""
LARGER, LEAST_STD, CONTACT_PART = 2.2, 0.2e-3, 1.2
"""Standard uncertainty of a contact over that of its fit; s, what is added to it; and the part of
the pluck's duration, over the fraction of the force that the key's model does not explain. From
presses of the independent simulator, and tested on others."""
LEAST_RELEASE_STD, RELEASE_PART, BESIDE = 0.1e-3, 0.6, 1.5
"""The same of a release; and a factor of the uncertainties of several releases in a press, as each
rings on in the next one's fit."""
REWEIGHTED = 2
"""Number of fits with weights by the residuals of the fit before."""
UNEXPLAINED = 5.0
"""Error of a row over the local rms of the residuals of the fit before."""
AROUND = 65
"""Number of rows of this local rms."""
LEAST_HELD = 2.5
"""Widths of the smoothing from a contact at which a fit starts to its release, at least."""
LEAST_HIDDEN, CLEAR = 3 * BRIDGED, 1000.0
"""N, least force of a pluck whose release lies in a drop-out, where the inertia is interpolated,
unless it is more significant than this."""


def compliant_plucks(
    strings: Expected, signals: Signals, way: tuple[int, int]
) -> tuple[list[tuple[Contact, Release]], Searched]:
    """Return the plucks on the way down, and the search that found them.

    Args:
        strings: Of the rig.
        signals: Of the press.
        way: First and last sample of the way down.
    """
    way = way[0], _turn(signals, *way)
    start, last = (float(signals.time[sample]) for sample in way)
    slow, searched = _searched(strings, signals, way)
    growths = searched.growths
    nears = [min(max(NEAR * g.release_std, LEAST_NEAR), MOST_NEAR) for g in growths]
    releases = [
        refine_event(
            *(signals, growth.release, near, growth.force, start, last),
            [other.release for other in growths if other is not growth],
        )
        for growth, near in zip(growths, nears, strict=True)
    ]
    growths = _with_releases(slow, strings, searched, releases)
    found: list[tuple[Contact, Release]] = []
    for growth, near, release in zip(growths, nears, releases, strict=True):
        around = signals.no_velocity[
            slice(*(signals.sample(growth.release + side) for side in (-near, near)))
        ]
        hidden = around.any() and growth.force < LEAST_HIDDEN and growth.significance < CLEAR
        if hidden or release.time - growth.contact < SHORTEST:
            continue
        wrong = searched.residual / growth.force * (release.time - growth.contact)
        std = LARGER * growth.contact_std
        std = math.hypot(std, LEAST_STD, CONTACT_PART * wrong, signals.instant_std)
        contact = Contact(growth.contact, std, growth.significance, growth.force, growth.noise)
        std = math.hypot(release.std, LEAST_RELEASE_STD, RELEASE_PART * wrong)
        std *= BESIDE if len(growths) > 1 else 1.0
        found.append((contact, replace(release, std=std)))
    return found, searched


def _searched(strings: Expected, signals: Signals, way: tuple[int, int]) -> tuple[Slow, Searched]:
    """Return the smoothed way down, and what was found in it.

    Where a string is missing, the last part is omitted, as the key's impact on its front felt
    spoils the fit of what was before; of a key that only moves on it improves it.
    """
    slow = Slow(signals, *way)
    searched = search(slow, strings)
    highest = float((strings.contacts + strings.climbs).max()) + BEYOND
    end = way[0] + int(np.argmax(signals.rise[slice(*way)] > highest))
    last = float(signals.time[end]) - EDGE * slow.width
    found = _until(last, searched, SIGNIFICANT)
    if end == way[0] or found >= len(strings.contacts):
        return slow, searched
    shorter = Slow(signals, way[0], end)
    again = search(shorter, strings)
    more = _until(last, again, CLEARLY) > found
    return (shorter, again) if more else (slow, searched)


def _until(last: float, searched: Searched, least: float) -> int:
    """Return the number of growths of a least significance that end before an instant [s]."""
    return sum(growth.release < last for growth in searched.significant(least))


def _turn(signals: Signals, begin: int, end: int) -> int:
    """Return the sample at which the key first rebounds from its front felt."""
    high = begin + int(np.argmax(signals.rise[begin:end] > HIGH * signals.rise[end]))
    back = signals.speed[high:end] < 0.0
    return high + int(np.argmax(back)) if back.any() else end


def _with_releases(
    slow: Slow, strings: Expected, searched: Searched, releases: list[Release]
) -> tuple[Growth, ...]:
    """Return the growths with the contacts for the releases of their own fits.

    The smoothed load shows a release with an error which its contact shares. The load is not
    explained equally well everywhere, so it is fitted several times: each fit after the first one
    weights the rows by the local rms of the residuals of the fit before. A contact is the mean of
    all fits, and its uncertainty contains their scatter. Strings that are held at once are fitted
    once, since rows that show a wrong contact of one of them would lose their weight.
    """
    growths = searched.growths
    short = any(r.time - g.contact < SHORTEST for g, r in zip(growths, releases, strict=True))
    if short or not growths:
        return growths
    known = np.array([(release.time, release.std) for release in releases])
    noise = row_noise(searched.residual)
    fit = SawTeeth(slow, searched.compliance, noise, strings, known)
    start = np.array([(g.contact, r.time) for g, r in zip(growths, releases, strict=True)])
    plucks, solved = _best(fit, *fit.refined(start)[:2])
    fits = [(plucks[:, 0], fit.stds(plucks, solved)[0])]
    together = (plucks[1:, 0] < plucks[:-1, 1]).any()
    for _ in range(0 if together else REWEIGHTED):
        square = uniform_filter1d((solved.load / fit.weight) ** 2, AROUND, mode="nearest")
        error = UNEXPLAINED * np.sqrt(np.maximum(square, 0.0))
        fit = SawTeeth(slow, searched.compliance, noise, strings, known, error)
        plucks, solved, _ = fit.refined(plucks)
        fits.append((plucks[:, 0], fit.stds(plucks, solved)[0]))
    contacts = np.array([contact for contact, _ in fits])
    stds = np.hypot(np.array([std for _, std in fits])[..., 0].mean(0), contacts.std(0))
    each = zip(growths, contacts.mean(0).tolist(), stds.tolist(), strict=True)
    return tuple(replace(g, contact=contact, contact_std=std) for g, contact, std in each)


def _best(fit: SawTeeth, plucks: Floats, solved: Solved) -> tuple[Floats, Solved]:
    """Return plucks and their fit, or much better ones with other contacts.

    The sum of strings that are held at once has several minima. So further fits start from the
    contacts of the rig, assigned to the releases in every order.
    """
    rig = np.interp(fit.strings.contacts, fit.rise, fit.slow.hops)
    if not 1 < len(plucks) <= len(rig):
        return plucks, solved
    variance, releases = max(fit.noises(plucks, solved)), plucks[:, 1]
    latest = releases - LEAST_HELD * fit.slow.width
    starts = [
        np.column_stack([np.minimum(order, latest), releases])
        for order in permutations(rig, len(plucks))
    ]
    best = fit.refined(plucks, variance)
    least = best[2] / EXCHANGED
    for start in starts:
        other = fit.refined(start, variance)
        if other[2] < least and (other[1].forces > 0).all():
            best, least = other, other[2]
    return best[:2]
