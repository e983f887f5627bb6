"""Which string of the rig each pluck of a press belongs to.

A pluck is seen by the jack's rise at contact, by its rise from there to release, and by the force
drop. The rig predicts them for each string with Gaussian errors: some are those of the instrument,
which all its strings share, others are each string's own. The plucks of a press are therefore
compared with the strings together: an error that is shared leaves the differences of the strings,
and so their order. Every assignment of plucks to strings has a likelihood, also those in which
plucks belong to no string or two strings are found as one pluck; so has every order of contacts
that the load explains about as well. The probability of a string is that of all assignments with
it.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, permutations

import numpy as np

from sautereau.analysis.phases.contact import Contact
from sautereau.analysis.phases.expected import LEAST_CLIMB, LEAST_FORCE, Expected
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.signals import Signals
from sautereau.trajectory.motion import Floats

PROBABLE = 0.95  # Probability above which a string is stated
SHARED = 0.2  # Part of its force that a string held at once with another may get from that
Way = tuple[tuple[int, ...], dict[int, int], float]
"""A way to explain plucks: the contact of each release, the row of the string of each assigned
release, and the logarithm of the likelihood."""


def with_strings(
    pairs: Sequence[tuple[Contact, Release]], signals: Signals, strings: Expected
) -> list[tuple[Contact, Release, int | None, float]]:
    """Return the plucks of a press, their contacts in an order that is likely, with their strings.

    A string is its number in the rig, from 1, or None where the data do not show it; with the
    probability of this string, or of the likeliest one.
    """
    if not pairs:
        return []
    contacts, releases = zip(*pairs, strict=True)
    ways = list(_ways(contacts, releases, signals, strings))
    weights = np.exp(np.array([log for *_, log in ways]) - max(log for *_, log in ways))
    weights = (weights / weights.sum()).tolist()
    orders = dict.fromkeys((order for order, *_ in ways), 0.0)
    for (order, *_), weight in zip(ways, weights, strict=True):
        orders[order] += weight
    best = max(orders, key=orders.__getitem__)
    if orders[best] < PROBABLE:
        best = tuple(range(len(pairs)))  # as the load was fitted
    # In another order, a pluck has the contact of one string and the release of another. It is that
    # of the string with which it has more in common: what is farther apart decides.
    by_contact = np.ptp([c.time for c in contacts]) > np.ptp([r.time for r in releases])
    chances = np.zeros((len(pairs), len(strings.contacts)))
    for (order, rows, _), weight in zip(ways, weights, strict=True):
        for release, row in rows.items():
            if row < len(strings.contacts):
                chances[best.index(order[release]) if by_contact else release, row] += weight
    spread = 2 * math.sqrt(max(orders[best] * (1 - orders[best]), 0.0))
    found = []
    for k, release, chance in zip(best, releases, chances.tolist(), strict=True):
        row, exchange = int(np.argmax(chance)), spread * contacts[k].exchange_std
        std = math.hypot(_own_std(contacts[k]), exchange)
        string = strings.numbers[row] if chance[row] >= PROBABLE else None
        contact = replace(contacts[k], std=std, exchange_std=exchange)
        fall_std = math.hypot(release.fall_std, spread * contacts[k].exchange_force)
        found.append((contact, replace(release, fall_std=fall_std), string, chance[row]))
    return found


def _own_std(contact: Contact) -> float:
    """Return the standard uncertainty [s] of a contact for a given order of contacts."""
    return math.sqrt(max(contact.std**2 - contact.exchange_std**2, 0.0))


def _ways(
    contacts: Sequence[Contact], releases: Sequence[Release], signals: Signals, strings: Expected
) -> Iterator[Way]:
    """Yield every way to explain the plucks of a press."""
    count, plucks = 2 if signals.missing == "force" else 3, range(len(releases))
    members, places, variations = _rows(strings, len(strings.contacts) > len(releases))
    shared, places = np.diag(strings.settings.shared_stds[:count]) ** 2, places[:, :count]
    # Of a pluck of no string: as likely as one that is four standard deviations away.
    odds = 4.0**2 + 2 * math.log(PROBABLE / (1 - PROBABLE))
    free = [k for k in plucks if contacts[k].exchange_std]
    for exchanged in permutations(free):
        order = list(plucks)
        for k, other in zip(free, exchanged, strict=True):
            order[k] = other
        if any(contacts[k].time >= r.time for k, r in zip(order, releases, strict=True)):
            continue
        moved = [contacts[k].exchange_odds for k in plucks if order[k] != k]
        odds_of_order = sum(moved) / 2  # both contacts of an exchange have them
        seen, noise = _seen([contacts[k] for k in order], releases, signals)
        seen, noise = seen[:, :count], noise[:, :count, :count]
        alone = [-0.5 * (odds + np.linalg.slogdet(shared + one)[1]) for one in noise]
        for number in range(min(len(plucks), len(strings.contacts)) + 1):
            for each in combinations(plucks, number):
                rest = sum(alone[k] for k in plucks if k not in each)
                for rows in permutations(range(len(members)), number):
                    taken = [k for row in rows for k in members[row]]
                    if len(set(taken)) < len(taken):
                        continue
                    covariance = np.tile(shared, (number, number))
                    for k, (pluck, row) in enumerate(zip(each, rows, strict=True)):
                        block = slice(k * count, (k + 1) * count)
                        covariance[block, block] += variations[row, :count, :count] + noise[pluck]
                    away = (seen[list(each)] - places[list(rows)]).ravel()
                    distance = away @ np.linalg.solve(covariance, away)
                    log = rest - 0.5 * (distance + np.linalg.slogdet(covariance)[1])
                    log += odds_of_order
                    yield tuple(order), dict(zip(each, rows, strict=True)), float(log)


def _rows(strings: Expected, merge: bool) -> tuple[list[tuple[int, ...]], Floats, Floats]:
    """Return what a pluck may be, each by its strings, with its place and covariance.

    It is a string or, if strings may be found as one pluck, two of them: from the first contact to
    the last release, with the sum of their forces.
    """
    members: list[tuple[int, ...]] = [(k,) for k in range(len(strings.contacts))]
    members += combinations(range(len(strings.contacts)), 2) if merge else []
    ends, places = strings.contacts + strings.climbs, []
    for own in map(list, members):
        contact = strings.contacts[own].min()
        force = strings.forces[own].sum()
        places.append((contact, math.log(ends[own].max() - contact), math.log(force)))
    variations = [strings.variations[list(own)].mean(0) for own in members]
    return members, np.array(places), np.stack(variations)


def _seen(
    contacts: Sequence[Contact], releases: Sequence[Release], signals: Signals
) -> tuple[Floats, Floats]:
    """Return what is seen of plucks, shape (plucks, 3), and its covariance, shape (plucks, 3, 3).

    It is the rise at contact [m], and the logarithms of the rise to release and of the force drop.
    """
    times = np.array([[e.time for e in contacts], [e.time for e in releases]])
    stds = np.array([[_own_std(e) for e in contacts], [e.std for e in releases]])
    rises = np.interp(times, signals.time, signals.rise)
    first, last = np.abs(np.interp(times, signals.time, signals.speed)) * stds
    climbs = np.maximum(rises[1] - rises[0], LEAST_CLIMB)
    forces = np.maximum([release.fall for release in releases], LEAST_FORCE)
    both = (times[0][:, None] < times[1]) & (times[0] < times[1][:, None])
    known = np.where(both.sum(1) > 1, SHARED, 0.1)
    fallen = np.hypot(known, [release.fall_std for release in releases] / forces)
    slopes = np.zeros((len(releases), 3, 3))  # by the errors of contact, release and force
    slopes[:, 0, 0], slopes[:, 2, 2] = first, fallen
    slopes[:, 1, 0], slopes[:, 1, 1] = -first / climbs, last / climbs
    seen = np.stack([rises[0], np.log(climbs), np.log(forces)], 1)
    return seen, slopes @ slopes.transpose(0, 2, 1)
