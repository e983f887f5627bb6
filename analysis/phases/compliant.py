"""The plucks of a press on a compliant key, which bends, heaves, and rings."""

import math
from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from sautereau.analysis.phases.contact import Contact
from sautereau.analysis.phases.event import refine_event
from sautereau.analysis.phases.exchange import exchange_stds, with_better_contacts
from sautereau.analysis.phases.expected import Expected
from sautereau.analysis.phases.found import FAIR, Growth
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.saw_teeth import SawTeeth
from sautereau.analysis.phases.search import Searched, row_noise, search
from sautereau.analysis.phases.signals import Signals
from sautereau.analysis.phases.slow import Slow

HIGH = 0.9
"""Fraction of the full rise of the jack above which the key may reach its front felt: a felt is
compressed by less than a tenth of the dip. A key whose string was released may swing back below."""
BEYOND = 3e-3
"""m, distance above the last release that the rig expects, at which the shorter way ends at the
latest."""
FINER = 220  # Largest number of widths in repetitions of the search
BETTER = 0.5
"""Largest ratio of the unexplained loads of a repetition and the search before it, at which it is
used if it finds as many plucks."""
EDGE = 3.0  # Least distance of a release from the end of the way, in widths of the smoothing
SIGNIFICANT = 12.0  # Least significance of a pluck
CLEARLY_SIGNIFICANT = 30.0
"""Least significance of a pluck that only a repetition of the search finds."""
SHORTEST = 0.5e-3  # s, shortest pluck
NEAR = 2.0  # Standard uncertainty of a release before its refinement, over that of the search
LEAST_NEAR = 0.25e-3  # s, smallest value of this uncertainty
MOST_NEAR = 1.0e-3  # s, largest value of this uncertainty
LARGER = 1.6
"""Standard uncertainty of a contact or a force over that of its fit. This and the next six
constants are from presses of the independent simulator, and were tested on others."""
LEAST_STD = 0.2e-3
"""s, standard uncertainty that is added to that of a contact (root sum of squares)."""
CONTACT_PART = 1.2
"""Added to the standard uncertainty of a contact: this factor times the pluck's duration times the
fraction of the force that the model of the key does not explain."""
LEAST_RELEASE_STD = 0.05e-3  # s, standard uncertainty that is added to that of a release
RELEASE_PART = 0.6  # The same as `CONTACT_PART` for a release
FORCE_PART = 0.015
"""Relative standard uncertainty of a force, added to those of the fit and of the load that is not
explained."""
MOST_RELEASE_STD = 10e-3, 0.05
"""Standard uncertainty of a release, in s and over the pluck's duration, above both of which a
growth of the load is no pluck."""
SEVERAL = 1.5
"""Factor of the uncertainties of releases and forces where a press has several: the ringing after
one release disturbs the fit of the next."""
FOLLOWING = 3.5e-3, 1 / 3
"""Distance from the release before [s] below which a release may be earlier, since what rings after
the other looks like it; and its further standard uncertainty over this distance."""
UNEXPLAINED = 12.0  # Error of a row over the local rms of the residuals of the fit before
CHANGE = 0.5
"""Part of the change of a contact by these weights that is added to its standard uncertainty."""
AROUND = 25  # Number of rows over which this rms is taken


def compliant_plucks(
    strings: Expected, signals: Signals, way: tuple[int, int]
) -> tuple[list[tuple[Contact, Release]], Searched]:
    """Return the plucks on the way down, and the search that found them.

    Args:
        way: First and last sample of the way down.
    """
    way = way[0], _rebound(signals, *way)
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
    before = -math.inf
    several = SEVERAL if len(growths) > 1 else 1.0
    for growth, release in zip(growths, releases, strict=True):
        if not growth.contact + SHORTEST <= release.time <= last:
            continue
        wrong = searched.residual / growth.force * (release.time - growth.contact)
        parts = LEAST_STD, CONTACT_PART * wrong, signals.instant_std, growth.exchange_std
        contact = Contact(
            time=growth.contact,
            std=math.hypot(LARGER * growth.contact_std, *parts),
            gain=growth.significance,
            at_release=growth.force,
            noise=growth.noise,
            exchange_std=growth.exchange_std,
            exchange_force=growth.exchange_force,
            exchange_odds=growth.exchange_odds,
        )
        std = math.hypot(release.std, LEAST_RELEASE_STD, RELEASE_PART * wrong)
        std *= several
        within, part = FOLLOWING
        if release.time - before < within:
            std = math.hypot(std, part * (release.time - before))
        before = release.time
        limit, part = MOST_RELEASE_STD
        if std < max(limit, part * (release.time - growth.contact)):
            parts = LARGER * growth.force_std, FORCE_PART * growth.force, searched.residual
            release = replace(release, std=std, fall_std=several * math.hypot(*parts))
            found.append((contact, release))
    return found, searched


