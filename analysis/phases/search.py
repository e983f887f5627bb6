"""Search for plucks: from contact to release the load grows with the jack's rise, then collapses.

Every pair of a contact and a release is tried against the load that a key without a string leaves,
by cumulative sums of products with saw-teeth. Ringing of key, jack and transducer hardly changes
these sums, as it changes sign while the string is held. The best pair is added, all instants are
refined, and the search is repeated for as many strings as the rig has.
"""

from dataclasses import dataclass

import numpy as np

from sautereau.analysis.phases.expected import Expected
from sautereau.analysis.phases.saw_teeth import (
    CLIMB_STD,
    CONTACT_STD,
    SawTeeth,
    Solved,
    noise_around,
)
from sautereau.analysis.phases.slow import MOST_COMPLIANT, Slow
from sautereau.trajectory.motion import Floats

NOISE, LEAST_NOISE, CORRELATED = 0.015, 2e-3, 2.0
"""N, of a smoothed row, of unmodelled vibration, at first and at least; it weights the priors.
Later it is the rms of the residuals, times this factor as neighbouring rows are correlated."""
LEAST_RISE = 0.25e-3
"""m, least rise of the jack from contact to release."""
MOST_ROWS = 300
"""Rows in which pairs are tried."""
APART = 0.5
"""Least widths between two releases."""
ANYWHERE = 0.1
"""Weight of a pair that is far from what the rig says."""
SIGNIFICANCE = 6.0
"""Least reduction of chi2 by a pluck over the noise around it, and over its deviation from the
rig."""
SLOWEST = 0.1
"""Speed of the jack over the largest one, below which it holds its string."""
LEAST_FRACTION, LEAST_FORCE = 0.12, 3e-3
"""Fraction of the largest force of a press, and N, below which there is no pluck."""
STARTS, BETWEEN = 2, 4.0
"""Pairs that are refined, and widths between their releases."""
ROUNDS, QUICK = 3, 1
"""Rounds for the compliance, and pairs that are refined in the first one."""


@dataclass(frozen=True)
class Growth:
    """A stretch over which the load grows with the rise, and then collapses."""

    contact: float
    """s after the trigger."""
    release: float
    """s after the trigger."""
    force: float
    """N at the finger, by which the load collapses."""
    significance: float
    """Reduction of chi2 over the noise around it, and over 1 plus its squared deviation from the
    rig."""
    contact_std: float = 0.0
    """s, standard uncertainty; not evaluated for a further growth."""
    release_std: float = 0.0
    """s, the same."""
    noise: float = 0.0
    """Variance of the residuals around it, of sums over a third of it, over that of `NOISE`."""


@dataclass(frozen=True)
class Searched:
    """The result of a search."""

    growths: tuple[Growth, ...]
    """In order of release."""
    further: Growth | None
    """The next one, for which the rig has no string."""
    compliance: float
    """s^2, k of `sautereau.analysis.phases.slow`."""
    residual: float
    """N, rms of the load that is not explained."""


def search(slow: Slow, strings: Expected) -> Searched:
    """Return the growths of a press that collapse.

    Args:
        slow: Of the way down.
        strings: Of the rig; there are at most as many growths.
    """
    compliance, noise = 0.0, NOISE
    found = Searched((), None, 0.0, 0.0)
    if len(slow.time) < 12:
        return found
    plucks = np.zeros((0, 2))
    for number in range(ROUNDS):
        fit = SawTeeth(slow, compliance, noise, strings)
        found, plucks = _Search(fit, QUICK if number == 0 else None, plucks, number > 1).all()
        change = abs(found.compliance - compliance)
        compliance, before = found.compliance, noise
        noise = row_noise(found.residual)
        if number > 0 and change < max(2e-7, 0.05 * compliance) and 0.5 < noise / before < 2:
            break
    return found


def row_noise(residual: float) -> float:
    """Return the noise [N] of a row, by the rms of the load that is not explained [N]."""
    return max(LEAST_NOISE, CORRELATED * residual)


