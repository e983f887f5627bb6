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
from sautereau.analysis.phases.response import Orders, Poles, Response, curves, pole
from sautereau.analysis.phases.signals import FORCE_FLOOR, VELOCITY_FLOOR, Signals
from sautereau.trajectory.motion import Floats

FREQUENCIES = np.geomspace(120.0, 5000.0, 16)
"""Hz, of the table of modes with which a search starts."""
DAMPINGS = (0.02, 0.1, 0.4)  # Damping ratios of this table
HIGHEST = 0.35  # Largest frequency of the table over the rate of the blocks
HIGHEST_REFINED = 0.45  # Largest frequency of a refined mode over the rate of the blocks
LOWEST = 50.0  # Hz, smallest frequency of a refined mode
LEAST_DAMPING = 0.003  # Smallest damping ratio of a refined mode
LARGEST_DAMPING = 0.9  # Largest damping ratio of a refined mode
POLYNOMIAL_STD = 1e3  # Prior standard deviation of the polynomial, over the range of a signal
BEFORE_STD = 0.5  # The same of the ringing that started before the event
RING_STD = 1.5  # The same of the modes that the event excites
CURVE_STD = 30.0  # The same of the curve from the event on
LONGEST = 1e-3, 0.3, 0.7
"""Longest step of a search: of instants in s, of the logarithms of frequency and damping."""
CONVERGED = 1e-3  # Relative decrease of chi2 at which a search ends
RIDGE = 1e-9  # Added to the normal equations, for columns that no sample determines
TINY = 1e-9  # Smallest range of a signal, in its unit
UNMODELLED = 0.03  # Noise over the range of a signal, before there are residuals
BLOCK = 8
"""Rows over which residuals are summed in order to detect correlated ones. Also the fewest rows
whose noise is estimated by itself."""
LATE = 1e-3, 1.75e-3
"""s after the event, from which on rows have a noise of their own: there the jack may have left its
cloth, and the modes differ."""


