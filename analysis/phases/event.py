"""The release of a string on a compliant key: a sudden event in force and velocity.

Around the event each signal is a polynomial with ringing from before, and from the event on a curve
and damped modes (`response`). Both signals have the same instants and poles. The model is linear in
all other parameters; these are eliminated, and instants and poles are refined (`levenberg`).
"""

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import pairwise

import numpy as np

from sautereau.analysis.phases.levenberg import minimise, orthonormal
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.response import Orders, Poles, Response, curves, pole, ringing_in
from sautereau.analysis.phases.signals import Signals
from sautereau.trajectory.motion import Floats

BLOCK = 8
"""Rows over which residuals are summed in order to detect correlated ones. Also the fewest rows
whose noise is estimated by itself."""


@dataclass(frozen=True)
class Fitted:
    """A fit with a number of modes."""

    instants: Floats
    """s, of the events after the origin."""
    poles: Poles
    """1/s, of the modes."""
    orders: Orders
    """Powers with which the signals begin."""
    residuals: Floats
    """Residuals over the ranges of the signals, shape (2, n)."""
    deviations: float
    """Sum of squared deviations from what was expected, of instants and linear factors."""
    variance: float
    """s^2, of the first instant."""
    parameters: int
    """Number of parameters."""


class EventFit:
    """Fits of events to the signals around the first of them.

    Args:
        stretch: First sample, and the last one, exclusive.
        near: s after the trigger, expected instants; the first is the origin of time.
        stds: s, their standard uncertainties.
        degree: Of the polynomial.
    """

    def __init__(
        self,
        signals: Signals,
        stretch: tuple[int, int],
        samples: int,
        near: Floats,
        stds: Floats,
        degree: int,
    ):
        first, last = stretch
        n, weights = (last - first) // samples, np.full(samples, 1 / samples)

        def means(signal: Floats) -> Floats:
            return signal[first : first + n * samples].reshape(n, samples) @ weights

        self.expected, self._stds = near - near[0], stds
        at = means(signals.time) - near[0]
        self._response = Response(at, samples / signals.rate, degree, signals.low_passes)
        starts = [0]
        # From then on, in s after the event, rows have a noise of their own: the jack may have left
        # its cloth, and the modes differ.
        for start in np.searchsorted(at, (1e-3, 1.75e-3)):
            if start - starts[-1] >= BLOCK and n - start >= BLOCK:
                starts.append(int(start))
        self._parts = [slice(*ends) for ends in pairwise([*starts, n])]
        load = np.stack([means(signals.force), means(signals.velocity)])
        flags = np.stack([means(f.astype(float)) for f in (signals.no_force, signals.no_velocity)])
        scale = np.maximum(np.ptp(load, axis=1, keepdims=True), 1e-9)
        noise = np.array([[signals.force_noise], [signals.velocity_noise]]) / math.sqrt(samples)
        self._load, self._white, self._good = load / scale, noise / scale, flags == 0
        if signals.missing:
            self._good[("force", "velocity").index(signals.missing)] = False
        # Nearer to the event it is unknown whether a row is before it.
        before, after = np.searchsorted(at, np.array([-1, 1]) * min(float(stds[0]), 0.5e-3))
        white = self._load * self._good / np.maximum(self._white, 3e-3)
        ringing = ringing_in([white[:, :before], white[:, after:]], self._response.step)
        self._modes = np.append(ringing, pole(400.0, 0.4))
        """1/s, poles of modes that the signals may have: those of their ringing, and one that is
        too damped to ring."""
        self._set_noise(np.maximum(self._white, 0.03))  # before there are residuals

    def _set_noise(self, noise: Floats) -> None:
        """Set the noise of each signal over its range, shape (2, 1) or (2, n)."""
        self._noise = np.broadcast_to(noise, self._load.shape)
        self._weight = self._good / self._noise
        self.load = self._load * self._weight
        """In units of the noise, shape (2, n)."""

    def chi2(self, fitted: Fitted) -> float:
        """Return the sum of squared residuals and deviations of a fit, in units of the noise."""
        return float(((fitted.residuals * self._good / self._noise) ** 2).sum()) + fitted.deviations

    def score(self, fitted: Fitted) -> float:
        """Return the Bayesian information criterion of a fit."""
        return self.chi2(fitted) + self.penalty(fitted)

    def penalty(self, fitted: Fitted) -> float:
        """Return what the criterion adds to chi2 for the number of parameters."""
        return fitted.parameters * math.log(self.load.size)

    def weigh_as(self, other: "EventFit") -> None:
        """Set the noise to that of another fit to the same samples."""
        self._set_noise(other._noise)

    def weigh(self, fitted: Fitted) -> None:
        """Set the noise to the residuals of a fit, and their sums if those are larger."""
        noise = np.empty_like(self._load)
        for part in self._parts:
            good = self._good[:, part]
            left = fitted.residuals[:, part] * good
            n = left.shape[1] // BLOCK * BLOCK
            sums = left[:, :n].reshape(2, -1, BLOCK).sum(2)
            square = np.maximum((left**2).sum(1), (sums**2).sum(1) / BLOCK)
            square = square / np.maximum(good.sum(1), 1)
            noise[:, part] = np.sqrt(square)[:, None]
        self._set_noise(np.maximum(self._white, noise))

    @property
    def noise(self) -> float:
        """Dimensionless, largest variance of the residuals over that of the white noise.

        Rows of the later parts do not count.
        """
        return float(((self._noise[:, 0] / self._white[:, 0]) ** 2).max())

    def scan(self, instants: Floats, poles: Poles, orders: Orders) -> tuple[Floats, Poles]:
        """Return chi2 and the best further pole of those of the ringing [1/s].

        Args:
            instants: s, of the events; shape (k, events).
            poles: 1/s.
            orders: Powers with which force and velocity begin.

        Returns:
            Both of shape (k,).
        """
        n, curve = self.load.shape[1], curves(orders)
        many = np.tile(poles, (len(instants), 1))
        residuals, _, base = self._solved(instants, many, orders)
        # A mode's rows of priors are 0, and residuals are orthogonal to the base: products with
        # what the base leaves of a mode need no more than the mode itself and its part in the base.
        modes = self._columns(instants[:, :1], self._modes, orders)[..., curve:]
        modes = self._weight[..., None] * modes
        a, b = np.split(modes, 2, axis=-1)
        of_a, of_b = np.split((residuals[..., None, :n] @ modes)[..., 0, :], 2, axis=-1)
        known = base[..., :n, :].swapaxes(-1, -2) @ modes
        in_a, in_b = np.split(known, 2, axis=-1)
        aa, bb, ab = (
            np.einsum("...nm,...nm->...m", *both) - np.einsum("...nm,...nm->...m", *of) + 1e-9
            for both, of in (((a, a), (in_a, in_a)), ((b, b), (in_b, in_b)), ((a, b), (in_a, in_b)))
        )
        gain = (bb * of_a**2 - 2 * ab * of_a * of_b + aa * of_b**2) / np.maximum(
            aa * bb - ab**2, 1e-6 * aa * bb
        )
        gain = gain.sum(1)
        far = ((instants - self.expected) / self._stds) ** 2
        chi2 = (residuals**2).sum((1, 2)) + far.sum(1) - gain.max(1)
        return chi2, self._modes[np.argmax(gain, 1)]

    def refine(self, starts: Sequence[tuple[Floats, Poles]], orders: Orders) -> list[Fitted]:
        """Return the best fits near instants [s] and poles [1/s], with the orders of `scan`.

        Args:
            starts: All with the same number of poles.
        """
        events, modes = len(starts[0][0]), len(starts[0][1])
        instants = np.array([start[0] for start in starts])
        poles: Poles = np.array([start[1] for start in starts])
        turn = np.abs(poles)
        states = np.concatenate([instants, np.log(turn), np.log(-poles.real / turn)], 1)
        # Frequencies from 50 Hz to 0.45 of the rate of the blocks, and damping ratios.
        highest = 2 * math.pi * 0.45 / self._response.step
        low = np.repeat(np.log([2 * math.pi * 50.0, 0.003]), modes)
        high = np.repeat(np.log([highest, 0.9]), modes)

        def evaluate(states: Floats) -> tuple[Floats, ...]:
            instants, poles = self._split(states)
            left, factors, base = self._solved(instants, poles, orders)
            far = (instants - self.expected) / self._stds
            return np.concatenate([left.reshape(len(left), -1), far], 1), left, factors, base

        def bounded(states: Floats) -> Floats:
            return np.concatenate([states[:, :events], np.clip(states[:, events:], low, high)], 1)

        # Of instants in s, of the logarithms of frequency and damping.
        longest = np.repeat([1e-3, 0.3, 0.7], [events, modes, modes])
        slopes, always = partial(self._slopes, orders), np.ones(1, dtype=bool)
        found = minimise(states, evaluate, slopes, lambda *_: always, bounded, longest, 1e-3)
        _, residuals, factors, _ = found.found
        # For columns that no sample determines.
        diagonal = np.diagonal(found.normal, axis1=1, axis2=2) * 1e-9 + 1e-9
        inverse = np.linalg.inv(found.normal + diagonal[:, None] * np.eye(len(low) + events))
        left = residuals[:, :, : self.load.shape[1]]
        deviations = found.chi2 - (left**2).sum((1, 2))
        parameters = states.shape[1] + factors[0].size
        return [
            Fitted(*self._split(state), orders, rows * self._noise, far, variance, parameters)
            for state, rows, far, variance in zip(
                found.states, left, deviations.tolist(), inverse[:, 0, 0].tolist(), strict=True
            )
        ]

    def _split(self, state: Floats) -> tuple[Floats, Poles]:
        """Return the instants and poles of states, shape (..., k); it has logarithms of these."""
        events = len(self.expected)
        turn, damping = np.moveaxis(
            np.exp(state[..., events:]).reshape(*state.shape[:-1], 2, -1), -2, 0
        )
        return state[..., :events], turn * (-damping + 1j * np.sqrt(1 - damping**2))

    def _columns(self, instants: Floats, poles: Poles, orders: Orders) -> Floats:
        """Return the columns of all events, shape (..., orders, n, events (curves + 2 modes))."""
        event = np.moveaxis(self._response.event(instants, poles, orders), -4, -2)
        return event.reshape(*event.shape[:-2], -1)

    def _solved(
        self, instants: Floats, poles: Poles, orders: Orders
    ) -> tuple[Floats, Floats, Floats]:
        """Return the fits with instants [s], shape (m, events), and poles [1/s], (m, modes).

        Returns:
            Residuals with those of the priors, in units of the noise, shape (m, 2, n + columns);
            the factors of the columns, (m, 2, columns); the columns' orthonormal base, (m, 2, n +
            columns, columns).
        """
        event, before = self._columns(instants, poles, orders), self._response.before(poles)
        sizes = instants.shape[-1], poles.shape[-1], curves(orders), self._response.degree
        n, known = before.shape[-2:]
        rows = _prior(*sizes)
        columns = np.empty((len(instants), len(self.load), n + len(rows), len(rows)))
        columns[..., :n, :known] = before[..., None, :, :]
        columns[..., :n, known:] = event
        columns[..., :n, :] *= self._weight[..., None]
        columns[..., n:, :] = rows
        target = np.zeros(columns.shape[:-1])
        target[..., :n] = self.load
        base, inverse = orthonormal(columns)
        of = base.swapaxes(-1, -2) @ target[..., None]
        left = target - (base @ of)[..., 0]
        return left, (inverse @ of)[..., 0], base

    def _slopes(self, orders: Orders, states: Floats, solved: tuple[Floats, ...]) -> Floats:
        """Return the derivatives of the residuals by the states (Kaufman's approximation)."""
        _, residuals, factors, base = solved
        instants, poles = self._split(states)
        events, m, curve = instants.shape[1], poles.shape[1], curves(orders)
        by_instant, by_pole, early = self._response.slopes(instants, poles, orders)
        ringing = self._response.degree + 1
        before, event = np.split(factors[..., ringing:], [2 * m], axis=-1)
        event = event.reshape(len(states), 2, events, -1).swapaxes(1, 2)
        of_instants = np.moveaxis((by_instant @ event[..., None])[..., 0], 1, -1)
        modes = event[..., curve : curve + m] - 1j * event[..., curve + m :]
        change = (by_pole * modes[..., None, :]).sum(1)
        rung = before[..., :m] - 1j * before[..., m:]
        change = change + early[:, None] * rung[:, :, None]
        poles = poles[:, None, None]
        turn = np.abs(poles)
        damping = -poles.real / turn
        by_damping = -turn * damping * (1 + 1j * damping / np.sqrt(1 - damping**2))
        columns = np.concatenate(
            [of_instants, (change * poles).real, (change * by_damping).real], -1
        )
        white = np.zeros((*residuals.shape, states.shape[1]))
        white[:, :, : self.load.shape[1]] = self._weight[..., None] * columns
        white = base @ (base.swapaxes(-1, -2) @ white) - white
        far = np.eye(events, states.shape[1]) / self._stds[:, None]
        far = np.broadcast_to(far, (len(states), *far.shape))
        return np.concatenate([white.reshape(len(states), -1, states.shape[1]), far], 1)


