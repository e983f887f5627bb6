"""Search for plucks: from contact to release the load grows with the jack's rise, then collapses.

A string adds a load that grows from 0 in proportion to the rise since contact and ends at release:
a saw-tooth. Every pair of a contact and a release is tried against the load that a key without a
string leaves, by cumulative sums of products. Ringing of key, jack and transducer hardly changes
these sums, as it changes sign while the string is held. The best pair is added, all instants are
refined (Gauss-Newton), and the search is repeated for as many strings as the rig has.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from sautereau.analysis.phases.expected import Expected
from sautereau.analysis.phases.slow import MOST_COMPLIANT, TERMS, Slow
from sautereau.trajectory.motion import Floats

NOISE, LEAST_NOISE, CORRELATED = 0.015, 4e-3, 2.0
"""N, of a smoothed row, of unmodelled vibration, at first and at least; it weights the priors.
Later it is the rms of the residuals, times this factor as neighbouring rows are correlated."""
LEVEL_STD, DRIFT_STD = 10.0, 0.03
"""N, prior standard deviations: of the constant load; of its change over the rise, with the speed,
and by a damper."""
DAMPER, FULL_RISE = 1e-3, 10e-3
"""m, lift of a damper, and rise over which the load changes."""
FORCE_STD, CURVED_STD = 3.0, 0.15
"""N, prior standard deviations of a string's force, and of its curvature."""
COLUMNS, SHARP = 3, 3e-7
"""Of a string, and s^2, prior standard deviation of the factor of its second derivative, by what
lies between the laser and the jack."""
LEAST_RISE = 0.25e-3
"""m, least rise of the jack from contact to release."""
MOST_ROWS = 300
"""Rows in which pairs are tried."""
APART = 0.5
"""Least widths between two releases."""
CONTACT_STD, CLIMB_STD, DOUBT = 0.5e-3, 0.4, 4.0
"""Standard deviations of a contact about the rig's, in m, and of the logarithm of the rise from it
to the release; and bound of their deviations, as a rig may be of another instrument."""
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
ROUNDS, STEPS, LONGEST = 3, 6, 4e-3
"""Rounds for the compliance, steps of a refinement, and its longest step in s."""
EXCHANGED = 1.1
"""Largest increase of chi2 by which contacts are put into the order of releases."""
SMALL = 0.2e-3
"""s, of a difference quotient."""


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
    for _ in range(ROUNDS):
        found = _Fit(slow, compliance, noise, strings).all()
        change = abs(found.compliance - compliance)
        compliance, before = found.compliance, noise
        noise = max(LEAST_NOISE, CORRELATED * found.residual)
        if change < max(2e-7, 0.05 * compliance) and 0.5 < noise / before < 2:
            break
    return found


