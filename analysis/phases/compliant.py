"""The plucks of a press on a compliant key, which bends, heaves, and rings."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from sautereau.analysis.phases.contact import PEAK, Contact
from sautereau.analysis.phases.event import refine_event
from sautereau.analysis.phases.expected import Expected
from sautereau.analysis.phases.found import FAIR
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.saw_teeth import SawTeeth, exchange_stds, with_better_contacts
from sautereau.analysis.phases.search import Searched, row_noise, search
from sautereau.analysis.phases.signals import Signals
from sautereau.analysis.phases.slow import Slow

HIGH = 0.9
"""Fraction of the full rise of the jack above which the key may reach its front felt: a felt is
compressed by less than a tenth of the dip. A key whose string was released may swing back below."""


def compliant_plucks(
    strings: Expected, signals: Signals, way: tuple[int, int]
) -> tuple[list[tuple[Contact, Release]], Searched]:
    """Return the plucks on the way down, and the search that found them.

    Args:
        way: First and last sample of the way down.
    """
    begin, end = way
    # Up to where the key first rebounds from its front felt.
    high = begin + int(np.argmax(signals.rise[begin:end] > HIGH * signals.rise[end]))
    back = signals.speed[high:end] < 0.0
    way = begin, high + int(np.argmax(back)) if back.any() else end
    start, last = (float(signals.time[sample]) for sample in way)
    slow, searched = _searched(strings, signals, way)
    growths = searched.growths
    settings = signals.settings
    nears = [min(max(2 * g.release_std, settings.near), 4 * settings.near) for g in growths]
    releases = [
        refine_event(
            *(signals, growth.release, near, growth.force, start, last),
            [other.release for other in growths if other is not growth],
        )
        for growth, near in zip(growths, nears, strict=True)
    ]
    contacts = _contacts(slow, strings, searched, releases)
    found: list[tuple[Contact, Release]] = []
    before = -math.inf
    several = settings.several if len(growths) > 1 else 1.0
    for growth, contact, release in zip(growths, contacts, releases, strict=True):
        if not contact.time < release.time <= last:
            continue
        wrong = searched.residual / growth.force * (release.time - contact.time)
        wrong *= settings.unexplained
        parts = settings.contact_least, wrong, signals.instant_std, contact.exchange_std
        std = math.hypot(settings.contact_larger * contact.std, *parts)
        contact = replace(contact, std=std)
        std = math.hypot(release.std, settings.release_least, wrong / 2)
        std *= several
        # What rings after the release before looks like one that is later than it is.
        if release.time - before < 3.5e-3:
            std = math.hypot(std, (release.time - before) / 3)
        before = release.time
        # A growth whose release is less certain is no pluck.
        if std < max(10e-3, 0.05 * (release.time - contact.time)):
            force_std = settings.contact_larger * growth.force_std
            fall_std = several * math.hypot(force_std, searched.residual)
            release = replace(release, std=std, fall_std=fall_std)
            found.append((contact, release))
    return found, searched


def lag_of(
    strings: Expected,
    signals: Signals,
    way: tuple[int, int],
    plucks: Sequence[tuple[Contact, Release]],
    compliance: float = 0.0,
) -> tuple[float, float]:
    """Return by how much the force is late, compared with the velocity, and its uncertainty.

    Args:
        compliance: s^2, of the key.

    Returns:
        Both in s; the standard uncertainty is infinite where there are too few samples.
    """
    begin, end = way
    # The front felt, which the fit does not know, looks like a lag of 0.2 to 0.5 ms.
    high = begin + int(np.argmax(signals.rise[begin : end + 1] > HIGH * signals.rise[end]))
    slow = Slow(signals, begin, max(high, signals.sample(plucks[-1][1].time)))
    if len(slow.time) < 12:
        return 0.0, math.inf
    places = np.array([(contact.time, release.time) for contact, release in plucks])
    known = np.array([(release.time, release.std) for _, release in plucks])
    # A plectrum that strikes its string makes a peak of the load, for which there is no column.
    away = (slow.time - places[:, :1]) / math.hypot(PEAK, slow.width)
    peaks = 0.1 * np.exp(-0.5 * away**2).sum(0)  # N
    fit = SawTeeth(slow, compliance, row_noise(0.0, slow.settings), strings, known, peaks)
    solved = fit.solved(places)
    rms = float(np.sqrt(np.mean(solved.row_residuals**2)))
    return fit.lag(solved), fit.lag_std(solved) * row_noise(rms, slow.settings) / fit.noise


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
    highest = float((strings.contacts + strings.climbs).max()) + 3e-3
    above = signals.rise[begin:end] > min(highest, HIGH * float(signals.rise[end]))
    shorter = begin + int(np.argmax(above)) if above.any() else end
    least = 2 * signals.settings.significance
    found = _number(searched, least, slow, float(signals.time[shorter]))
    for last in (shorter, end):
        if found >= wanted and searched.residual < FAIR:
            break
        if (last - begin) / signals.rate < slow.width:
            continue  # nothing is left before the front felt
        finer = Slow(signals, begin, last, finer=2)
        if last < end or finer.width < slow.width:
            again = search(finer, strings)
            # A pluck that only a repetition finds must be clearly significant.
            number = _number(again, 2.5 * least, finer, float(signals.time[last]))
            better = number == found > 0 and again.residual < searched.residual / 2
            if number > found or better:
                slow, searched, found = finer, again, number
            elif searched.residual < FAIR and not searched.significant(least / 2):
                # Of a poor fit a warning says so; here it may be a pluck.
                slight = *again.significant(least / 2), searched.further
                searched = replace(searched, further=slight[0])
    return slow, searched


def _number(searched: Searched, least: float, slow: Slow, end: float) -> int:
    """Return how many growths above a significance end clearly before an instant [s]."""
    last = end - 3 * slow.width
    return sum(growth.release < last for growth in searched.significant(least))


def _contacts(
    slow: Slow, strings: Expected, searched: Searched, releases: list[Release]
) -> list[Contact]:
    """Return the contacts of growths, fitted for the given releases.

    An error of a release in the smoothed load causes an error of its contact. The load is not
    explained equally well everywhere, so it is fitted twice: the second fit weights the rows by the
    local rms of the residuals of the first. The weighted rows have the noise of a row, so that the
    priors of contacts and releases count in units of it. Where strings may be exchanged, the load
    is fitted once: rows that show a wrong contact would lose their weight.
    """
    growths = searched.growths
    contacts = [
        Contact(g.contact, g.contact_std, g.significance, g.force, g.noise) for g in growths
    ]
    start = np.array([(g.contact, r.time) for g, r in zip(growths, releases, strict=True)])
    if not growths or (np.diff(start) <= 0).any():
        return contacts
    known = np.array([(release.time, release.std) for release in releases])
    noise = row_noise(searched.residual, slow.settings)
    fit = SawTeeth(slow, searched.compliance, noise, strings, known)
    plucks, solved = with_better_contacts(fit, *fit.refined(start)[:2])
    exchange, first = np.zeros((len(plucks), 3)), plucks[:, 0]
    if (plucks[1:, 0] < plucks[:-1, 1]).any():
        exchange = exchange_stds(fit, plucks, max(fit.noises(plucks, solved)))
    if not exchange.any():
        square = uniform_filter1d((solved.row_residuals / fit.weight) ** 2, 25, mode="nearest")
        error = 12 * np.sqrt(np.maximum(square, 0.0))
        fit = SawTeeth(slow, searched.compliance, noise, strings, known, error)
        plucks, solved, _ = fit.refined(plucks, noise**2)
    stds = np.hypot(fit.stds(plucks, solved)[:, 0], slow.settings.change * (plucks[:, 0] - first))
    values = np.column_stack([plucks[:, 0], stds, exchange]).tolist()
    names = "time", "std", "exchange_std", "exchange_force", "exchange_odds"
    return [
        replace(contact, **dict(zip(names, each, strict=True)))
        for contact, each in zip(contacts, values, strict=True)
    ]
