"""Search for plucks: from contact to release the load grows with the jack's rise, then collapses.

A string adds a load that grows from 0 in proportion to the rise since contact and ends at release:
a saw-tooth. Every pair of a contact and a release is tried against the load that a key without a
string leaves, by cumulative sums of products. Ringing of key, jack and transducer hardly changes
these sums, as it changes sign while the string is held. The best pair is added, all instants are
refined (Gauss-Newton), and the search is repeated for as many strings as the rig has.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.phases.slow import MOST_COMPLIANT, TERMS, Slow
from sautereau.trajectory.motion import Floats

NOISE = 0.015
"""N, of a smoothed row, of unmodelled vibration; weights the priors."""
LEVEL_STD, DRIFT_STD = 10.0, 0.03
"""N, prior standard deviations: of the constant load; of its change over the rise, with the speed,
and by a damper."""
DAMPER, FULL_RISE = 1e-3, 10e-3
"""m, lift of a damper, and rise over which the load changes."""
FORCE_STD, CURVED_STD = 3.0, 0.15
"""N, prior standard deviations of a string's force, and of its curvature."""
LEAST_RISE = 0.25e-3
"""m, least rise of the jack from contact to release."""
MOST_ROWS = 300
"""Rows in which pairs are tried."""
APART = 2.0
"""Widths between two releases."""
CLEARANCE, ANYWHERE = 0.8e-3, 0.2
"""m, standard deviation of a contact about a rig's clearance, and weight far from it."""
SIGNIFICANCE = 10.0
"""Least reduction of chi2 by a pluck over the noise around it."""
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
    """Reduction of chi2 over the noise around it."""


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
    terms: Floats
    """Factors of the terms of `Slow`, shape (6,), for a rigid key."""


def search(slow: Slow, clearances: Sequence[float]) -> Searched:
    """Return the growths of a press that collapse.

    Args:
        slow: Of the way down.
        clearances: m, rise at contact of every string of the rig.
    """
    compliance, found = 0.0, Searched((), None, 0.0, 0.0, np.zeros(len(TERMS)))
    if len(slow.time) < 12:
        return found
    for _ in range(ROUNDS):
        fit = _Fit(slow, compliance)
        found = fit.all(clearances)
        if abs(found.compliance - compliance) < max(2e-7, 0.05 * found.compliance):
            break
        compliance = found.compliance
    return found