class _Fit:
    """Fits of saw-teeth to the load for one compliance."""

    def __init__(self, slow: Slow, compliance: float, noise: float, strings: Expected):
        self._slow, self._compliance, self._strings = slow, compliance, strings
        self._noise = noise
        self._rise = slow.rise(compliance)
        self._weight = noise / np.hypot(noise, slow.error(slow.time))
        self._load = self._weight * slow.load(compliance)
        rise, speed = slow.smooth(self._rise), slow.speed()
        drift = [rise / FULL_RISE, speed / max(1e-6, float(speed.max()))]
        drift.append(np.maximum(DAMPER - rise, 0.0) / DAMPER)
        level = np.full(len(rise), LEVEL_STD)
        self._moving = SLOWEST * float(speed.max())
        free = np.column_stack([slow.terms, level, DRIFT_STD * np.stack(drift, 1)])
        self._free = self._weight[:, None] * free
        self._at = rise

    def all(self) -> Searched:
        """Return the plucks, added one by one."""
        strings = len(self._strings.contacts)
        found, values, left = np.zeros((0, 2)), np.zeros(0), self._solved(np.zeros((0, 2)))
        gains: list[float] = []
        further = None
        while len(found) <= strings:
            starts = self._starts(found, left)
            if not starts:
                break
            trials = sorted((self._refined(start) for start in starts), key=lambda t: t[2])
            made = (self._judged(*self._in_order(*trial[:2]), found, left) for trial in trials)
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
        k = self._compliance - float(left[1][1]) * TERMS["F2"]
        stds, noises = self._stds(found, left)
        each = zip(found.tolist(), values.tolist(), gains, stds, noises, strict=True)
        growths = [
            Growth(contact, release, force, gain, std[0], std[1], noise)
            for (contact, release), force, gain, std, noise in each
        ]
        if further and len(growths) > strings:
            growths.remove(min(growths, key=lambda g: g.significance))
        return Searched(
            tuple(sorted(growths, key=lambda g: g.release)),
            further,
            min(max(k, 0.0), MOST_COMPLIANT),
            float(np.sqrt(np.mean(left[0][: len(self._load)] ** 2))),
        )

    def _judged(
        self,
        trial: Floats,
        solved: tuple[Floats, Floats, Floats],
        found: Floats,
        before: tuple[Floats, Floats, Floats],
    ) -> tuple[Floats, tuple[Floats, Floats, Floats], Floats, float] | None:
        """Return plucks, their fit, forces [N] and the last one's significance; None if it is not.

        Args:
            trial: Plucks with a further one, the last.
            solved: Their fit.
            found: Plucks without it.
            before: Fit of these.
        """
        forces = FORCE_STD * solved[1][self._free.shape[1] :: COLUMNS]
        first, last = np.searchsorted(self._slow.time, trial[-1])
        noise = _noise(solved[0][: len(self._load)], int(first), int(last))
        doubts = self._doubts(trial)
        doubts = float(doubts @ doubts) - float(np.sum(self._doubts(found) ** 2))
        gain = float(before[0] @ before[0] - solved[0] @ solved[0]) / noise / (1 + max(0.0, doubts))
        least = max(LEAST_FORCE, LEAST_FRACTION * float(forces.max()))
        climbed = np.diff(np.interp(trial[-1], self._slow.hops, self._rise))[0]
        near = np.abs(trial[:-1, 1] - trial[-1, 1]).min(initial=np.inf)
        moving = np.interp(trial[-1, 1], self._slow.time, self._slow.speed()) > self._moving
        enough = climbed > LEAST_RISE and gain > SIGNIFICANCE and forces[-1] > least and moving
        return (trial, solved, forces, gain) if enough and near > APART * self._slow.width else None

    def _strings_at(self, plucks: Floats) -> Floats:
        """Return the columns of strings held from a contact to a release.

        Args:
            plucks: s, contacts and releases, shape (n, 2).

        Returns:
            Their force, its curvature and its second derivative, shape (rows, n COLUMNS).
        """
        slow, time = self._slow, self._slow.hops
        at, top = np.interp(plucks.T, time, self._rise)[..., None]
        contact, release = plucks.T[..., None]
        part = np.clip((release - time) / slow.hop + 0.5, 0.0, 1.0) * (time > contact)
        u = np.maximum(self._rise - at, 0.0) * part / np.maximum(top - at, 1e-6)
        quadratic, cubic = self._strings.bends
        curved = u * (u - 1)
        line = u + curved * (quadratic + cubic * (u - 0.5))
        columns = np.concatenate(
            [slow.smooth(line, 0, 2), slow.smooth(curved)[..., None]], -1
        ) * np.array([FORCE_STD, FORCE_STD * SHARP, CURVED_STD])
        columns = columns.transpose(1, 0, 2).reshape(len(self._load), -1)
        return self._weight[:, None] * columns

    def _solved(self, plucks: Floats) -> tuple[Floats, Floats, Floats]:
        """Return residuals with those of the priors, factors, and an orthonormal base."""
        columns = np.concatenate([self._free, self._strings_at(plucks)], 1)
        n, k = columns.shape
        matrix, target = np.zeros((n + k, k)), np.zeros(n + k)
        matrix[:n], target[:n] = columns, self._load
        matrix[range(n, n + k), range(k)] = self._noise
        q, r = np.linalg.qr(matrix)
        of = q.T @ target
        return target - q @ of, np.asarray(np.linalg.solve(r, of), dtype=float), q

    def _doubts(self, plucks: Floats) -> Floats:
        """Return how far plucks are from what the rig says, in standard deviations.

        Contacts and rises from contact to release; each is bounded by `DOUBT`, which is that of
        a pluck for which the rig has no string; shape (2 plucks,).
        """
        strings, count = self._strings, len(plucks)
        rise = np.interp(plucks, self._slow.hops, self._rise)
        order = np.argsort(rise[:, 0])
        of_contact = (rise[order, :1] - strings.contacts) / CONTACT_STD
        climbed = np.maximum(rise[order, 1] - rise[order, 0], 1e-5)
        of_climb = np.log(climbed[:, None] / strings.climbs) / CLIMB_STD
        far = np.stack([of_contact, of_climb], 2)
        far = far / np.sqrt(1 + far**2 / DOUBT**2)
        known = min(far.shape[:2])
        best, least = np.full((count, 2), DOUBT), np.inf
        for each in combinations(range(count), known):
            for string in combinations(range(len(strings.contacts)), known):
                chosen = np.full((count, 2), DOUBT)
                chosen[each, :] = far[each, string]
                if (square := float((chosen**2).sum())) < least:
                    best, least = chosen, square
        return best.ravel()

    def _total(self, solved: tuple[Floats, Floats, Floats], plucks: Floats, noise: float) -> float:
        """Return chi2 with that of the doubts."""
        doubts = self._doubts(plucks)
        return float(solved[0] @ solved[0]) + noise * float(doubts @ doubts)

    def _slopes(
        self, plucks: Floats, solved: tuple[Floats, Floats, Floats]
    ) -> tuple[Floats, Floats]:
        """Return the derivatives of residuals, and of doubts, by contacts and releases."""
        left, factors, q = solved
        ends = 2 * len(plucks)
        off = SMALL * np.eye(ends).reshape(ends, -1, 2)
        own = factors[self._free.shape[1] :].reshape(-1, COLUMNS).repeat(2, 0)
        place = range(ends), np.arange(ends) // 2
        up, down = (
            self._strings_at((plucks + s * off)[place]).reshape(-1, ends, COLUMNS) for s in (1, -1)
        )
        change = np.zeros((len(left), ends))
        change[: len(up)] = ((up - down) * own).sum(2) / (2 * SMALL)
        rig = [(self._doubts(plucks + o) - self._doubts(plucks - o)) / (2 * SMALL) for o in off]
        return q @ (q.T @ change) - change, np.stack(rig, 1)

    def _stds(
        self, plucks: Floats, solved: tuple[Floats, Floats, Floats]
    ) -> tuple[list[list[float]], list[float]]:
        """Return the standard uncertainties of plucks [s], and the noise around them."""
        if not len(plucks):
            return [], []
        slopes, rig = self._slopes(plucks, solved)
        rows = np.searchsorted(self._slow.time, plucks)
        noises = [_noise(solved[0][: len(self._load)], *pair) for pair in rows.tolist()]
        inverse = np.linalg.pinv(slopes.T @ slopes / max(noises) + rig.T @ rig)
        return np.sqrt(np.diag(inverse)).reshape(-1, 2).tolist(), [
            n / self._noise**2 for n in noises
        ]

    def _refined(self, plucks: Floats) -> tuple[Floats, tuple[Floats, Floats, Floats], float]:
        """Return better instants near those of plucks, shape (plucks, 2), their fit, its chi2."""
        solved, stiff = self._solved(plucks), 1e-2
        first, last = np.searchsorted(self._slow.time, plucks[-1])
        noise = _noise(solved[0][: len(self._load)], int(first), int(last))
        total = self._total(solved, plucks, noise)
        for _ in range(STEPS):
            left = solved[0]
            jacobian, rig = self._slopes(plucks, solved)
            normal = jacobian.T @ jacobian + noise * rig.T @ rig
            right = jacobian.T @ left + noise * rig.T @ self._doubts(plucks)
            better = None
            for _ in range(4):
                damped = normal + stiff * np.diag(np.diag(normal) + 1e-9)
                step = np.clip(-np.linalg.solve(damped, right), -LONGEST, LONGEST)
                trial = plucks + step.reshape(-1, 2)
                trial = np.clip(trial, self._slow.hops[0], self._slow.hops[-1])
                if (trial[:, 1] > trial[:, 0] + self._slow.width).all():
                    tried = self._solved(trial)
                    pulls = (tried[1][self._free.shape[1] :: COLUMNS] > 0).all()
                    if pulls and self._total(tried, trial, noise) < total:
                        better = trial, tried
                        break
                stiff *= 5
            if better is None:
                break
            plucks, solved = better
            stiff = max(stiff / 5, 1e-6)
            gained, total = total, self._total(solved, plucks, noise)
            if gained - total < 1e-3 * total:
                break
        return plucks, solved, total

    def _in_order(
        self, plucks: Floats, solved: tuple[Floats, Floats, Floats]
    ) -> tuple[Floats, tuple[Floats, Floats, Floats]]:
        """Return the plucks with contacts in the order of their releases, where that fits as well.

        Two saw-teeth whose contacts are exchanged have nearly the same sum.
        """
        order = np.argsort(plucks[:, 1])
        swapped = plucks.copy()
        swapped[order, 0] = np.sort(plucks[:, 0])
        if (swapped == plucks).all():
            return plucks, solved
        other, fitted, _ = self._refined(swapped)
        better = fitted[0] @ fitted[0] < EXCHANGED * float(solved[0] @ solved[0])
        return (other, fitted) if better else (plucks, solved)

    def _starts(self, found: Floats, solved: tuple[Floats, Floats, Floats]) -> list[Floats]:
        """Return plucks found with a further one; shape (plucks, 2) each.

        The further one is of the pairs that fit the residuals best, anywhere and for each contact
        that the rig says.
        """
        left, q = solved[0][: len(self._load)], solved[2]
        size = max(1, -(-len(left) // MOST_ROWS))
        n = len(left) // size

        def sums(column: Floats) -> Floats:
            return column[: n * size].reshape(n, size).sum(1)

        time, rise = sums(self._slow.time) / size, sums(self._at) / size
        low, high = np.arange(n)[:, None], np.arange(n)[None, :]
        weight = self._weight
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
        for column in q[: len(left)].T:
            square = square - product(sums(weight * column)) ** 2
        of_load = product(sums(weight * left))
        possible = (high > low + 3) & (climbed > LEAST_RISE) & (of_load > 0) & (square > least)
        possible &= time < time[-1] - self._slow.width
        for release in found[:, 1]:
            possible &= np.abs(time[None, :] - release) > APART * self._slow.width
        gain = np.where(possible, of_load**2 / np.where(possible, square, 1.0), 0.0)
        weight = np.zeros_like(gain)
        for contact, climb in zip(self._strings.contacts, self._strings.climbs, strict=True):
            far = ((rise - contact)[:, None] / CONTACT_STD) ** 2
            far = far + (np.log(np.maximum(climbed, 1e-5) / climb) / CLIMB_STD) ** 2
            weight = np.maximum(weight, np.exp(-far / 2))
        gain *= ANYWHERE + (1 - ANYWHERE) * weight
        pairs: list[tuple[int, int]] = []
        for contact in self._strings.contacts if len(found) < len(self._strings.contacts) else ():
            row = int(np.searchsorted(rise, contact))
            if row < n and gain[row].max() > 0:
                pairs.append((row, int(np.argmax(gain[row]))))
        for _ in range(STARTS):
            first, last = np.unravel_index(int(np.argmax(gain)), gain.shape)
            if not gain[first, last] > 0:
                break
            pairs.append((int(first), int(last)))
            gain[:, np.abs(time - time[last]) < BETWEEN * self._slow.width] = 0.0
        starts = [
            np.vstack([found, [time[first], (time[last - 1] + time[last]) / 2]])
            for first, last in dict.fromkeys(pairs)
        ]
        if 0 < len(found) < len(self._strings.contacts):
            placed = starts[0].copy()
            where = np.interp(self._strings.contacts, self._rise, self._slow.hops)
            placed[np.argsort(placed[:, 1]), 0] = where[: len(placed)]
            if (placed[:, 1] > placed[:, 0] + 2 * self._slow.width).all():
                starts.append(placed)
        return starts


def _growth(pair: Floats, force: float, gain: float) -> Growth:
    return Growth(float(pair[0]), float(pair[1]), force, gain)


def _before(column: Floats) -> Floats:
    """Return the sums of all rows before each row."""
    return np.concatenate([[0.0], np.cumsum(column)[:-1]])


def _noise(left: Floats, first: int, last: int) -> float:
    """Return the variance of residuals around a saw-tooth at its scale: of sums over thirds."""
    width = max(1, (last - first) // 3)
    around = left[max(0, first - 2 * width) : last + 2 * width]
    count = len(around) // width
    sums = around[: count * width].reshape(count, width).sum(1)
    return float(sums @ sums) / (count * width) + 1e-12