def _searched(strings: Expected, signals: Signals, way: tuple[int, int]) -> tuple[Slow, Searched]:
    """Return the smoothed way down, and what was found in it.

    If fewer plucks are found than the rig has strings, or the load is not explained, the search is
    repeated without the last part of the way down, since the impact of the key on its front felt
    disturbs the fit of everything before it. This part is not always omitted: where the key moves
    freely, it improves the fit. Repetitions are smoothed less: where the finger pauses, a pluck is
    a short part of the way down.
    """
    begin, end = way
    slow = Slow(signals, begin, end)
    searched, wanted = search(slow, strings), len(strings.contacts)
    highest = float((strings.contacts + strings.climbs).max()) + BEYOND
    above = signals.rise[begin:end] > min(highest, HIGH * float(signals.rise[end]))
    shorter = begin + int(np.argmax(above)) if above.any() else end
    found = _number(searched, SIGNIFICANT, slow, float(signals.time[shorter]))
    for last in (shorter, end):
        if found >= wanted and searched.residual < FAIR:
            break
        if (last - begin) / signals.rate < slow.width:
            continue  # nothing is left before the front felt
        finer = Slow(signals, begin, last, FINER)
        if last < end or finer.width < slow.width:
            again = search(finer, strings)
            number = _number(again, CLEARLY_SIGNIFICANT, finer, float(signals.time[last]))
            better = number == found > 0 and again.residual < BETTER * searched.residual
            if number > found or better:
                slow, searched, found = finer, again, number
    return slow, searched


def _number(searched: Searched, least: float, slow: Slow, end: float) -> int:
    """Return how many growths above a significance end clearly before an instant [s]."""
    last = end - EDGE * slow.width
    return sum(growth.release < last for growth in searched.significant(least))


def _rebound(signals: Signals, begin: int, end: int) -> int:
    """Return the sample at which the key first rebounds from its front felt."""
    high = begin + int(np.argmax(signals.rise[begin:end] > HIGH * signals.rise[end]))
    back = signals.speed[high:end] < 0.0
    return high + int(np.argmax(back)) if back.any() else end


def _with_releases(
    slow: Slow, strings: Expected, searched: Searched, releases: list[Release]
) -> tuple[Growth, ...]:
    """Return the growths with contacts that are fitted for the given releases.

    An error of a release in the smoothed load causes an error of its contact. The load is not
    explained equally well everywhere, so it is fitted twice: the second fit weights the rows by the
    local rms of the residuals of the first. The weighted rows have the noise of a row, so that the
    priors of contacts and releases count in units of it. Where strings may be exchanged, the load
    is fitted once: rows that show a wrong contact would lose their weight.
    """
    growths = searched.growths
    short = any(r.time - g.contact < SHORTEST for g, r in zip(growths, releases, strict=True))
    if short or not growths:
        return growths
    known = np.array([(release.time, release.std) for release in releases])
    noise = row_noise(searched.residual)
    fit = SawTeeth(slow, searched.compliance, noise, strings, known)
    start = np.array([(g.contact, r.time) for g, r in zip(growths, releases, strict=True)])
    plucks, solved = with_better_contacts(fit, *fit.refined(start)[:2])
    exchange, first = np.zeros((len(plucks), 3)), plucks[:, 0]
    if (plucks[1:, 0] < plucks[:-1, 1]).any():
        exchange = exchange_stds(fit, plucks, max(fit.noises(plucks, solved)))
    if not exchange.any():
        square = uniform_filter1d((solved.row_residuals / fit.weight) ** 2, AROUND, mode="nearest")
        error = UNEXPLAINED * np.sqrt(np.maximum(square, 0.0))
        fit = SawTeeth(slow, searched.compliance, noise, strings, known, error)
        plucks, solved, _ = fit.refined(plucks, noise**2)
    stds = np.hypot(fit.stds(plucks, solved)[:, 0], CHANGE * (plucks[:, 0] - first))
    values = np.column_stack([plucks[:, 0], stds, exchange])
    names = "contact", "contact_std", "exchange_std", "exchange_force", "exchange_odds"
    return tuple(
        replace(growth, **dict(zip(names, each, strict=True)))
        for growth, each in zip(growths, values.tolist(), strict=True)
    )
