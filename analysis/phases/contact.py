"""When the string was met: the instant with the least misfit, and how sharp that is.

Over the instants the probability exp(-misfit / 2 noise) tells the mean and the standard
uncertainty; the noise is what the best fit leaves, by itself or held together.
"""

import math
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.phases.fit import KeyAndString, Misfits
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.stroke import Rows
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

ZOOMS, CLOSER = 3, 1.2
"""Times that the search closes in at most, and spacings of a grid beside its best instant."""
LEAST_BEND = 1e-12
"""1, of a misfit that does not bend."""
FINE = 3.0
"""Standard deviations between instants, below which a grid is fine enough for a last one."""
WIDE, EDGE = 4.5, 0.03
"""Standard deviations of the last grid, and the probability at its ends to its largest."""
FIRST_GRID, GRID = 31, 11
"""Instants of the first, fine enough not to miss the bend, and of all others."""


@dataclass(frozen=True)
class Contact:
    """A string met."""

    time: float
    """s from the trigger."""
    std: float
    """s, standard uncertainty."""
    gain: float
    """1, by which the misfit is less than that of a key that meets nothing."""
    at_release: float
    """N at the finger, of the string at the end of the fit."""


def find_contact(
    rig: Rig,
    rest: Rows,
    held: Rows,
    release: Release,
    common_std: float,
    before: tuple[float, float],
) -> Contact | None:
    """Find contact in the rows up to a release.

    Args:
        rig: The bench.
        rest: Of the key at rest before the press, where only hum is seen.
        held: Of the way down to shortly before the release, from the motion's beginning or
            from the release before.
        release: By which the load falls as far as the string has raised it.
        common_std: s, of what the rows do not show: sampling and the sensors' lag.
        before: Time [s] and rise [m] of the jack before which contact cannot be.

    Returns:
        None where there are too few rows.
    """
    if not len(held.time):
        return None
    fit = KeyAndString(rig, rest, held, release, before)
    low, high = before[0], float(held.time[-2])
    found, middle, std, noise = _sharpest(fit, low, high)
    reach = WIDE * std
    for _ in range(ZOOMS):
        times = np.linspace(max(low, middle - reach), min(high, middle + reach), GRID)
        found = fit.at(times, noise)
        noise = max(1.0, found.noise)
        chance = np.exp((found.misfit.min() - found.misfit) / (2 * noise))
        middle = float(times @ chance / chance.sum())
        std = math.sqrt(float((times - middle) ** 2 @ chance / chance.sum()))
        wider = max(chance[0] * (times[0] > low), chance[-1] * (times[-1] < high)) > EDGE
        if not wider and std > (times[1] - times[0]) / 2:
            break
        reach = min(high - low, 3 * reach) if wider else reach / 4
    best = int(np.argmin(found.misfit))
    gain = (fit.free(noise) - float(found.misfit[best])) / noise
    # Where both channels are off alike, so is contact.
    std = math.hypot(std, common_std)
    return Contact(middle, std, gain, float(found.at_release[best]))


def _sharpest(fit: KeyAndString, low: float, high: float) -> tuple[Misfits, float, float, float]:
    """Return the least misfit's grid, its instant [s], about how sharp it is [s], and the noise.

    A first grid leaves much of the string in what it calls noise, so none is believed before
    the grid is as fine as the instant is sharp.
    """
    times = np.linspace(low, high, FIRST_GRID)
    found = fit.at(times, 1.0)
    middle, std, noise = _vertex(times, found)
    for _ in range(ZOOMS):
        best, reach = int(np.argmin(found.misfit)), CLOSER * float(times[1] - times[0])
        times = np.linspace(max(low, times[best] - reach), min(high, times[best] + reach), GRID)
        found = fit.at(times, 1.0)
        middle, std, noise = _vertex(times, found)
        if times[1] - times[0] < FINE * std:
            break
    return found, middle, std, noise


def _vertex(times: Floats, found: Misfits) -> tuple[float, float, float]:
    """Return the least of the parabola about the best instant [s], how sharp it is, and the noise.

    Where the misfit is least at an end of the grid, it is the instant there.
    """
    best, spacing = int(np.argmin(found.misfit)), float(times[1] - times[0])
    inner = min(max(best, 1), len(times) - 2)
    before, at, after = found.misfit[inner - 1 : inner + 2].tolist()
    bend = max(before - 2 * at + after, LEAST_BEND)
    off = spacing * (before - after) / (2 * bend) if best == inner else 0.0
    noise = max(1.0, found.noise)
    return float(times[best]) + off, spacing * math.sqrt(2 * noise / bend), noise
