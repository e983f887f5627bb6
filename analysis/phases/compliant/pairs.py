"""The reduction of chi2 by every pair of a contact and a release, from cumulative sums.

The products of a signal with all saw-teeth, each of which grows with the rise from its contact to
its release, follow from sums of the signal, and of its products with the rise, before each row.
"""

from dataclasses import dataclass

import numpy as np

from sautereau.analysis.phases.compliant.saw_teeth import SawTeeth, Solved
from sautereau.analysis.phases.expected import CLIMB_STD, CONTACT_STD, LEAST_CLIMB, Expected
from sautereau.trajectory.motion import Floats

LEAST_RISE = 0.25e-3  # m, least rise of the jack from contact to release
MOST_ROWS = 300  # Rows in which pairs are tried
SHORTEST = 3  # Least number of rows from a contact to its release
INDEPENDENT = 1e-2  # Least fraction of a saw-tooth's square that other columns do not explain
APART = 0.5  # Least distance of two releases, in widths of the smoothing
ANYWHERE = 0.1  # Weight of a pair that is far from all strings of the rig


@dataclass(frozen=True)
class Pairs:
    """Pairs of rows, of a contact and a release."""

    time: Floats
    """s after the trigger, of the rows, shape (n,)."""
    rise: Floats
    """m, of the jack, shape (n,)."""
    gain: Floats
    """Reduction of chi2 by each pair, weighted by its probability according to the rig; 0 where a
    pluck is impossible; shape (contacts, releases)."""


def pair_gains(fit: SawTeeth, found: Floats, solved: Solved) -> Pairs:
    """Return the reduction of chi2 by a further pluck.

    Args:
        found: s, contacts and releases of the plucks found, shape (plucks, 2).
    """
    slow, left = fit.slow, solved.row_residuals
    size = max(1, -(-len(left) // MOST_ROWS))
    n = len(left) // size

    def sums(column: Floats) -> Floats:
        return column[: n * size].reshape(n, size, *column.shape[1:]).sum(1)

    time, rise = sums(slow.time) / size, sums(fit.row_rise) / size
    of_load = _products(sums(fit.weight * left), rise)
    square = _squares(sums(fit.weight**2), rise)
    least = INDEPENDENT * square
    base = np.concatenate([fit.base[: len(left)], solved.base[: len(left)]], 1)
    _subtract_explained(square, sums(fit.weight[:, None] * base), rise[:, None])
    climbed = rise[None, :] - rise[:, None]
    later = np.arange(n)[None, :] > np.arange(n)[:, None] + SHORTEST
    possible = later & (climbed > LEAST_RISE) & (of_load > 0) & (square > least)
    possible &= time < time[-1] - slow.width
    for release in found[:, 1]:
        possible &= np.abs(time[None, :] - release) > APART * slow.width
    gain = np.where(possible, of_load**2 / np.where(possible, square, 1.0), 0.0)
    likely = _likely(fit.strings, rise, climbed)
    return Pairs(time, rise, gain * (ANYWHERE + (1 - ANYWHERE) * likely))


def _products(column: Floats, rise: Floats) -> Floats:
    """Return the products of a column, shape (n,), with every saw-tooth, shape (n, n)."""
    alone, risen = _before(column), _before(column * rise)
    return risen[None, :] - risen[:, None] - rise[:, None] * (alone[None, :] - alone[:, None])


def _squares(weight: Floats, rise: Floats) -> Floats:
    """Return the weighted sum of squares of every saw-tooth, shape (n, n)."""
    alone, squared, count = (_before(weight * rise**k) for k in (1, 2, 0))
    square = (
        squared[None, :] - squared[:, None] - 2 * rise[:, None] * (alone[None, :] - alone[:, None])
    )
    return square + rise[:, None] ** 2 * (count[None, :] - count[:, None])


def _subtract_explained(square: Floats, columns: Floats, rise: Floats) -> None:
    """Subtract what orthonormal columns explain of the squares, in place.

    That is the sum of the squares of `_products` over the columns, which is most of the work.

    Args:
        square: Shape (n, n).
        columns: Shape (n, columns).
        rise: m, shape (n, 1).
    """
    alone, risen = _before(columns), _before(columns * rise)
    own = risen - rise * alone
    square -= (own**2).sum(1)[:, None] - 2 * (own @ risen.T - rise * (own @ alone.T))
    square -= (risen**2).sum(1) - 2 * rise * (risen * alone).sum(1) + rise**2 * (alone**2).sum(1)


def _likely(strings: Expected, rise: Floats, climbed: Floats) -> Floats:
    """Return the relative probability (0 to 1) of each pair for the nearest string of the rig."""
    likely = np.zeros_like(climbed)
    for contact, climb in zip(strings.contacts, strings.climbs, strict=True):
        far = ((rise - contact)[:, None] / CONTACT_STD) ** 2
        far = far + (np.log(np.maximum(climbed, LEAST_CLIMB) / climb) / CLIMB_STD) ** 2
        likely = np.maximum(likely, np.exp(-far / 2))
    return likely


def _before(column: Floats) -> Floats:
    """Return the sums of all rows before each row."""
    return np.cumsum(column, axis=0) - column