class _Search:
    """The search of plucks, one by one, with one compliance.

    Args:
        fit: With this compliance.
        most: Largest number of starts of each search; None for no limit.
        earlier: s, contacts and releases that were found with another compliance, shape (n, 2).
        trusted: Whether these need no other starts.
    """

    def __init__(self, fit: SawTeeth, most: int | None, earlier: Floats, trusted: bool):
        self._fit, self._most, self._earlier, self._trusted = fit, most, earlier, trusted
        self._moving = SLOWEST * float(fit.slow.speed().max())

    def all(self) -> tuple[Searched, Floats]:
        """Return the plucks, added one by one; and their instants, in the order of addition."""
        strings = len(self._fit.strings.contacts)
        found, values, left = np.zeros((0, 2)), np.zeros(0), self._fit.solved(np.zeros((0, 2)))
        gains: list[float] = []
        further = None
        while len(found) <= strings:
            known = len(found) < len(self._earlier)
            starts = [] if known and self._trusted else self._starts(found, left)[: self._most]
            if known:
                starts.append(self._earlier[: len(found) + 1])
            if not starts:
                break
            trials: list[tuple[Floats, Solved, float]] = []
            trials.extend(self._fit.refined(start) for start in starts)
            trials.sort(key=lambda refined: refined[2])
            made = (self._judged(*self._fit.in_order(*trial[:2]), found, left) for trial in trials)
            best = next(filter(None, made), None)
            if best is None:
                break
            trial, solved, forces, gain = best
            if len(found) == strings:
                weakest = int(np.argmin([*gains, gain]))
                further = _growth(trial[weakest], float(forces[weakest]), [*gains, gain][weakest])
                if weakest == strings:
                    break
            found, left, values = trial, solved, forces
            gains.append(gain)
        k = self._fit.better_compliance(left)
        stds, noises = self._fit.stds(found, left)
        each = zip(found.tolist(), values.tolist(), gains, stds, noises, strict=True)
        growths = [
            Growth(contact, release, force, gain, std[0], std[1], noise)
            for (contact, release), force, gain, std, noise in each
        ]
        if further and len(growths) > strings:
            growths.remove(min(growths, key=lambda g: g.significance))
        searched = Searched(
            tuple(sorted(growths, key=lambda g: g.release)),
            further,
            min(max(k, 0.0), MOST_COMPLIANT),
            float(np.sqrt(np.mean(left.load**2))),
        )
        return searched, found

    def _judged(
        self,
        trial: Floats,
        solved: Solved,
        found: Floats,
        before: Solved,
    ) -> tuple[Floats, Solved, Floats, float] | None:
        """Return plucks, their fit, forces [N] and the last one's significance; None if it is not.

        Args:
            trial: Plucks with a further one, the last.
            solved: Their fit.
            found: Plucks without it.
            before: Fit of these.
        """
        fit, slow = self._fit, self._fit.slow
        forces = solved.forces
        first, last = np.searchsorted(slow.time, trial[-1])
        noise = noise_around(solved.load, int(first), int(last))
        doubts = fit.doubts(trial)
        doubts = float(doubts @ doubts) - float(np.sum(fit.doubts(found) ** 2))
        gain = (before.chi2 - solved.chi2) / noise / (1 + max(0.0, doubts))
        least = max(LEAST_FORCE, LEAST_FRACTION * float(forces.max()))
        climbed = np.diff(np.interp(trial[-1], slow.hops, fit.rise))[0]
        near = np.abs(trial[:-1, 1] - trial[-1, 1]).min(initial=np.inf)
        moving = np.interp(trial[-1, 1], slow.time, slow.speed()) > self._moving
        enough = climbed > LEAST_RISE and gain > SIGNIFICANCE and forces[-1] > least and moving
        return (trial, solved, forces, gain) if enough and near > APART * slow.width else None

    def _starts(self, found: Floats, solved: Solved) -> list[Floats]:
        """Return plucks found with a further one; shape (plucks, 2) each.

        The further one is of the pairs that fit the residuals best, anywhere and for each contact
        that the rig says.
        """
        fit, slow, strings = self._fit, self._fit.slow, self._fit.strings
        left, rows = solved.load, len(solved.load)
        base = np.concatenate([fit.base[:rows], solved.base[:rows]], 1)
        size = max(1, -(-len(left) // MOST_ROWS))
        n = len(left) // size

        def sums(column: Floats) -> Floats:
            return column[: n * size].reshape(n, size).sum(1)

        time, rise = sums(slow.time) / size, sums(fit.at) / size
        low, high = np.arange(n)[:, None], np.arange(n)[None, :]
        weight = fit.weight
        climbed = rise[None, :] - rise[:, None]

        def product(column: Floats) -> Floats:
            """Return the products of a column with every saw-tooth, shape (contacts, releases)."""
            alone, risen = _before(column), _before(column * rise)
            return (
                risen[None, :] - risen[:, None] - rise[:, None] * (alone[None, :] - alone[:, None])
            )

        heavy = sums(weight**2)
        alone, squared, count = (_before(heavy * rise**k) for k in (1, 2, 0))
        square = (
            squared[None, :]
            - squared[:, None]
            - 2 * rise[:, None] * (alone[None, :] - alone[:, None])
        )
        square = square + rise[:, None] ** 2 * (count[None, :] - count[:, None])
        least = 1e-2 * square
        for column in base.T:
            square = square - product(sums(weight * column)) ** 2
        of_load = product(sums(weight * left))
        possible = (high > low + 3) & (climbed > LEAST_RISE) & (of_load > 0) & (square > least)
        possible &= time < time[-1] - slow.width
        for release in found[:, 1]:
            possible &= np.abs(time[None, :] - release) > APART * slow.width
        gain = np.where(possible, of_load**2 / np.where(possible, square, 1.0), 0.0)
        weight = np.zeros_like(gain)
        for contact, climb in zip(strings.contacts, strings.climbs, strict=True):
            far = ((rise - contact)[:, None] / CONTACT_STD) ** 2
            far = far + (np.log(np.maximum(climbed, 1e-5) / climb) / CLIMB_STD) ** 2
            weight = np.maximum(weight, np.exp(-far / 2))
        gain *= ANYWHERE + (1 - ANYWHERE) * weight
        pairs: list[tuple[int, int]] = []
        for contact in strings.contacts if len(found) < len(strings.contacts) else ():
            row = int(np.searchsorted(rise, contact))
            if row < n and gain[row].max() > 0:
                pairs.append((row, int(np.argmax(gain[row]))))
        for _ in range(STARTS):
            first, last = np.unravel_index(int(np.argmax(gain)), gain.shape)
            if not gain[first, last] > 0:
                break
            pairs.append((int(first), int(last)))
            gain[:, np.abs(time - time[last]) < BETWEEN * slow.width] = 0.0
        starts = [
            np.vstack([found, [time[first], (time[last - 1] + time[last]) / 2]])
            for first, last in dict.fromkeys(pairs)
        ]
        if 0 < len(found) < len(strings.contacts):
            placed = starts[0].copy()
            where = np.interp(strings.contacts, fit.rise, slow.hops)
            placed[np.argsort(placed[:, 1]), 0] = where[: len(placed)]
            if (placed[:, 1] > placed[:, 0] + 2 * slow.width).all():
                starts.append(placed)
            # Two strings that are released one after the other may look like one.
            strongest = int(np.argmax(solved.forces))
            split = np.vstack([found, found[strongest]])
            split[[strongest, -1], 1] += np.array([-1, 1]) * slow.width
            starts.append(split)
        return starts


def _growth(pair: Floats, force: float, gain: float) -> Growth:
    return Growth(float(pair[0]), float(pair[1]), force, gain)


def _before(column: Floats) -> Floats:
    """Return the sums of all rows before each row."""
    return np.concatenate([[0.0], np.cumsum(column)[:-1]])
