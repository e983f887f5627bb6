"""The release of a string on a compliant key: a sudden event in force and velocity."""

import math
from collections.abc import Sequence

import numpy as np

from sautereau.analysis.phases.event_fit import EventFit, Fitted
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.response import Orders
from sautereau.analysis.phases.signals import FORCE_FLOOR, VELOCITY_FLOOR, Signals
from sautereau.trajectory.motion import Floats

BEFORE, AFTER = 4e-3, 2.5e-3
"""s, before and after a release, of the samples to which its instant is fitted."""
ROW = 40e-6
"""s, shortest block of this fit."""
MOST_MODES, FALL_STD = 3, 0.1
"""Modes of a fit, and relative uncertainty of the fall."""
LEAST_ROWS = 24
"""Fewest blocks of a fit."""
LARGEST_VARIANCE = 1e-6
"""s^2, of the instant of one fit; of a mode that nothing determines it is infinite."""
LARGER = 2.5
"""Standard uncertainty of an instant over that of its fit, as modes are missing from the fit; from
presses of the independent simulator, and tested on others."""
REACH, TRIED, STARTS = 3.0, 20, 4
"""Standard deviations up to which instants are tried; their number; and that of parts of this
range, in each of which a search starts from the best one."""
SMOOTH: Orders = (2,)
SUDDEN: Orders = (2, 1)
"""Powers of time with which force and velocity begin: both of any key; and of one that hardly
bends, whose jack stands on a hard cloth."""
SAME, UNLIKELY = 2e-6, 25.0
"""s, difference of equal instants; and of twice the logarithm of a probability that is ignored."""


def refine_event(
    signals: Signals,
    near: float,
    std: float,
    force: float,
    after: float,
    until: float,
    others: Sequence[float] = (),
    begins: Sequence[Orders] = (SMOOTH,),
) -> Release:
    """Return the instant of a release, fitted to the samples around it.

    Searches start from several instants, as chi2 has several minima. Their modes are found one
    after the other: the one of a table that reduces the residuals most is added, and all are
    refined. The instants of all fits are averaged with the weights of the Bayesian information
    criterion.

    Args:
        signals: Of the press.
        near: s after the trigger, approximate instant.
        std: s, its standard uncertainty.
        force: N at the finger, by which the load falls.
        after: s after the trigger, before which nothing is used.
        until: s after the trigger, after which nothing is used.
        others: s after the trigger, approximate instants of other releases.
        begins: Powers of time with which the signals may begin.
    """
    samples = max(1, round(ROW * signals.rate))
    begin, end = max(after, near - BEFORE), min(until, near + AFTER)
    stretch = max(0, signals.sample(begin)), min(len(signals.time), signals.sample(end))
    if (stretch[1] - stretch[0]) // samples < LEAST_ROWS:
        return Release(near, std, force, FALL_STD * force, 0.0, 0.0, 1.0)
    events = np.array([near, *(t for t in others if begin < t < end)])
    fit = EventFit(signals, stretch, samples, events, np.full(len(events), std))
    tried = np.tile(events - near, (TRIED, 1))
    tried[:, 0] = np.linspace(-REACH, REACH, TRIED) * std
    chains: list[Fitted] = []
    for orders in begins:
        chi2, poles = fit.scan(tried, np.zeros(0, complex), orders)
        best = [part[np.argmin(chi2[part])] for part in np.array_split(np.arange(TRIED), STARTS)]
        chains += _different([fit.refine(tried[i], poles[i : i + 1], orders) for i in best])
    fits = [*chains]
    for _ in range(MOST_MODES - 1):
        fit.weigh(min(chains, key=fit.chi2))
        further = [fit.scan(f.instants[None], f.poles, f.orders)[1] for f in chains]
        pairs = zip(chains, further, strict=True)
        chains = _different(
            [fit.refine(f.instants, np.append(f.poles, p), f.orders) for f, p in pairs]
        )
        fits += chains
    fit.weigh(min(chains, key=fit.chi2))

    def scores() -> Floats:
        return np.array([fit.chi2(f) + f.parameters * math.log(fit.load.size) for f in fits])

    score = scores()
    fits = [
        fit.refine(fits[i].instants, fits[i].poles, fits[i].orders)
        for i in np.argsort(score)
        if score[i] < score.min() + UNLIKELY
    ]
    score = scores()
    chance = np.exp((score.min() - score) / 2)
    chance /= chance.sum()
    times = np.array([f.instants[0] for f in fits])
    mean = float(times @ chance)
    spread = np.minimum([f.variance for f in fits], LARGEST_VARIANCE)
    variance = float(chance @ ((times - mean) ** 2 + spread))
    return Release(
        time=near + mean,
        std=math.hypot(LARGER * math.sqrt(variance), signals.instant_std),
        fall=force,
        fall_std=FALL_STD * force,
        slowed=0.0,
        gain=0.0,
        noise=fit.noise,
    )


def resolved(signals: Signals, near: float) -> bool:
    """Return whether small residuals of a release near a time [s] show modes.

    They do not where a signal is missing or interpolated; where the noise is below its floor, so
    that they are errors of the model; nor where samples are longer than a block, so that they are
    the converter's filter.
    """
    around = slice(max(0, signals.sample(near - BEFORE)), signals.sample(near + AFTER))
    return (
        signals.missing is None
        and signals.rate * ROW >= 1
        and signals.force_noise > FORCE_FLOOR
        and signals.velocity_noise > VELOCITY_FLOOR
        and not (signals.no_force[around] | signals.no_velocity[around]).any()
    )


def _different(fits: list[Fitted]) -> list[Fitted]:
    """Return fits without those that begin alike and end at the same instants."""
    found: list[Fitted] = []
    for fitted in fits:
        if all(
            fitted.orders != other.orders or np.abs(fitted.instants - other.instants).max() > SAME
            for other in found
        ):
            found.append(fitted)
    return found
