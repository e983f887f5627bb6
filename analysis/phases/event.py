"""The release of a string on a compliant key: a sudden change of the load, of any shape."""

import math

import numpy as np

from sautereau.analysis.phases.event_fit import LEAST_GAIN, EventFit
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.response import Poles
from sautereau.analysis.phases.signals import Signals, rows_of

BEFORE, AFTER = 4e-3, 2.5e-3
"""s, before and after a fall, of the samples to which its instant is fitted."""
ROW = 40e-6
"""s, shortest row of this fit."""
MOST_MODES, FALL_STD = 3, 0.1
"""Modes of a fit, and relative uncertainty of the fall."""
LEAST_ROWS = 24
"""Fewest rows of a fit."""
LARGEST_VARIANCE = 1e-6
"""s^2, of the instant of one fit; of a mode that nothing determines it is infinite."""
DISAGREEMENT = 0.5
"""Standard uncertainty over the distance from the approximate instant."""
BLOCK = 8
"""Rows whose residuals are summed in order to detect correlated noise."""
REACH, TRIED = 2e-3, 33
"""s, largest error of a candidate, and instants tried."""


def refine_event(
    signals: Signals, near: float, std: float, force: float, after: float, until: float
) -> Release:
    """Return the instant of a fall, fitted to the samples around it.

    Args:
        signals: Of the press.
        near: s after the trigger, approximate instant.
        std: s, its standard uncertainty.
        force: N at the finger, by which the load falls.
        after: s after the trigger, before which nothing is used.
        until: s after the trigger, after which nothing is used.
    """
    samples = max(1, round(ROW * signals.rate))
    first, last = (signals.sample(t) for t in (max(after, near - BEFORE), min(until, near + AFTER)))
    first, last = max(0, first), min(len(signals.time), last)
    rows = rows_of(signals, first, last, samples)
    if len(rows.time) < LEAST_ROWS:
        return Release(near, std, force, FALL_STD * force, 0.0, 0.0, 1.0)
    fit = EventFit(rows, near, samples)
    instants, none = np.linspace(-REACH, REACH, TRIED), np.zeros(0, complex)
    prior = (instants / std) ** 2

    def sharpest(poles: Poles, noise: float) -> float:
        chi2, _ = fit.scan(instants, np.zeros(0), poles)
        return float(instants[np.argmin(chi2 / noise + prior)])

    best = fit.refine(np.array([sharpest(none, 1.0)]), none)
    n, fits = len(rows.time), [best]
    for _ in range(MOST_MODES):
        pole, _ = fit.another(best)
        poles = np.append(best.poles, pole)
        noise = max(1.0, best.chi2 / n)
        starts = {best.instant, sharpest(poles, noise)}
        trials = [fit.refine(np.array([start]), poles) for start in starts]
        gained = best.chi2
        best = min(trials, key=lambda f: f.chi2 / noise + (f.instant / std) ** 2)
        gained -= best.chi2
        fits.append(best)
        if gained < LEAST_GAIN * max(1.0, best.chi2 / n):
            break
    for f in fits[1:][-2:]:
        fits.append(fit.refine(f.instants, f.poles, True))
    left = min(fits, key=lambda f: f.chi2).left
    sums = left[: n // BLOCK * BLOCK].reshape(-1, BLOCK).sum(1)
    noise = max(1.0, float(left @ left) / n, float(sums @ sums) / BLOCK / len(sums))
    score = np.array(
        [f.chi2 / noise + f.parameters * math.log(n) + (f.instant / std) ** 2 for f in fits]
    )
    chance = np.exp((score.min() - score) / 2)
    chance /= chance.sum()
    times = np.array([f.instant for f in fits])
    best = fits[int(np.argmin(score))]
    mean = float(times @ chance)
    spread = np.minimum([f.variance for f in fits], LARGEST_VARIANCE)
    variance = float(chance @ ((times - mean) ** 2 + noise * spread))
    return Release(
        time=near + mean,
        std=math.hypot(math.sqrt(variance), signals.instant_std, DISAGREEMENT * mean),
        fall=force,
        fall_std=FALL_STD * force,
        slowed=0.0,
        gain=0.0,
        noise=noise,
    )
