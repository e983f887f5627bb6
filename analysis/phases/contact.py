"""The instant of contact with the string, and its uncertainty.

Each candidate instant has the probability exp(-chi2 / 2 noise); the mean and the standard deviation
over the candidates are the estimate and its uncertainty. The noise is the variance of the residuals
of the best fit, including their correlation.
"""

import math
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.phases.expected import Expected
from sautereau.analysis.phases.fit import ContactFits, KeyAndString
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.rows import Rows
from sautereau.trajectory.motion import Floats

ZOOMS = 3
"""Largest number of refinements of a grid."""
CLOSER = 1.2
"""Half-width of a refined grid in spacings of the grid before."""
LEAST_CURVATURE = 1e-12
"""Smallest curvature of chi2; it replaces smaller and negative values."""
FINE = 3.0
"""A grid with a spacing below this number of standard deviations is not refined further."""
WIDE = 4.5
"""Half-width of the last grid in standard deviations."""
EDGE = 0.03
"""Largest probability at an end of the last grid, over that of the best instant."""
FIRST_GRID = 31
"""Instants of the first grid; enough to resolve the bend at the contact."""
GRID = 11
"""Instants of all other grids."""


@dataclass(frozen=True)
class Contact:
    """The contact of a plectrum with its string."""

    time: float
    """s after the trigger."""
    std: float
    """s, standard uncertainty."""
    gain: float
    """Dimensionless, reduction of chi2 compared with a key without a string."""
    at_release: float
    """N at the finger, force of the string at the end of the fit."""
    noise: float
    """Dimensionless, variance of the residuals over the assumed noise, at least 1."""
    residual: float = 0.0
    """N, rms of the load that a rigid key and its string leave until the release."""
    exchange_std: float = 0.0
    """s, part of `std`: the contact may belong to the release of another string held at once."""


def find_contact(
    strings: Expected,
    rest: Rows,
    held: Rows,
    release: Release,
    common_std: float,
    before: tuple[float, float],
) -> Contact | None:
    """Find the contact before a release.

    Args:
        rest: Of the key at rest before the press, where the only signal is hum.
        held: Of the way down until shortly before the release, from the start of the motion or
            from the previous release.
        release: At which the load falls by the force of the string.
        common_std: s, uncertainty that the rows do not contain: sampling and delay of the sensors.
        before: Time [s] and rise [m] of the jack before which contact is impossible.

    Returns:
        The contact; None where there are too few rows.
    """
    if not len(held.time):
        return None
    fit = KeyAndString(strings, rest, held, release, before)
    low, high = before[0], float(held.time[-2])
    found, middle, std, noise = _sharpest(fit, low, high)
    reach = WIDE * std
    for _ in range(ZOOMS):
        times = np.linspace(max(low, middle - reach), min(high, middle + reach), GRID)
        found = fit.at(times, noise)
        noise = max(1.0, found.noise)
        score = found.chi2 / noise
        chance = np.exp((score.min() - score) / 2)
        middle = float(times @ chance / chance.sum())
        std = math.sqrt(float((times - middle) ** 2 @ chance / chance.sum()))
        wider = max(chance[0] * (times[0] > low), chance[-1] * (times[-1] < high)) > EDGE
        if not wider and std > (times[1] - times[0]) / 2:
            break
        reach = min(high - low, 3 * reach) if wider else reach / 4
    best = int(np.argmin(found.chi2))
    gain = (fit.free(noise) - float(found.chi2[best])) / noise
    # A common delay of both channels shifts the contact as well.
    std = math.hypot(std, common_std)
    return Contact(middle, std, gain, float(found.at_release[best]), noise, found.residual)


def _sharpest(
    fit: KeyAndString, low: float, high: float
) -> tuple[ContactFits, float, float, float]:
    """Return the fits around the best instant, the instant [s], its uncertainty [s], the noise.

    On a coarse grid the residuals still contain much of the string's force, so the noise is used
    only once the spacing is comparable with the uncertainty.
    """
    times = np.linspace(low, high, FIRST_GRID)
    found = fit.at(times, 1.0)
    middle, std, noise = _vertex(times, found)
    for _ in range(ZOOMS):
        best, reach = int(np.argmin(found.chi2)), CLOSER * float(times[1] - times[0])
        times = np.linspace(max(low, times[best] - reach), min(high, times[best] + reach), GRID)
        found = fit.at(times, 1.0)
        middle, std, noise = _vertex(times, found)
        if times[1] - times[0] < FINE * std:
            break
    return found, middle, std, noise


def _vertex(times: Floats, found: ContactFits) -> tuple[float, float, float]:
    """Return the vertex of the parabola around the best instant [s], its uncertainty, the noise.

    Where chi2 is smallest at an end of the grid, the vertex is that end.
    """
    best, spacing = int(np.argmin(found.chi2)), float(times[1] - times[0])
    inner = min(max(best, 1), len(times) - 2)
    before, at, after = found.chi2[inner - 1 : inner + 2].tolist()
    curvature = max(before - 2 * at + after, LEAST_CURVATURE)
    off = spacing * (before - after) / (2 * curvature) if best == inner else 0.0
    noise = max(1.0, found.noise)
    return float(times[best]) + off, spacing * math.sqrt(2 * noise / curvature), noise
