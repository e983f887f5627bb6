"""Search for plucks: from contact to release the load grows with the jack's rise, then collapses.

Every pair of a contact and a release is tried against the load that a key without a string leaves,
by cumulative sums of products with saw-teeth (`pair_gains`). Ringing of key, jack and transducer
hardly changes these sums, as it changes sign while the string is held. The best pair is added, all
instants are refined, and the search is repeated for as many strings as the rig has.
"""

from dataclasses import dataclass

import numpy as np

from sautereau.analysis.phases.expected import LEAST_CLIMB, Expected
from sautereau.analysis.phases.found import Growth
from sautereau.analysis.phases.saw_teeth import SawTeeth, Solved, in_order, log_odds, noise_around
from sautereau.analysis.phases.settings import PhaseSettings
from sautereau.analysis.phases.slow import Slow
from sautereau.trajectory.motion import Floats

SLIGHT = 0.15  # Of the largest force in a press, that of a growth that may be of its string's shape
APART = 0.5  # Least distance of two releases, in widths of the smoothing


def pair_gains(fit: SawTeeth, found: Floats, solved: Solved) -> tuple[Floats, Floats, Floats]:
    """Return the reduction of chi2 by a further pluck.

    Args:
        found: s, contacts and releases of the plucks found, shape (plucks, 2).

    Returns:
        Times [s] and rises of the jack [m] of rows, shape (n,), and the reduction by each pair of
        a contact and a release, weighted by its probability according to the rig; 0 where a pluck
        is impossible; shape (n, n).
    """
    slow, left = fit.slow, solved.row_residuals
    size = max(1, -(-len(left) // 300))
    n = len(left) // size

    def sums(column: Floats) -> Floats:
        return column[: n * size].reshape(n, size, *column.shape[1:]).sum(1)

    time, rise = sums(slow.time) / size, sums(fit.row_rise) / size
    of_load = _products(sums(fit.weight * left), rise)
    # Weighted sums of squares of every saw-tooth.
    alone, squared, count = (_before(sums(fit.weight**2) * rise**k) for k in (1, 2, 0))
    square = squared[None, :] - squared[:, None]
    square -= 2 * rise[:, None] * (alone[None, :] - alone[:, None])
    square = square + rise[:, None] ** 2 * (count[None, :] - count[:, None])
    least = 1e-2 * square  # that other columns must leave of a saw-tooth
    base = np.concatenate([fit.base[: len(left)], solved.base[: len(left)]], 1)
    _subtract_explained(square, sums(fit.weight[:, None] * base), rise[:, None])
    climbed = rise[None, :] - rise[:, None]
    # Of a release before its contact the squares are meaningless.
    later = np.arange(n)[None, :] > np.arange(n)[:, None] + 3
    possible = later & (climbed > 0.25e-3) & (of_load > 0) & (square > least)
    possible &= time < time[-1] - slow.width
    for release in found[:, 1]:
        possible &= np.abs(time[None, :] - release) > APART * slow.width
    gain = np.where(possible, of_load**2 / np.where(possible, square, 1.0), 0.0)
    likely = _likely(fit.strings, rise, climbed)
    anywhere = slow.settings.anywhere
    return time, rise, gain * (anywhere + (1 - anywhere) * likely)


def _products(column: Floats, rise: Floats) -> Floats:
    """Return the products of a column, shape (n,), with every saw-tooth, shape (n, n)."""
    alone, risen = _before(column), _before(column * rise)
    return risen[None, :] - risen[:, None] - rise[:, None] * (alone[None, :] - alone[:, None])


def _subtract_explained(square: Floats, columns: Floats, rise: Floats) -> None:
    """Subtract what orthonormal columns explain of the squares, in place.

    That is the sum of the squares of `_products` over the columns, which is most of the work.

    Args:
        square: Shape (n, n).
        columns: Shape (n, columns).
        rise: m, shape (n, 1).
    """
    alone, risen = _before(columns), _before(columns * rise)
    own = risen - rise * alone
    square -= (own**2).sum(1)[:, None] - 2 * (own @ risen.T - rise * (own @ alone.T))
    square -= (risen**2).sum(1) - 2 * rise * (risen * alone).sum(1) + rise**2 * (alone**2).sum(1)


def _likely(strings: Expected, rise: Floats, climbed: Floats) -> Floats:
    """Return the relative probability (0 to 1) of each pair for the nearest string of the rig."""
    likely = np.zeros_like(climbed)
    for contact, climb in zip(strings.contacts, strings.climbs, strict=True):
        far = ((rise - contact)[:, None] / strings.settings.contact_std) ** 2
        climbs = np.log(np.maximum(climbed, LEAST_CLIMB) / climb)
        far = far + (climbs / strings.settings.climb_std) ** 2
        likely = np.maximum(likely, np.exp(-far / 2))
    return likely


def _before(column: Floats) -> Floats:
    """Return the sums of all rows before each row."""
    return np.cumsum(column, axis=0) - column


@dataclass(frozen=True)
class Searched:
    """The result of a search."""

    growths: tuple[Growth, ...]
    """In order of release."""
    further: Growth | None
    """The next one, for which the rig has no string, or one that only a repetition showed."""
    compliance: float
    """s^2, k of `sautereau.analysis.phases.slow`."""
    residual: float
    """N, rms of the load that is not explained."""
    inertia: float = 1.0
    """Inertia of key and jacks over that of the rig."""
    lag: float = 0.0
    """s, by which the force is late, compared with the velocity."""

    def significant(self, least: float) -> tuple[Growth, ...]:
        """Return the growths above a significance, with the further one."""
        every = (*self.growths, *([self.further] if self.further else []))
        return tuple(g for g in every if g.significance > least)


def search(slow: Slow, strings: Expected) -> Searched:
    """Return the growths of a press that collapse.

    Args:
        strings: Of the rig; there are at most as many growths.
    """
    compliance, noise = 0.0, slow.settings.noise
    found = Searched((), None, 0.0, 0.0)
    if len(slow.time) < 12:
        return found
    plucks = np.zeros((0, 2))
    for number in range(3):  # each with the compliance of the round before
        fit = SawTeeth(slow, compliance, noise, strings)
        found, plucks = _Search(fit, 1 if number == 0 else None, plucks, number > 1).all()
        change = abs(found.compliance - compliance)
        compliance, before = found.compliance, noise
        noise = row_noise(found.residual, slow.settings)
        if number > 0 and change < max(2e-7, 0.05 * compliance) and 0.5 < noise / before < 2:
            break
    return found


def row_noise(residual: float, settings: PhaseSettings) -> float:
    """Return the noise [N] of a row, by the rms of the load that is not explained [N]."""
    return max(2e-3, settings.correlated * residual)


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
        self._moving = 0.1 * float(fit.slow.speed().max())

    def all(self) -> tuple[Searched, Floats]:
        """Return the plucks, added one by one; and their instants, in the order of addition.

        A pluck that is not significant alone is kept if both are significant with the next one.
        """
        fit, strings = self._fit, len(self._fit.strings.contacts)
        sets, good = [fit.refined(np.zeros((0, 2)))[:2]], 0
        if self._trusted and len(self._earlier):
            sets.append(fit.refined(self._earlier)[:2])
            good = 1
        while len(sets[-1][0]) <= strings:
            found, fitted = sets[-1]
            first = best = None
            trials = [fit.refined(start) for start in self._starts(found, fitted)]
            for plucks, solved, _ in sorted(trials, key=lambda trial: trial[2]):
                trial = in_order(fit, plucks, solved)
                first = first or trial
                if self._significance(*trial, -1, found, fitted) > 0:
                    best = trial
                    break
            if best:
                sets.append(best)
                good = len(sets) - 1
            elif first and len(found) + 1 < strings:
                sets.append(first)  # what another string adds may hide this one
            else:
                break
        found, fitted = sets[good]
        gains = self._significances(found, fitted)
        further = None
        while min(gains, default=1.0) == 0.0 or len(found) > strings:
            weakest = len(gains) - 1 - int(np.argmin(gains[::-1]))
            others, refitted, _ = fit.refined(np.delete(found, weakest, 0))
            if gains[weakest] > 0:
                # Another one may have taken its place: then it is that one's which is left over.
                moved = [np.abs(np.delete(found, i, 0) - others).sum() for i in range(len(found))]
                left = int(np.argmin(moved))
                contact, release = found[left].tolist()
                odds = log_odds(fitted.chi2, refitted.chi2)
                force = float(fitted.forces[left])
                further = Growth(contact, release, force, gains[weakest], odds=odds)
            found, fitted = others, refitted
            gains = self._significances(found, fitted)
        k = fit.compliance - fit.term(fitted, "F2")  # with which there is no term of F''
        stds, noises = fit.stds(found, fitted).tolist(), fit.noises(found, fitted)
        each = zip(found.tolist(), fitted.forces.tolist(), gains, stds, noises, strict=True)
        growths = [
            Growth(contact, release, force, gain, std[0], std[1], std[2], noise / fit.noise**2)
            for (contact, release), force, gain, std, noise in each
        ]
        searched = Searched(
            tuple(sorted(growths, key=lambda g: g.release)),
            further,
            max(k, 0.0),
            float(np.sqrt(np.mean(fitted.row_residuals**2))),
            1 + fit.term(fitted, "v1"),
            fit.lag(fitted),
        )
        return searched, found

    def _significances(self, plucks: Floats, solved: Solved) -> list[float]:
        """Return the significance of each pluck besides the others."""
        found = []
        for i in range(len(plucks)):
            others, without, _ = self._fit.refined(np.delete(plucks, i, 0))
            found.append(self._significance(plucks, solved, i, others, without))
        return found

    def _significance(
        self, plucks: Floats, solved: Solved, i: int, others: Floats, without: Solved
    ) -> float:
        """Return the significance of a pluck; 0 if it is none.

        Args:
            plucks: All of them, shape (plucks, 2).
            i: Index of the pluck.
            others: The others, as refined without it.
        """
        fit, slow, pluck = self._fit, self._fit.slow, plucks[i]
        forces = solved.forces
        first, last = np.searchsorted(slow.time, pluck)
        noise = noise_around(solved.row_residuals, int(first), int(last))
        deviations = float(
            np.sum(fit.rig_deviations(plucks) ** 2) - np.sum(fit.rig_deviations(others) ** 2)
        )
        of_force = fit.strings.force_deviations(float(forces[i]))
        of_force = fit.strings.limited(np.abs(of_force)).min()
        deviations = max(0.0, deviations) + float(of_force) ** 2
        gain = (without.chi2 - solved.chi2) / noise / (1 + deviations)
        near = np.abs(np.delete(plucks[:, 1], i) - pluck[1]).min(initial=np.inf)
        moving = np.interp(pluck[1], slow.time, slow.speed()) > self._moving
        # The error of the inertia leaves slight growths where the jack stops. Where the rig has
        # several strings, what the model of one does not explain may look like another.
        several = len(fit.strings.contacts) > 1
        least = 0.05 * float(fit.strings.forces.min())
        strong = forces[i] > max(least, several * SLIGHT * float(forces.max()))
        enough = gain > slow.settings.significance and strong and moving
        # Of a string that is held until the last row no collapse was seen.
        collapses = pluck[1] < slow.time[-1] - slow.width
        return float(gain) if enough and collapses and near > APART * slow.width else 0.0

    def _starts(self, found: Floats, solved: Solved) -> list[Floats]:
        """Return plucks found with a further one; shape (plucks, 2) each.

        The further pluck is one of the pairs that fit the residuals best: of all, and of those with
        each contact of the rig.
        """
        fit, slow, strings = self._fit, self._fit.slow, self._fit.strings
        time, rise, gain = pair_gains(fit, found, solved)
        pairs: list[tuple[int, int]] = []
        missing = len(found) < len(strings.contacts)
        for contact in strings.contacts if missing else ():
            row = int(np.searchsorted(rise, contact))
            if row < len(rise) and gain[row].max() > 0:
                pairs.append((row, int(np.argmax(gain[row]))))
        for _ in range(2 if missing else 1):
            first, last = np.unravel_index(int(np.argmax(gain)), gain.shape)
            if not gain[first, last] > 0:
                break
            pairs.append((int(first), int(last)))
            gain[:, np.abs(time - time[last]) < 4 * slow.width] = 0.0
        starts = [
            np.vstack([found, [time[first], (time[last - 1] + time[last]) / 2]])
            for first, last in dict.fromkeys(pairs)
        ]
        if starts and len(found) and missing:
            placed = starts[0].copy()
            where = np.interp(strings.contacts, fit.rise, slow.hops)
            placed[np.argsort(placed[:, 1]), 0] = where[: len(placed)]
            if (placed[:, 1] > placed[:, 0] + 2 * slow.width).all():
                starts.append(placed)
        if starts and len(found):
            # Two strings that are released one after the other may look like one.
            strongest = int(np.argmax(solved.forces))
            split = np.vstack([found, found[strongest]])
            split[[strongest, -1], 1] += np.array([-1, 1]) * slow.width
            starts.append(split)
        starts = starts[: self._most]
        if len(found) < len(self._earlier):
            starts.append(self._earlier[: len(found) + 1])
        return starts
