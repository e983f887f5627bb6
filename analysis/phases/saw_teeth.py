"""The load as a sum of saw-teeth, one for each string, and of what a key without a string adds.

A string adds a load that grows from 0 with the rise since contact and ends at release. For given
instants the model is linear; the instants are refined (Levenberg-Marquardt), with what the rig says
of them.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.phases.expected import Expected
from sautereau.analysis.phases.levenberg import minimise
from sautereau.analysis.phases.slow import Slow
from sautereau.trajectory.motion import Floats

LEVEL_STD, DRIFT_STD = 10.0, 0.03
"""N, prior standard deviations: of the constant load; of its change over the rise, with the speed,
and by a damper."""
DAMPER, FULL_RISE = 1e-3, 10e-3
"""m, lift of a damper, and rise over which the load changes."""
COLUMNS, FORCE_STD, SHARP_STD = 4, 3.0, 9e-7
"""Of a string, and prior standard deviations: N, of its force; N s^2, of the second derivative of
that, by what lies between the laser and the jack. The others are deviations from its shape."""
CONTACT_STD, CLIMB_STD, DOUBT = 0.5e-3, 0.4, 4.0
"""Standard deviations of a contact about the rig's, in m, and of the logarithm of the rise from it
to the release; and bound of their deviations, as a rig may be of another instrument."""
LONGEST, CONVERGED = 4e-3, 1e-3
"""s, longest step of a refinement, and relative decrease of chi2 at which it ends."""
EXCHANGED = 1.1
"""Largest increase of chi2 by which contacts are put into the order of releases."""
SMALL = 0.2e-3
"""s, of a difference quotient."""


@dataclass(frozen=True)
class Solved:
    """A fit with given instants."""

    load: Floats
    """N, residuals, shape (rows,)."""
    left: Floats
    """N, residuals with those of the priors."""
    factors: Floats
    """Of the columns."""
    base: Floats
    """Orthonormal base of the columns."""
    forces: Floats
    """N at the finger, of the strings."""

    @property
    def chi2(self) -> float:
        """N^2, sum of squared residuals with those of the priors."""
        return float(self.left @ self.left)


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
            Their force, its second derivative, deviations of its shape; shape (rows, n, COLUMNS).
        """
        slow = self.slow
        at, top = np.interp(plucks.T, slow.hops, self.rise)
        contact, release = plucks.T
        time, rise = slow.hops[:, None], self.rise[:, None]
        part = np.clip((release - time) / slow.hop + 0.5, 0.0, 1.0) * (time > contact)
        u = np.maximum(rise - at, 0.0) * part / np.maximum(top - at, 1e-6)
        quadratic, cubic = self.strings.bends
        curved = u * (u - 1)
        line = u + curved * (quadratic + cubic * (u - 0.5))
        shapes = [curved * (q + c * (u - 0.5)) for q, c in self.strings.shapes]
        smooth = slow.smooth(np.concatenate([FORCE_STD * line, *shapes], 1))
        force, *shapes = smooth.reshape(len(self.load), 3, -1).transpose(1, 0, 2)
        columns = np.stack([force, SHARP_STD * slow.smooth(line, 2), *shapes], 2)
        return self.weight[:, None, None] * columns

    def solved(self, plucks: Floats) -> Solved:
        """Return the fit with these plucks, shape (plucks, 2)."""
        strings = self._strings_at(plucks).reshape(len(self.load), -1)
        columns = np.concatenate([self.free, strings], 1)
        n, k = columns.shape
        matrix, target = np.zeros((n + k, k)), np.zeros(n + k)
        matrix[:n], target[:n] = columns, self.load
        matrix[range(n, n + k), range(k)] = self._noise
        q, r = np.linalg.qr(matrix)
        of = q.T @ target
        factors = np.asarray(np.linalg.solve(r, of), dtype=float)
        left = target - q @ of
        forces = FORCE_STD * factors[self.free.shape[1] :: COLUMNS]
        return Solved(left[:n], left, factors, q, forces)

    def doubts(self, plucks: Floats) -> Floats:
        """Return how far plucks are from what the rig says, in standard deviations.

        Contacts and rises from contact to release; each is bounded by `DOUBT`, which is that of
        a pluck for which the rig has no string.

        Args:
            plucks: s, contacts and releases, shape (..., plucks, 2).

        Returns:
            Shape (..., 2 plucks).
        """
        strings, count = self.strings, plucks.shape[-2]
        rise = np.interp(plucks, self.slow.hops, self.rise)
        rise = np.take_along_axis(rise, np.argsort(rise[..., :1], axis=-2), -2)
        of_contact = (rise[..., :1] - strings.contacts) / CONTACT_STD
        climbed = np.maximum(rise[..., 1:] - rise[..., :1], 1e-5)
        far = np.stack([of_contact, np.log(climbed / strings.climbs) / CLIMB_STD], -1)
        far = far / np.sqrt(1 + far**2 / DOUBT**2)
        each, string = _assignments(count, len(strings.contacts))
        chosen = np.full((*far.shape[:-3], len(each), count, 2), DOUBT)
        chosen[..., np.arange(len(each))[:, None], each, :] = far[..., each, string, :]
        best = np.argmin((chosen**2).sum((-2, -1)), -1)[..., None, None, None]
        return np.take_along_axis(chosen, best, -3).reshape(*far.shape[:-3], 2 * count)

    def _slopes(self, plucks: Floats, solved: Solved) -> tuple[Floats, Floats]:
        """Return the derivatives of residuals, and of doubts, by contacts and releases."""
        ends = plucks.size
        off = SMALL * np.eye(ends).reshape(ends, -1, 2)
        own = solved.factors[self.free.shape[1] :].reshape(-1, COLUMNS).repeat(2, 0)
        place = range(ends), np.arange(ends) // 2
        up, down = plucks + off, plucks - off
        change = np.zeros((len(solved.left), ends))
        columns = self._strings_at(up[place]) - self._strings_at(down[place])
        change[: len(columns)] = (columns * own).sum(2) / (2 * SMALL)
        rig = (self.doubts(up) - self.doubts(down)).T / (2 * SMALL)
        return solved.base @ (solved.base.T @ change) - change, rig

    def stds(self, plucks: Floats, solved: Solved) -> tuple[list[list[float]], list[float]]:
        """Return the standard uncertainties of plucks [s], and the noise around them."""
        if not len(plucks):
            return [], []
        slopes, rig = self._slopes(plucks, solved)
        rows = np.searchsorted(self.slow.time, plucks)
        noises = [noise_around(solved.load, *pair) for pair in rows.tolist()]
        inverse = np.linalg.pinv(slopes.T @ slopes / max(noises) + rig.T @ rig)
        return np.sqrt(np.diag(inverse)).reshape(-1, 2).tolist(), [
            n / self._noise**2 for n in noises
        ]

    def refined(self, plucks: Floats) -> tuple[Floats, Solved, float]:
        """Return better instants near those of plucks, shape (plucks, 2), their fit, its chi2."""
        solved = self.solved(plucks)
        rows = np.searchsorted(self.slow.time, plucks[-1])
        weight = math.sqrt(noise_around(solved.load, *rows.tolist()))

        def evaluate(state: Floats) -> tuple[Floats, Solved]:
            trial = state.reshape(-1, 2)
            tried = self.solved(trial)
            return np.concatenate([tried.left, weight * self.doubts(trial)]), tried

        def permitted(state: Floats, tried: Solved) -> bool:
            apart = np.diff(state.reshape(-1, 2)) > self.slow.width
            return bool(apart.all() and (tried.forces > 0).all())

        def slopes(state: Floats, tried: Solved) -> Floats:
            load, rig = self._slopes(state.reshape(-1, 2), tried)
            return np.concatenate([load, weight * rig])

        def bounded(state: Floats) -> Floats:
            return np.clip(state, self.slow.hops[0], self.slow.hops[-1])

        found = minimise(plucks.ravel(), evaluate, slopes, permitted, bounded, LONGEST, CONVERGED)
        return found.state.reshape(-1, 2), found.found, found.chi2

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
        better = fitted.chi2 < EXCHANGED * solved.chi2
        return (other, fitted) if better else (plucks, solved)


@lru_cache
def _assignments(plucks: int, strings: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the ways to assign plucks to strings in order: indices, each (ways, pairs)."""
    pairs = min(plucks, strings)
    ways = [
        (each, string)
        for each in combinations(range(plucks), pairs)
        for string in combinations(range(strings), pairs)
    ]
    each, string = np.array(ways, np.intp).reshape(len(ways), 2, pairs).transpose(1, 0, 2)
    return each, string


def noise_around(left: Floats, first: int, last: int) -> float:
    """Return the variance of residuals around a saw-tooth at its scale: of sums over thirds."""
    width = max(1, (last - first) // 3)
    around = left[max(0, first - 2 * width) : last + 2 * width]
    count = len(around) // width
    sums = around[: count * width].reshape(count, width).sum(1)
    return float(sums @ sums) / (count * width) + 1e-12