@lru_cache
def _prior(events: int, modes: int, curves: int, degree: int) -> Floats:
    """Return the rows of the priors of linear factors, shape (columns, columns).

    Their standard deviations are over the range of a signal. They bound what the samples do not
    determine: each may be half as large again, but 100 for all makes releases worse.
    """
    of_event = np.repeat([30.0, 1.5], [curves, 2 * modes])
    of_before = np.repeat([1e3, 0.5], [degree + 1, 2 * modes])
    return np.diag(1 / np.concatenate([of_before, *[of_event] * events]))


def refine_event(
    signals: Signals,
    near: float,
    std: float,
    force: float,
    after: float,
    until: float,
    others: Sequence[float] = (),
) -> Release:
    """Return the instant of a release, fitted to the samples around it.

    What follows after the finger has lost the key is not fitted. The motion before the release is a
    part of slow modes of finger and key, which the polynomial only approximates, and the better fit
    need not have the better instant: so the fits of degree 2 are refined with degree 4. The instant
    is the mean over both degrees; their spread is part of its uncertainty.

    Args:
        near: s after the trigger, approximate instant.
        std: s, its standard uncertainty.
        force: N at the finger, by which the load falls.
        after: s after the trigger, before which nothing is used.
        until: s after the trigger, after which nothing is used.
        others: s after the trigger, approximate instants of other releases.
    """
    settings = signals.settings
    begin, samples = (
        max(after, near - settings.before),
        max(1, round(settings.block * signals.rate)),
    )
    end = min(until, near + settings.after)
    first, middle, last = map(signals.sample, (begin, near, end))
    least = 3 * signals.force_noise
    lost = np.flatnonzero(signals.force[middle:last] < least)
    if len(lost) and signals.force[first : middle + 1].mean() > least:
        end = min(end, float(signals.time[middle + lost[0]]))

    def fit_of(degree: int) -> EventFit | None:
        stretch = max(0, signals.sample(begin)), min(len(signals.time), signals.sample(end))
        if (stretch[1] - stretch[0]) // samples < 24:
            return None
        events = np.array([near, *(t for t in others if begin < t < end)])
        return EventFit(signals, stretch, samples, events, np.full(len(events), std), degree)

    fit = fit_of(2)
    if fit is None:
        return Release(near, std, force, 0.1 * force, 0.0, 0.0, math.inf)
    fits = _search(fit, std, settings.modes)
    each = [_mean(fit, fits)]
    if again := fit_of(4):
        again.weigh_as(fit)
        refined = _refined(again, sorted(fits, key=fit.score)[:6])
        again.weigh(min(refined, key=again.chi2))
        each.append(_mean(again, refined))
    times, variances = np.array(each).T
    stds = np.hypot(settings.release_larger * np.sqrt(variances), signals.instant_std)
    return Release(
        time=near + float(times.mean()),
        std=math.hypot(float(stds.mean()), float(times.std())),
        fall=force,
        fall_std=0.1 * force,
        slowed=0.0,
        gain=0.0,
        noise=fit.noise,
    )


