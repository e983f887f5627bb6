"""The load as a sum of saw-teeth, one for each string, and of what a key without a string adds.

A string adds a load that grows from 0 with the rise since contact and ends at release. For given
instants the model is linear; the instants are refined (Levenberg-Marquardt), with what the rig says
of them.
"""

from itertools import combinations

import numpy as np

from sautereau.analysis.phases.expected import Expected
from sautereau.analysis.phases.slow import Slow
from sautereau.trajectory.motion import Floats

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
CONTACT_STD, CLIMB_STD, DOUBT = 0.5e-3, 0.4, 4.0
"""Standard deviations of a contact about the rig's, in m, and of the logarithm of the rise from it
to the release; and bound of their deviations, as a rig may be of another instrument."""
STEPS, LONGEST = 6, 4e-3
"""Steps of a refinement, and its longest step in s."""
EXCHANGED = 1.1
"""Largest increase of chi2 by which contacts are put into the order of releases."""
SMALL = 0.2e-3
"""s, of a difference quotient."""

Solved = tuple[Floats, Floats, Floats]
"""Residuals with those of the priors, factors of the columns, and an orthonormal base of these."""


class SawTeeth:
    """Fits of saw-teeth to the load for one compliance.

    Args:
        slow: Of the way down.
        compliance: s^2, k of `sautereau.analysis.phases.slow`.
        noise: N, of a row; it weights the priors.
        strings: Of the rig.
    """

    def __init__(self, slow: Slow, compliance: float, noise: float, strings: Expected):
        self.slow, self.compliance, self.strings = slow, compliance, strings
        self._noise = noise
        self.rise = slow.rise(compliance)
        """m, of the jack at the blocks."""
        self.weight = noise / np.hypot(noise, slow.error(slow.time))
        """Of the rows, less where there are impacts and ringing."""
        self.load = self.weight * slow.load(compliance)
        """N, weighted."""
        rise, speed = slow.smooth(self.rise), slow.speed()
        drift = [rise / FULL_RISE, speed / max(1e-6, float(speed.max()))]
        drift.append(np.maximum(DAMPER - rise, 0.0) / DAMPER)
        level = np.full(len(rise), LEVEL_STD)
        free = np.column_stack([slow.terms, level, DRIFT_STD * np.stack(drift, 1)])
        self.free = self.weight[:, None] * free
        """N, weighted columns of a key without a string, times their prior standard deviations."""
        self.at = rise
        """m, rise of the jack at the rows."""

    def _strings_at(self, plucks: Floats) -> Floats:
        """Return the columns of strings held from a contact to a release.

        Args:
            plucks: s, contacts and releases, shape (n, 2).

        Returns:
            Their force, its curvature and its second derivative, shape (rows, n COLUMNS).
        """
        slow, time = self.slow, self.slow.hops
        at, top = np.interp(plucks.T, time, self.rise)[..., None]
        contact, release = plucks.T[..., None]
        part = np.clip((release - time) / slow.hop + 0.5, 0.0, 1.0) * (time > contact)
        u = np.maximum(self.rise - at, 0.0) * part / np.maximum(top - at, 1e-6)
        quadratic, cubic = self.strings.bends
        curved = u * (u - 1)
        line = u + curved * (quadratic + cubic * (u - 0.5))
        columns = np.concatenate(
            [slow.smooth(line, 0, 2), slow.smooth(curved)[..., None]], -1
        ) * np.array([FORCE_STD, FORCE_STD * SHARP, CURVED_STD])
        columns = columns.transpose(1, 0, 2).reshape(len(self.load), -1)
        return self.weight[:, None] * columns

    def solved(self, plucks: Floats) -> Solved:
        """Return residuals with those of the priors, factors, and an orthonormal base."""
        columns = np.concatenate([self.free, self._strings_at(plucks)], 1)
        n, k = columns.shape
        matrix, target = np.zeros((n + k, k)), np.zeros(n + k)
        matrix[:n], target[:n] = columns, self.load
        matrix[range(n, n + k), range(k)] = self._noise
        q, r = np.linalg.qr(matrix)
        of = q.T @ target
        return target - q @ of, np.asarray(np.linalg.solve(r, of), dtype=float), q

    def doubts(self, plucks: Floats) -> Floats:
        """Return how far plucks are from what the rig says, in standard deviations.

        Contacts and rises from contact to release; each is bounded by `DOUBT`, which is that of
        a pluck for which the rig has no string; shape (2 plucks,).
        """
        strings, count = self.strings, len(plucks)
        rise = np.interp(plucks, self.slow.hops, self.rise)
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

    def _total(self, solved: Solved, plucks: Floats, noise: float) -> float:
        """Return chi2 with that of the doubts."""
        doubts = self.doubts(plucks)
        return float(solved[0] @ solved[0]) + noise * float(doubts @ doubts)

    def _slopes(self, plucks: Floats, solved: Solved) -> tuple[Floats, Floats]:
        """Return the derivatives of residuals, and of doubts, by contacts and releases."""
        left, factors, q = solved
        ends = 2 * len(plucks)
        off = SMALL * np.eye(ends).reshape(ends, -1, 2)
        own = factors[self.free.shape[1] :].reshape(-1, COLUMNS).repeat(2, 0)
        place = range(ends), np.arange(ends) // 2
        up, down = (
            self._strings_at((plucks + s * off)[place]).reshape(-1, ends, COLUMNS) for s in (1, -1)
        )
        change = np.zeros((len(left), ends))
        change[: len(up)] = ((up - down) * own).sum(2) / (2 * SMALL)
        rig = [(self.doubts(plucks + o) - self.doubts(plucks - o)) / (2 * SMALL) for o in off]
        return q @ (q.T @ change) - change, np.stack(rig, 1)

    def stds(self, plucks: Floats, solved: Solved) -> tuple[list[list[float]], list[float]]:
        """Return the standard uncertainties of plucks [s], and the noise around them."""
        if not len(plucks):
            return [], []
        slopes, rig = self._slopes(plucks, solved)
        rows = np.searchsorted(self.slow.time, plucks)
        noises = [noise_around(solved[0][: len(self.load)], *pair) for pair in rows.tolist()]
        inverse = np.linalg.pinv(slopes.T @ slopes / max(noises) + rig.T @ rig)
        return np.sqrt(np.diag(inverse)).reshape(-1, 2).tolist(), [
            n / self._noise**2 for n in noises
        ]

    def refined(self, plucks: Floats) -> tuple[Floats, Solved, float]:
        """Return better instants near those of plucks, shape (plucks, 2), their fit, its chi2."""
        solved, stiff = self.solved(plucks), 1e-2
        first, last = np.searchsorted(self.slow.time, plucks[-1])
        noise = noise_around(solved[0][: len(self.load)], int(first), int(last))
        total = self._total(solved, plucks, noise)
        for _ in range(STEPS):
            left = solved[0]
            jacobian, rig = self._slopes(plucks, solved)
            normal = jacobian.T @ jacobian + noise * rig.T @ rig
            right = jacobian.T @ left + noise * rig.T @ self.doubts(plucks)
            better = None
            for _ in range(4):
                damped = normal + stiff * np.diag(np.diag(normal) + 1e-9)
                step = np.clip(-np.linalg.solve(damped, right), -LONGEST, LONGEST)
                trial = plucks + step.reshape(-1, 2)
                trial = np.clip(trial, self.slow.hops[0], self.slow.hops[-1])
                if (trial[:, 1] > trial[:, 0] + self.slow.width).all():
                    tried = self.solved(trial)
                    pulls = (tried[1][self.free.shape[1] :: COLUMNS] > 0).all()
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

    def in_order(self, plucks: Floats, solved: Solved) -> tuple[Floats, Solved]:
        """Return the plucks with contacts in the order of their releases, where that fits as well.

        Two saw-teeth whose contacts are exchanged have nearly the same sum.
        """
        order = np.argsort(plucks[:, 1])
        swapped = plucks.copy()
        swapped[order, 0] = np.sort(plucks[:, 0])
        if (swapped == plucks).all():
            return plucks, solved
        other, fitted, _ = self.refined(swapped)
        better = fitted[0] @ fitted[0] < EXCHANGED * float(solved[0] @ solved[0])
        return (other, fitted) if better else (plucks, solved)


def noise_around(left: Floats, first: int, last: int) -> float:
    """Return the variance of residuals around a saw-tooth at its scale: of sums over thirds."""
    width = max(1, (last - first) // 3)
    around = left[max(0, first - 2 * width) : last + 2 * width]
    count = len(around) // width
    sums = around[: count * width].reshape(count, width).sum(1)
    return float(sums @ sums) / (count * width) + 1e-12
