"""The load as a sum of saw-teeth, one for each string, and of what a key without a string adds.

A string adds a load that grows from 0 with the rise since contact and ends at release. For given
instants the model is linear; the instants are refined (Levenberg-Marquardt), with priors from the
rig. The sum of two hardly changes if their contacts are exchanged, which may belong to each other's
release.
"""

import math
from dataclasses import dataclass
from itertools import combinations, permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.phases.contact import hum_at
from sautereau.analysis.phases.expected import Expected
from sautereau.analysis.phases.levenberg import minimise, orthonormal
from sautereau.analysis.phases.slow import TERMS, Slow
from sautereau.trajectory.motion import Floats

COLUMNS = 5
"""Columns of a string: its force, the first and second derivatives of its force, two deviations of
its shape. The derivatives represent what lies between the laser and the jack."""
FORCE_STD = 3.0  # N, prior standard deviation of the force of a string
EQUAL = 1.1  # Ratio of two chi2 up to which the contacts of both fits count as equally good


@dataclass(frozen=True)
class Solved:
    """A fit with given instants."""

    row_residuals: Floats
    """N, residuals of the rows, shape (rows,)."""
    residuals: Floats
    """N, residuals of the rows and of the priors."""
    factors: Floats
    """Of the columns of strings, shape (strings, COLUMNS)."""
    base: Floats
    """Orthonormal base of these columns, orthogonal to those of a key without a string."""
    inverse: Floats
    """What these columns must be multiplied by for that base."""
    risen: tuple[Floats, Floats, Floats]
    """As `SawTeeth._relative_rise` returns it."""

    @property
    def forces(self) -> Floats:
        """N at the finger, of the strings."""
        return FORCE_STD * self.factors[:, 0]

    @property
    def chi2(self) -> float:
        """N^2, sum of squared residuals with those of the priors."""
        return float(self.residuals @ self.residuals)