def _search(fit: EventFit, std: float, modes: int) -> list[Fitted]:
    """Return the fits of a search, after which the noise is that of the best of them.

    Chi2 has several minima, so searches start from the best instant of each half of their range.
    Each search adds one mode after the other: it selects the mode of the ringing that reduces the
    residuals most, and then refines all modes. Those that the mode makes best are continued.
    """
    tried = np.tile(fit.expected, (20, 1))
    tried[:, 0] = np.linspace(-3, 3, len(tried)) * std
    chains: list[Fitted] = []
    # Force and velocity may begin as t^2, the velocity as t, as on a key whose jack stands on a
    # hard cloth, or both as t^3, where another spring is between jack and finger.
    for orders in ((2,), (2, 1), (3,)):
        chi2, poles = fit.scan(tried, np.zeros(0, complex), orders)
        best = [part[np.argmin(chi2[part])] for part in np.array_split(np.arange(len(tried)), 2)]
        chains += _distinct(fit.refine([(tried[i], poles[i : i + 1]) for i in best], orders))
    fits = [*chains]
    for _ in range(modes - 1):
        fit.weigh(min(chains, key=fit.chi2))
        further = [(f, *fit.scan(f.instants[None], f.poles, f.orders)) for f in chains]
        further.sort(key=lambda each: each[1][0] + fit.penalty(each[0]))
        chains = _distinct(
            _refined(fit, [replace(f, poles=np.append(f.poles, p)) for f, _, p in further[:4]])
        )
        fits += chains
    fit.weigh(min(chains, key=fit.chi2))
    return fits