BEFORE = 4e-3  # s, of signal before a release that is part of its fit
AFTER = 2.5e-3  # s, of signal after a release that is part of its fit
SHORT = 1e-3
"""s, the same where modes do not explain this, as the release throws the jack off its cloth."""
EXCESS = 100.0  # `EventFit.excess` above which `SHORT` is tried
EXCESS_FACTOR = 3.0  # Least factor by which it must reduce the excess
ROW = 40e-6  # s, shortest block of this fit
MOST_MODES = 3  # Largest number of modes of a fit
FALL_STD = 0.1  # Relative standard uncertainty of the fall of the load
LEAST_ROWS = 24  # Fewest blocks of a fit
LARGEST_VARIANCE = 1e-6
"""s^2, upper bound of the variance of an instant. Undetermined modes make it infinite."""
LARGER = 2.5
"""Standard uncertainty of an instant over that of its fit, in which modes are missing. From presses
of the independent simulator; tested on others."""
REACH = 3.0  # Instants are tried up to this number of standard deviations on either side
TRIED = 20  # Number of instants that are tried
DEGREES = 2, 4
"""Degrees of the polynomial that continues from before the release. The motion before it is a part
of slow modes of finger and key, which the polynomial only approximates; the better fit need not
have the better instant, so the instants of both are averaged."""
STARTS = 4
"""Parts of the range of instants; a search starts from the best instant of each part. Also the
largest number of fits, of both beginnings together, to which a further mode is added."""
BEGINS: tuple[Orders, ...] = ((2,), (2, 1))
"""Powers of time with which force and velocity may begin: t^2, or the velocity with t, as on a key
whose jack stands on a hard cloth."""
SAME = 2e-6  # s, difference up to which two instants count as equal
UNLIKELY = 25.0
"""Difference of the Bayesian information criterion from the best, above which a fit is ignored."""


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
        for start in np.searchsorted(at, LATE):
            if start - starts[-1] >= BLOCK and n - start >= BLOCK:
                starts.append(int(start))
        self._parts = [slice(*ends) for ends in pairwise([*starts, n])]
        load = np.stack([means(signals.force), means(signals.velocity)])
        flags = np.stack([means(f.astype(float)) for f in (signals.no_force, signals.no_velocity)])
        scale = np.maximum(np.ptp(load, axis=1, keepdims=True), TINY)
        noise = np.array([[signals.force_noise], [signals.velocity_noise]]) / math.sqrt(samples)
        self._load, self._white, self._good = load / scale, noise / scale, flags == 0
        if signals.missing:
            self._good[("force", "velocity").index(signals.missing)] = False
        self._table: Poles = np.array(
            [
                pole(frequency, damping)
                for frequency in FREQUENCIES
                if frequency < HIGHEST / self._response.step
                for damping in DAMPINGS
            ]
        )
        self._set_noise(np.maximum(self._white, UNMODELLED))

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

        Rows from `LATE` on do not count.
        """
        return float(self._variances.max())

    @property
    def excess(self) -> float:
        """Twice the logarithm of the likelihood that is lost to residuals above the white noise."""
        return float(self._good[:, self._parts[0]].sum(1) @ np.log(self._variances))

    @property
    def _variances(self) -> Floats:
        """Variances of the residuals before `LATE` over those of the white noise, shape (2,)."""
        return (self._noise[:, 0] / self._white[:, 0]) ** 2

    def scan(self, instants: Floats, poles: Poles, orders: Orders) -> tuple[Floats, Poles]:
        """Return chi2 and the best further pole of the table [1/s].

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
        modes = self._columns(instants[:, :1], self._table, orders)[..., curve:]
        modes = self._weight[..., None] * modes
        a, b = np.split(modes, 2, axis=-1)
        of_a, of_b = np.split((residuals[..., None, :n] @ modes)[..., 0, :], 2, axis=-1)
        known = base[..., :n, :].swapaxes(-1, -2) @ modes
        in_a, in_b = np.split(known, 2, axis=-1)
        aa, bb, ab = (
            np.einsum("...nm,...nm->...m", *both) - np.einsum("...nm,...nm->...m", *of) + RIDGE
            for both, of in (((a, a), (in_a, in_a)), ((b, b), (in_b, in_b)), ((a, b), (in_a, in_b)))
        )
        gain = (bb * of_a**2 - 2 * ab * of_a * of_b + aa * of_b**2) / np.maximum(
            aa * bb - ab**2, 1e-6 * aa * bb
        )
        gain = gain.sum(1)
        far = ((instants - self.expected) / self._stds) ** 2
        chi2 = (residuals**2).sum((1, 2)) + far.sum(1) - gain.max(1)
        return chi2, self._table[np.argmax(gain, 1)]

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
        highest = 2 * math.pi * HIGHEST_REFINED / self._response.step
        low = np.repeat(np.log([2 * math.pi * LOWEST, LEAST_DAMPING]), modes)
        high = np.repeat(np.log([highest, LARGEST_DAMPING]), modes)

        def evaluate(states: Floats) -> tuple[Floats, ...]:
            instants, poles = self._split(states)
            left, factors, base = self._solved(instants, poles, orders)
            far = (instants - self.expected) / self._stds
            return np.concatenate([left.reshape(len(left), -1), far], 1), left, factors, base

        def bounded(states: Floats) -> Floats:
            return np.concatenate([states[:, :events], np.clip(states[:, events:], low, high)], 1)

        longest = np.repeat(LONGEST, [events, modes, modes])
        slopes, always = partial(self._slopes, orders), np.ones(1, dtype=bool)
        found = minimise(states, evaluate, slopes, lambda *_: always, bounded, longest, CONVERGED)
        _, residuals, factors, _ = found.found
        diagonal = np.diagonal(found.normal, axis1=1, axis2=2) * RIDGE + RIDGE
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
    """Return the rows of the priors of linear factors, shape (columns, columns)."""
    of_event = np.repeat([CURVE_STD, RING_STD], [curves, 2 * modes])
    of_before = np.repeat([POLYNOMIAL_STD, BEFORE_STD], [degree + 1, 2 * modes])
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

    Where modes do not explain them, and no other string rings, fewer samples after the release are
    fitted if they are explained much better. The search has the first of the `DEGREES`, and its
    fits are refined with each other one. The instant is the mean over the degrees; their spread is
    part of its uncertainty.

    Args:
        near: s after the trigger, approximate instant.
        std: s, its standard uncertainty.
        force: N at the finger, by which the load falls.
        after: s after the trigger, before which nothing is used.
        until: s after the trigger, after which nothing is used.
        others: s after the trigger, approximate instants of other releases.
    """
    begin, samples = max(after, near - BEFORE), max(1, round(ROW * signals.rate))
    window, short = ((begin, min(until, near + side)) for side in (AFTER, SHORT))

    def fit_of(window: tuple[float, float], degree: int) -> EventFit | None:
        begin, end = window
        stretch = max(0, signals.sample(begin)), min(len(signals.time), signals.sample(end))
        if (stretch[1] - stretch[0]) // samples < LEAST_ROWS:
            return None
        events = np.array([near, *(t for t in others if begin < t < end)])
        return EventFit(signals, stretch, samples, events, np.full(len(events), std), degree)

    lowest, *higher = DEGREES
    fit = fit_of(window, lowest)
    if fit is None:
        return Release(near, std, force, FALL_STD * force, 0.0, 0.0, math.inf)
    fits = _search(fit, std)
    if fit.excess >= EXCESS and not others and (sooner := fit_of(short, lowest)):
        found = _search(sooner, std)
        if EXCESS_FACTOR * sooner.excess < fit.excess:
            fit, fits, window = sooner, found, short
    each = [_mean(fit, fits)]
    for again in filter(None, (fit_of(window, degree) for degree in higher)):
        again.weigh_as(fit)
        refined = _refined(again, fits)
        again.weigh(min(refined, key=again.chi2))
        each.append(_mean(again, refined))
    times, variances = np.array(each).T
    stds = np.hypot(LARGER * np.sqrt(variances), signals.instant_std)
    return Release(
        time=near + float(times.mean()),
        std=math.hypot(float(stds.mean()), float(times.std())),
        fall=force,
        fall_std=FALL_STD * force,
        slowed=0.0,
        gain=0.0,
        noise=fit.noise,
    )


def _search(fit: EventFit, std: float) -> list[Fitted]:
    """Return the fits of a search, after which the noise is that of the best of them.

    Chi2 has several minima, so searches start from several instants. Each search adds one mode
    after the other: it selects the mode of a table that reduces the residuals most, and then
    refines all modes. Those that the mode makes best are continued.
    """
    tried = np.tile(fit.expected, (TRIED, 1))
    tried[:, 0] = np.linspace(-REACH, REACH, TRIED) * std
    chains: list[Fitted] = []
    for orders in BEGINS:
        chi2, poles = fit.scan(tried, np.zeros(0, complex), orders)
        best = [part[np.argmin(chi2[part])] for part in np.array_split(np.arange(TRIED), STARTS)]
        chains += _distinct(fit.refine([(tried[i], poles[i : i + 1]) for i in best], orders))
    fits = [*chains]
    for _ in range(MOST_MODES - 1):
        fit.weigh(min(chains, key=fit.chi2))
        further = [(f, *fit.scan(f.instants[None], f.poles, f.orders)) for f in chains]
        further.sort(key=lambda each: each[1][0] + fit.penalty(each[0]))
        chains = _distinct(
            _refined(fit, [replace(f, poles=np.append(f.poles, p)) for f, _, p in further[:STARTS]])
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
    least = min(map(fit.score, fits)) + UNLIKELY
    fits = _refined(fit, (f for f in sorted(fits, key=fit.score) if fit.score(f) < least))
    scores = np.array([fit.score(f) for f in fits])
    chance = np.exp((scores.min() - scores) / 2)
    chance /= chance.sum()
    times = np.array([f.instants[0] for f in fits])
    mean = float(times @ chance)
    spread = np.minimum([f.variance for f in fits], LARGEST_VARIANCE)
    return mean, float(chance @ ((times - mean) ** 2 + spread))


def resolved(signals: Signals, near: float) -> bool:
    """Return whether small residuals of a release near a time [s] can be caused by modes.

    They have other causes where a signal is missing or interpolated, where the noise is below its
    floor (errors of the model), and where samples are longer than a block (filter of the
    converter).
    """
    around = slice(max(0, signals.sample(near - BEFORE)), signals.sample(near + AFTER))
    return (
        signals.missing is None
        and signals.rate * ROW >= 1
        and signals.force_noise > FORCE_FLOOR
        and signals.velocity_noise > VELOCITY_FLOOR
        and not (signals.no_force[around] | signals.no_velocity[around]).any()
    )


def _distinct(fits: list[Fitted]) -> list[Fitted]:
    """Return the fits without repetitions: same orders and same instants."""
    found: list[Fitted] = []
    for fitted in fits:
        if all(
            fitted.orders != other.orders or np.abs(fitted.instants - other.instants).max() > SAME
            for other in found
        ):
            found.append(fitted)
    return found