class _Fit:
    """Fits of saw-teeth to the load for one compliance."""

    def __init__(self, slow: Slow, compliance: float):
        self._slow, self._compliance = slow, compliance
        self._rise = slow.rise(compliance)
        self._weight = NOISE / np.hypot(NOISE, slow.error(slow.time))
        self._load = self._weight * slow.load(compliance)
        rise, speed = slow.smooth(self._rise), slow.speed()
        drift = [rise / FULL_RISE, speed / max(1e-6, float(speed.max()))]
        drift.append(np.maximum(DAMPER - rise, 0.0) / DAMPER)
        level = np.full(len(rise), LEVEL_STD)
        free = np.column_stack([slow.terms, level, DRIFT_STD * np.stack(drift, 1)])
        self._free = self._weight[:, None] * free
        self._at = rise

    def all(self, clearances: Sequence[float]) -> Searched:
        """Return the plucks, added one by one."""
        found, values, left = np.zeros((0, 2)), np.zeros(0), self._solved(np.zeros((0, 2)))
        gains: list[float] = []
        further = None
        while len(found) <= len(clearances):
            starts = self._best(found, left[0][: len(self._load)], np.asarray(clearances))
            if not starts:
                break
            if 0 < len(found) < len(clearances):  # or contact is where the rig says
                rise = np.sort(clearances)[len(found)]
                contact = float(np.interp(rise, self._rise, self._slow.hops))
                starts += [np.array([contact, s[1]]) for s in starts[:1] if contact < s[1] - 4e-3]
            trials = [self._refined(np.vstack([found, start])) for start in starts]
            trial, solved = min(trials, key=lambda t: float(t[1][0] @ t[1][0]))
            trial, solved = self._in_order(trial, solved)
            n = len(self._load)
            forces = FORCE_STD * solved[1][self._free.shape[1] :: 2]
            first, last = np.searchsorted(self._slow.time, trial[-1])
            noise = _noise(solved[0][:n], int(first), int(last))
            gain = float(left[0] @ left[0] - solved[0] @ solved[0]) / noise
            least = max(LEAST_FORCE, LEAST_FRACTION * float(forces.max()))
            climbed = np.diff(np.interp(trial[-1], self._slow.hops, self._rise))[0]
            near = np.abs(trial[:-1, 1] - trial[-1, 1]).min(initial=np.inf)
            if climbed < LEAST_RISE or gain < SIGNIFICANCE or forces[-1] < least:
                break
            if near < APART * self._slow.width:
                break
            if len(found) == len(clearances):
                further = _growth(trial[-1], float(forces[-1]), gain)
                break
            found, left, values = trial, solved, forces
            gains.append(gain)
        k = self._compliance - float(left[1][1]) * TERMS["F''"]
        growths = [
            _growth(pair, float(force), gain)
            for pair, force, gain in zip(found, values, gains, strict=True)
        ]
        return Searched(
            tuple(sorted(growths, key=lambda g: g.release)),
            further,
            min(max(k, 0.0), MOST_COMPLIANT),
            float(np.sqrt(np.mean(left[0][: len(self._load)] ** 2))),
            left[1][: len(TERMS)] - self._compliance / TERMS["F''"] * (np.arange(len(TERMS)) == 1),
        )

    def _string(self, contact: float, release: float) -> Floats:
        """Return the columns of a string: its line and its curvature, shape (rows, 2)."""
        slow, time = self._slow, self._slow.hops
        at, top = np.interp((contact, release), time, self._rise)
        part = np.clip((release - time) / slow.hop + 0.5, 0.0, 1.0) * (time > contact)
        line = np.maximum(self._rise - at, 0.0) * part / max(top - at, 1e-6)
        curved = slow.smooth(line * (line - 1)) * CURVED_STD
        return self._weight[:, None] * np.stack([slow.smooth(line) * FORCE_STD, curved], 1)

    def _solved(self, plucks: Floats) -> tuple[Floats, Floats, Floats]:
        """Return residuals with those of the priors, factors, and an orthonormal base."""
        columns = np.column_stack([self._free, *[self._string(*pair) for pair in plucks]])
        matrix = np.concatenate([columns, NOISE * np.eye(columns.shape[1])])
        target = np.concatenate([self._load, np.zeros(columns.shape[1])])
        q, r = np.linalg.qr(matrix)
        of = q.T @ target
        return target - q @ of, np.asarray(np.linalg.solve(r, of), dtype=float), q

    def _refined(self, plucks: Floats) -> tuple[Floats, tuple[Floats, Floats, Floats]]:
        """Return better instants near those of plucks, shape (plucks, 2), and their fit."""
        solved, stiff = self._solved(plucks), 1e-2
        for _ in range(STEPS):
            left, factors, q = solved
            slopes = []
            for place, pair in enumerate(plucks):
                own = factors[self._free.shape[1] + 2 * place :][:2]
                for off in (np.array([SMALL, 0.0]), np.array([0.0, SMALL])):
                    change = (self._string(*(pair + off)) - self._string(*(pair - off))) @ own
                    change = np.pad(change / (2 * SMALL), (0, len(left) - len(change)))
                    slopes.append(q @ (q.T @ change) - change)
            jacobian = np.stack(slopes, 1)
            normal, right = jacobian.T @ jacobian, jacobian.T @ left
            better = None
            for _ in range(4):
                damped = normal + stiff * np.diag(np.diag(normal) + 1e-9)
                step = np.clip(-np.linalg.solve(damped, right), -LONGEST, LONGEST)
                trial = plucks + step.reshape(-1, 2)
                trial = np.clip(trial, self._slow.hops[0], self._slow.hops[-1])
                if (trial[:, 1] > trial[:, 0] + self._slow.width).all():
                    tried = self._solved(trial)
                    pulls = (tried[1][self._free.shape[1] :: 2] > 0).all()
                    if pulls and tried[0] @ tried[0] < left @ left:
                        better = trial, tried
                        break
                stiff *= 5
            if better is None:
                break
            plucks, solved = better
            stiff = max(stiff / 5, 1e-6)
            gained = float(left @ left - solved[0] @ solved[0])
            if gained < 1e-3 * float(left @ left):
                break
        return plucks, solved

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
        other, fitted = self._refined(swapped)
        better = fitted[0] @ fitted[0] < EXCHANGED * float(solved[0] @ solved[0])
        return (other, fitted) if better else (plucks, solved)

    def _best(self, found: Floats, left: Floats, clearances: Floats) -> list[Floats]:
        """Return the contact and the release [s] of the saw-teeth that fit residuals best."""
        _, _, q = self._solved(found)
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
        for release in found[:, 1]:
            possible &= np.abs(time[None, :] - release) > APART * self._slow.width
        gain = np.where(possible, of_load**2 / np.where(possible, square, 1.0), 0.0)
        far = np.abs(rise[:, None] - clearances).min(1) / CLEARANCE
        gain *= (ANYWHERE + (1 - ANYWHERE) * np.exp(-(far**2) / 2))[:, None]
        starts: list[Floats] = []
        for _ in range(STARTS):
            first, last = np.unravel_index(int(np.argmax(gain)), gain.shape)
            if not gain[first, last] > 0:
                break
            release = (time[last - 1] + time[last]) / 2
            starts.append(np.array([time[first], release]))
            gain[:, np.abs(time - release) < BETWEEN * self._slow.width] = 0.0
        return starts


def _growth(pair: Floats, force: float, gain: float) -> Growth:
    return Growth(float(pair[0]), float(pair[1]), force, gain)


def _before(column: Floats) -> Floats:
    """Return the sums of all rows before each row."""
    return np.concatenate([[0.0], np.cumsum(column)[:-1]])


def _between(sums: Floats) -> Floats:
    """Return the differences of sums, of each row (second axis) less each row (first axis)."""
    return sums[None, :] - sums[:, None]


def _noise(left: Floats, first: int, last: int) -> float:
    """Return the variance of residuals around a saw-tooth at its scale: of sums over thirds."""
    width = max(1, (last - first) // 3)
    around = left[max(0, first - 2 * width) : last + 2 * width]
    count = len(around) // width
    sums = around[: count * width].reshape(count, width).sum(1)
    return float(sums @ sums) / (count * width) + 1e-12