class SawTeeth:
    """Fits of saw-teeth to the load for one compliance.

    Args:
        compliance: s^2, k of `sautereau.analysis.phases.slow`.
        noise: N, of a row; it weights the priors.
        releases: s, of the plucks with their standard uncertainties, shape (plucks, 2), where they
            are known from elsewhere.
        unexplained: N, further error of each row, shape (rows,).
    """

    def __init__(
        self,
        slow: Slow,
        compliance: float,
        noise: float,
        strings: Expected,
        releases: Floats | None = None,
        unexplained: Floats | float = 0.0,
    ):
        self.slow, self.compliance, self.strings = slow, compliance, strings
        self.noise, self._releases = noise, releases
        self.rise = slow.rise(compliance)
        """m, of the jack at the blocks."""
        self.weight = noise / np.hypot(np.hypot(noise, unexplained), slow.error(slow.time))
        """Of the rows, less where there are impacts and ringing."""
        self.load = self.weight * slow.load(compliance)
        """N, weighted."""
        rise, speed = slow.smooth(self.rise), slow.speed()
        settings = slow.settings
        drift = [rise / 10e-3, speed / max(1e-6, float(speed.max()))]
        drift.append(np.maximum(1 - rise / settings.damper_lift, 0.0))
        level = np.full(len(rise), 10.0)  # N, which bounds nothing
        hum = settings.hum_std * hum_at(slow.time)
        free = np.column_stack([slow.terms, level, settings.drift_std * np.stack(drift, 1), hum])
        known = free.shape[1]
        self._free = self.weight[:, None] * free
        free = np.concatenate([self._free, noise * np.eye(known)])
        self.base, _ = np.linalg.qr(free)
        """Orthonormal base of the columns of a key without a string, with the rows of priors."""
        self._left = np.concatenate([self.load, np.zeros(known)])
        self._left -= self.base @ (self.base.T @ self._left)
        self._climbing = np.gradient(self.rise, slow.hop)
        self._derivatives = 0.0 if releases is None else settings.loss_std, settings.sharp_std
        self._bends = np.array([1.0, *strings.bends])
        self._mixed = np.zeros((3, COLUMNS))
        """Of u, u(u - 1) and u(u - 1)(u - 1/2) in each column of a string, see `Expected.bends`."""
        self._mixed[:, 0] = FORCE_STD * self._bends
        self._mixed[1:, 3:] = float(strings.forces.mean()) * np.diag(settings.shape_std)
        self._refined: dict[tuple[bytes, float | None], tuple[Floats, Solved, float]] = {}
        """What `refined` has returned: a search starts at the same instants several times."""
        self.row_rise = rise
        """m, rise of the jack at the rows."""

    def _relative_rise(self, plucks: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the rise since contact over the rise from contact to release, and when it counts.

        Args:
            plucks: s, contacts and releases, shape (n, 2).

        Returns:
            The relative rise, and the fraction of each block in which the string is held, both of
            shape (blocks, n); the rise from contact to release [m], shape (n,).
        """
        slow, time = self.slow, self.slow.hops[:, None]
        at, top = np.interp(plucks.T, slow.hops, self.rise)
        contact, release = plucks.T
        part = np.clip((release - time) / slow.hop + 0.5, 0.0, 1.0) * (time > contact)
        height = np.maximum(top - at, 1e-6)
        return np.maximum(self.rise[:, None] - at, 0.0) / height, part, height

    def _relative_rise_slopes(
        self, plucks: Floats, risen: tuple[Floats, Floats, Floats]
    ) -> tuple[Floats, Floats]:
        """Return the relative rise while strings are held, and its derivatives by their instants.

        Returns:
            Shape (blocks, n), and (blocks, n, 2).
        """
        whole, part, height = risen
        at_speed, top_speed = np.interp(plucks.T, self.slow.hops, self._climbing) / height
        ends = (part > 0) & (part < 1)
        by_contact = (whole - 1) * (part * at_speed)
        by_release = whole * (ends / self.slow.hop - part * top_speed)
        return whole * part, np.stack([by_contact, by_release], -1)

    def _strings_at(self, u: Floats) -> Floats:
        """Return the columns of strings.

        Args:
            u: Their relative rise while they are held, shape (blocks, n).

        Returns:
            As `COLUMNS`, shape (rows, n, COLUMNS).
        """
        bend = u * (u - 1)
        terms = np.stack([u, bend, bend * (u - 0.5)], -1)
        smooth = self.slow.smooth(terms.reshape(len(u), -1))
        columns = smooth.reshape(len(self.load), -1, 3) @ self._mixed
        for order, std in enumerate(self._derivatives, 1):
            if std:
                columns[..., order] = std * self.slow.smooth(terms @ self._bends, order)
        return self.weight[:, None, None] * columns

    def solved(self, plucks: Floats) -> Solved:
        """Return the fit with these plucks, shape (plucks, 2)."""
        risen = self._relative_rise(plucks)
        columns = self._strings_at(risen[0] * risen[1]).reshape(len(self.load), -1)
        known, k = len(self._left), columns.shape[1]
        matrix, target = np.zeros((known + k, k)), np.zeros(known + k)
        matrix[: len(columns)] = columns
        matrix[:known] -= self.base @ (self.base.T @ matrix[:known])
        matrix[known:] = self.noise * np.eye(k)
        target[:known] = self._left
        base, inverse = orthonormal(matrix)
        of = base.T @ target
        factors = (inverse @ of).reshape(-1, COLUMNS)
        left = target - base @ of
        return Solved(left[: len(columns)], left, factors, base, inverse, risen)

    def term(self, solved: Solved, name: str) -> float:
        """Return a term of the key in a fit, in its unit (`TERMS`)."""
        # The residual of a prior is minus the factor of its column.
        row = len(self.load) + list(TERMS).index(name)
        return -float(solved.residuals[row]) / self.noise * TERMS[name]

    def lag(self, solved: Solved) -> float:
        """Return by how much [s] the force is late, compared with the velocity."""
        return -self.term(solved, "F1") - self.term(solved, "v2") / self.slow.inertial

    def lag_std(self, solved: Solved) -> float:
        """Return the standard uncertainty [s] of `lag` for given instants and the assumed noise."""
        strings = self._strings_at(solved.risen[0] * solved.risen[1]).reshape(len(self.load), -1)
        columns = np.column_stack([self._free, strings])
        by_factors, names = np.zeros(columns.shape[1]), list(TERMS)
        by_factors[names.index("F1")] = -TERMS["F1"]
        by_factors[names.index("v2")] = -TERMS["v2"] / self.slow.inertial
        normal = columns.T @ columns + self.noise**2 * np.eye(columns.shape[1])
        return self.noise * math.sqrt(float(by_factors @ np.linalg.solve(normal, by_factors)))

    def rig_deviations(self, plucks: Floats) -> Floats:
        """Return the deviations of plucks from the rig (`Expected.deviations`).

        Args:
            plucks: s, contacts and releases, shape (..., plucks, 2).

        Returns:
            Shape (..., 2 plucks).
        """
        contacts, releases = np.moveaxis(np.interp(plucks, self.slow.hops, self.rise), -1, 0)
        return self.strings.deviations(contacts, releases)

    def _deviations(self, plucks: Floats) -> Floats:
        """Return `rig_deviations`, and the same of releases from those that are known."""
        deviations = self.rig_deviations(plucks)
        if self._releases is None:
            return deviations
        time, std = self._releases.T
        return np.concatenate([deviations, (plucks[..., 1] - time) / std], -1)

    def _slopes(self, plucks: Floats, solved: Solved) -> tuple[Floats, Floats, Floats]:
        """Return the derivatives by contacts and releases, shape (..., 2 plucks).

        They are those of residuals, of `_deviations`, and of the forces of the strings.
        """
        u, by_ends = self._relative_rise_slopes(plucks, solved.risen)
        steep = np.stack([np.ones_like(u), 2 * u - 1, 3 * u * (u - 1) + 0.5], -1)
        of_force = (steep * (solved.factors @ self._mixed.T)).sum(-1)
        of_derivatives = (
            (steep @ self._bends)[..., None] * self._derivatives * solved.factors[:, 1:3]
        )
        rows, known = len(self.load), len(self._left)
        change = np.zeros((len(solved.residuals), plucks.size))
        for order, part in enumerate((of_force, *np.moveaxis(of_derivatives, -1, 0))):
            if order == 0 or self._derivatives[order - 1]:
                part = (part[..., None] * by_ends).reshape(len(u), -1)
                change[:rows] += self.slow.smooth(part, order)
        change[:rows] *= self.weight[:, None]
        change[:known] -= self.base @ (self.base.T @ change[:known])
        small = 0.2e-3  # s, of a difference quotient
        off = small * np.eye(plucks.size).reshape(-1, *plucks.shape)
        up, down = self._deviations(np.stack([plucks + off, plucks - off]))
        of = solved.base.T @ change
        forces = -FORCE_STD * (solved.inverse @ of)[::COLUMNS]
        return solved.base @ of - change, (up - down).T / (2 * small), forces

    def stds(self, plucks: Floats, solved: Solved) -> Floats:
        """Return the standard uncertainties of contacts [s], releases [s] and forces [N].

        Returns:
            Shape (plucks, 3).
        """
        if not len(plucks):
            return np.zeros((0, 3))
        slopes, rig, by_instants = self._slopes(plucks, solved)
        noise = max(self.noises(plucks, solved))
        inverse = np.linalg.pinv(slopes.T @ slopes / noise + rig.T @ rig, hermitian=True)
        instants = np.diag(inverse).reshape(-1, 2)
        # Of the forces for given instants, and by the errors of these.
        forces = noise * FORCE_STD**2 * (solved.inverse[::COLUMNS] ** 2).sum(1)
        forces = forces + ((by_instants @ inverse) * by_instants).sum(1)
        return np.sqrt(np.maximum(np.column_stack([instants, forces]), 0.0))

    def noises(self, plucks: Floats, solved: Solved) -> list[float]:
        """Return the variance [N^2] of the residuals around each pluck."""
        rows = np.searchsorted(self.slow.time, plucks)
        return [noise_around(solved.row_residuals, *pair) for pair in rows.tolist()]

    def refined(
        self, plucks: Floats, variance: float | None = None
    ) -> tuple[Floats, Solved, float]:
        """Return better instants near those of plucks, shape (plucks, 2), their fit, its chi2.

        Args:
            plucks: s, contacts and releases, shape (plucks, 2).
            variance: N^2, in units of which the squared deviations from the rig count; that of the
                residuals around the last pluck if it is not given.
        """
        key = plucks.tobytes(), variance
        if key in self._refined:
            return self._refined[key]
        solved = self.solved(plucks)
        if not len(plucks):
            return plucks, solved, solved.chi2
        if variance is None:
            variance = self.noises(plucks[-1:], solved)[0]
        weight, start = math.sqrt(variance), plucks.reshape(1, -1)

        # There is one search at a time: stacked, they were not faster.
        def evaluate(states: Floats) -> tuple[NDArray[Any], ...]:
            trial = states.reshape(-1, 2)
            fit = solved if (states == start).all() else self.solved(trial)
            left = np.append(fit.residuals, weight * self._deviations(trial))
            return left[None], np.array([fit])

        def permitted(states: Floats, found: tuple[NDArray[Any], ...]) -> NDArray[np.bool_]:
            apart = np.diff(states.reshape(-1, 2)) > self.slow.width
            return np.array([apart.all() and (found[1][0].forces > 0).all()])

        def slopes(states: Floats, found: tuple[NDArray[Any], ...]) -> Floats:
            load, rig, _ = self._slopes(states.reshape(-1, 2), found[1][0])
            return np.concatenate([load, weight * rig])[None]

        def bounded(states: Floats) -> Floats:
            return np.clip(states, self.slow.hops[0], self.slow.hops[-1])

        found = minimise(start, evaluate, slopes, permitted, bounded, 4e-3, 3e-4)
        better = found.states.reshape(-1, 2), found.found[1][0], float(found.chi2[0])
        self._refined[key] = better
        return better


def noise_around(left: Floats, first: int, last: int) -> float:
    """Return the variance of residuals around a saw-tooth at its scale: of sums over thirds."""
    width = max(1, (last - first) // 3)
    around = left[max(0, first - 2 * width) : last + 2 * width]
    count = len(around) // width
    sums = around[: count * width].reshape(count, width).sum(1)
    return float(sums @ sums) / (count * width) + 1e-12


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
            found[[i, j], 2] = log_odds(chi2, least)
    return found


def log_odds(chi2: float, other: float) -> float:
    """Return the logarithm of the likelihood of a fit over that of another one, by their chi2.

    Rows within some widths of the smoothing have the same error: while strings are held, there are
    about 20 independent ones.
    """
    return 20 / 2 * math.log(other / chi2)


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