def _refined(fit: EventFit, fits: Iterable[Fitted]) -> list[Fitted]:
    """Return fits refined from the instants and poles of others, those of one kind together."""
    found: list[Fitted] = []
    kinds = defaultdict(list)
    for fitted in fits:
        kinds[fitted.orders, len(fitted.poles)].append((fitted.instants, fitted.poles))
    for (orders, _), starts in kinds.items():
        found += fit.refine(starts, orders)
    return found


def _mean(fit: EventFit, fits: list[Fitted]) -> tuple[float, float]:
    """Return the mean instant of the plausible fits, refined with the present noise, in s.

    Returns:
        The mean, weighted by the Bayesian information criterion, and its variance.
    """
    least = min(map(fit.score, fits)) + 25
    fits = _refined(fit, (f for f in sorted(fits, key=fit.score) if fit.score(f) < least))
    scores = np.array([fit.score(f) for f in fits])
    chance = np.exp((scores.min() - scores) / 2)
    chance /= chance.sum()
    times = np.array([f.instants[0] for f in fits])
    mean = float(times @ chance)
    # Undetermined modes make a variance infinite, and its product with no chance no number.
    spread = np.minimum([f.variance for f in fits], 1e-6)
    return mean, float(chance @ ((times - mean) ** 2 + spread))


def resolved(signals: Signals, near: float) -> bool:
    """Return whether small residuals of a release near a time [s] can be caused by modes.

    They have other causes where a signal is missing or interpolated, where the noise is below its
    floor (errors of the model), and where samples are longer than a block (filter of the
    converter).
    """
    settings = signals.settings
    around = slice(
        max(0, signals.sample(near - settings.before)), signals.sample(near + settings.after)
    )
    return (
        signals.missing is None
        and signals.rate * settings.block >= 1
        and signals.force_noise > settings.force_floor
        and signals.velocity_noise > settings.velocity_floor
        and not (signals.no_force[around] | signals.no_velocity[around]).any()
    )


def _distinct(fits: list[Fitted]) -> list[Fitted]:
    """Return the fits without repetitions: same orders and same instants."""
    found: list[Fitted] = []
    for fitted in fits:
        if all(
            fitted.orders != other.orders or np.abs(fitted.instants - other.instants).max() > 2e-6
            for other in found
        ):
            found.append(fitted)
    return found
