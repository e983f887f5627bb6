"""The release of a string on a compliant key: a sudden event in force and velocity."""

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from sautereau.analysis.phases.compliant.event_fit import EventFit, Fitted
from sautereau.analysis.phases.compliant.response import Orders
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.signals import FORCE_FLOOR, VELOCITY_FLOOR, Signals

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
