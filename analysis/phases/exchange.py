"""Contacts of strings held at once: whether they may belong to each other's release."""

from itertools import combinations, permutations

import numpy as np

from sautereau.analysis.phases.saw_teeth import SawTeeth, Solved
from sautereau.trajectory.motion import Floats

EQUAL = 1.1  # Ratio of two chi2 up to which the contacts of both fits count as equally good


def with_better_contacts(fit: SawTeeth, plucks: Floats, solved: Solved) -> tuple[Floats, Solved]:
    """Return plucks and their fit, or much better ones with other contacts.

    The sum of strings that are held at once has several minima. So further fits start from the
    contacts of the rig, assigned to the releases in every order.
    """
    rig = np.interp(fit.strings.contacts, fit.rise, fit.slow.hops)
    if not 1 < len(plucks) <= len(rig):
        return plucks, solved
    variance, releases = max(fit.noises(plucks, solved)), plucks[:, 1]
    latest = releases - 2.5 * fit.slow.width
    starts = [
        np.column_stack([np.minimum(order, latest), releases])
        for order in permutations(rig, len(plucks))
    ]
    best = fit.refined(plucks, variance)
    least = best[2] / EQUAL
    for start in starts:
        other = fit.refined(start, variance)
        if other[2] < least and (other[1].forces > 0).all():
            best, least = other, other[2]
    return best[:2]


def exchange_stds(fit: SawTeeth, plucks: Floats, variance: float) -> Floats:
    """Return the uncertainties of plucks whose contacts may belong to each other's release.

    Where strings are held at once and their contacts fit about as well when they are exchanged,
    each contact is one of two instants, and the uncertainty is half their distance; so it is for
    the forces.

    Args:
        plucks: s, refined contacts and releases in order of release, shape (plucks, 2).
        variance: N^2, as for `refined`.

    Returns:
        Of contacts [s] and of forces [N], and the logarithms of the odds of the exchange, shape
        (plucks, 3); 0 for contacts that belong to their release.
    """
    found = np.zeros((len(plucks), 3))
    _, solved, least = fit.refined(plucks, variance)
    for i, j in combinations(range(len(plucks)), 2):
        exchanged = plucks.copy()
        exchanged[[i, j], 0] = plucks[[j, i], 0]
        if (np.diff(exchanged) <= fit.slow.width).any():
            continue
        other, fitted, chi2 = fit.refined(exchanged, variance)
        if chi2 < fit.slow.settings.exchange * least:
            away = np.stack([other[:, 0] - plucks[:, 0], fitted.forces - solved.forces], 1)
            found[[i, j], :2] = np.maximum(found[[i, j], :2], np.abs(away[[i, j]]) / 2)
            # Rows within some widths of the smoothing have the same error: while strings are held,
            # there are about 20 independent ones.
            found[[i, j], 2] = -20 / 2 * np.log(chi2 / least)
    return found


def in_order(fit: SawTeeth, plucks: Floats, solved: Solved) -> tuple[Floats, Solved]:
    """Return the plucks with contacts in the order of releases, if that fits about as well.

    The sum of two saw-teeth hardly changes if their contacts are exchanged.
    """
    order = np.argsort(plucks[:, 1])
    swapped = plucks.copy()
    swapped[order, 0] = np.sort(plucks[:, 0])
    if (swapped == plucks).all():
        return plucks, solved
    other, fitted, _ = fit.refined(swapped)
    better = fitted.chi2 < EQUAL * solved.chi2
    return (other, fitted) if better else (plucks, solved)
