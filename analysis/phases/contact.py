"""The instant of contact with the string, and its uncertainty.

Each candidate instant has the probability exp(-chi2 / 2 noise); the mean and the standard deviation
over the candidates are the estimate and its uncertainty. The noise is the variance of the residuals
of the best fit, including their correlation.
"""

import math
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.phases.expected import Expected
from sautereau.analysis.phases.fit import KeyAndString
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.rows import Rows
from sautereau.trajectory.motion import Floats

ZOOMS = 6  # Largest number of refinements of a grid
CLOSER = 0.6  # Half-width of the second grid in spacings of the first
LEAST_CURVATURE = 1e-12  # Smallest curvature of chi2; it replaces smaller and negative values
WIDE = 4.5  # Half-width of the last grid in standard deviations
EDGE = 0.01  # Largest probability at an end of the last grid, over that of the best instant
COARSE = 0.65  # Least standard deviation over the spacing of the last grid
FREEDOM = 23.0
"""Degrees of freedom of the noise of sums over blocks (`fit.BLOCKS`), to which a wrong contact adds
its chi2."""
SAME = 0.1  # Largest relative change of the noise in the last grid
FIRST_GRID = 21  # Instants of the first grid; enough to resolve the bend at the contact
GRID = 11  # Instants of all other grids


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
    exchange_force: float = 0.0
    """N, half the difference of the force drops of this pluck if it does."""
    exchange_odds: float = 0.0
    """Logarithm of the likelihood of the load if it does, over that if it does not."""
    inertia: float = 0.0
    """Relative error of the rig's inertia."""


def find_contact(
    strings: Expected,
    rest: Rows,
    held: Rows,
    release: Release,
    common_std: float,
    before: tuple[float, float],
    struck: bool = False,
) -> Contact | None:
    """Find the contact before a release.

    Args:
        rest: Of the key at rest before the press, where the only signal is hum.
        held: Of the way down until shortly before the release, from the start of the motion or
            from the previous release.
        release: At which the load falls by the force of the string.
        common_std: s, uncertainty that the rows do not contain: sampling and delay of the sensors.
        before: Time [s] and rise [m] of the jack before which contact is impossible.
        struck: Whether the load has a peak at contact.

    Returns:
        The contact; None where there are too few rows.
    """
    if not len(held.time):
        return None
    fit = KeyAndString(strings, rest, held, release, before, struck)
    low, high = before[0], float(held.time[-2])
    times, noise = np.linspace(low, high, FIRST_GRID), 1.0
    found = fit.at(times, noise)
    middle, std, _ = _vertex(times, found.chi2)
    reach = CLOSER * float(times[1] - times[0])
    for _ in range(ZOOMS):
        times = np.linspace(max(low, middle - reach), min(high, middle + reach), GRID)
        found = fit.at(times, noise)
        assumed, noise = noise, max(1.0, found.noise)
        score = found.chi2 / noise
        chance = np.exp((score.min() - score) / 2)
        middle = float(times @ chance / chance.sum())
        std = math.sqrt(float((times - middle) ** 2 @ chance / chance.sum()))
        if max(chance[0] * (times[0] > low), chance[-1] * (times[-1] < high)) > EDGE:
            reach = min(high - low, 3 * reach)
            continue
        if std < COARSE * float(times[1] - times[0]):
            middle, std, lowest = _vertex(times, score)
            noise = max(1.0, noise * (1 - (float(score.min()) - lowest) / FREEDOM))
        elif abs(noise / assumed - 1) < SAME:
            break
        reach = WIDE * std
    best = int(np.argmin(found.chi2))
    gain = (fit.free(noise) - float(found.chi2[best])) / noise
    # A common delay of both channels shifts the contact as well.
    std = math.hypot(std, common_std)
    force = float(found.at_release[best])
    return Contact(middle, std, gain, force, noise, found.residual, inertia=found.inertia)


def _vertex(times: Floats, score: Floats) -> tuple[float, float, float]:
    """Return the vertex of the parabola around the best instant [s], its uncertainty, its score.

    Where the score, chi2 over the noise, is smallest at an end of the grid, the vertex is that end.
    """
    best, spacing = int(np.argmin(score)), float(times[1] - times[0])
    inner = min(max(best, 1), len(times) - 2)
    before, at, after = score[inner - 1 : inner + 2].tolist()
    curvature = max(before - 2 * at + after, LEAST_CURVATURE)
    off = (before - after) / (2 * curvature) if best == inner else 0.0
    lowest = float(score[best]) - curvature * off**2 / 2
    return float(times[best]) + spacing * off, spacing * math.sqrt(2 / curvature), lowest
