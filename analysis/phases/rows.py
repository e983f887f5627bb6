"""The load on the key: the finger force minus inertia, in rows with known noise.

The finger force F at its arm p accelerates the key's inertia I against the load s of all other
forces: s p = F p - I a''. With the vibrometer's velocity v = l a', s is the derivative of the
integral Q = int F dt - I v / (l p). Differences of its means over blocks of samples are s with a
triangular weight. This needs no derivative of the velocity, and the noise is known: white from the
force, differenced white noise from the velocity.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import get_lapack_funcs

from sautereau.analysis.phases.signals import Signals
from sautereau.trajectory.motion import Floats

BRIDGED = 0.03  # N, noise of a row with flagged velocity
FACTOR, SOLVE = get_lapack_funcs(("pbtrf", "tbtrs"))
"""LAPACK's Cholesky factorisation of a banded matrix, and the triangular solve."""


@dataclass(frozen=True)
class Rows:
    """The load on the key over time; arrays of shape (n,)."""

    time: Floats
    """s after the trigger."""
    step: float
    """s, from row to row."""
    load: Floats
    """N at the finger."""
    inertia: Floats
    """N, subtracted inertia."""
    variance: Floats
    """N^2, of each row's load."""
    covariance: Floats
    """N^2, with the next row's; shape (n - 1,)."""
    rise: Floats
    """m, of the jack."""
    speed: Floats
    """m/s, of the jack."""

    def whitener(self) -> "Whitener":
        """Return the transformation of this noise to white noise of variance 1."""
        return Whitener(self.variance, self.covariance)


_NONE = np.zeros(0)
NO_ROWS = Rows(_NONE, 0.0, *[_NONE] * 6)  # Rows without samples


class Whitener:
    """Maps columns whose noise has a tridiagonal covariance to columns with white noise."""

    def __init__(self, variance: Floats, covariance: Floats):
        band = np.zeros((2, len(variance)))
        band[0], band[1, :-1] = variance, covariance
        self._factor, _ = FACTOR(band, lower=1)

    def __call__(self, columns: Floats, first: int = 0) -> Floats:
        """Return columns, shape (n - first,) or (n - first, k), in units of their noise.

        They start with a row before which they are 0.
        """
        found, _ = SOLVE(self._factor[:, first:], columns, uplo="L")
        return found

    def undone(self, white: Floats) -> Floats:
        """Return a column, shape (n,), from one in units of its noise."""
        found = self._factor[0] * white
        found[1:] += self._factor[1, :-1] * white[:-1]
        return found


def rows_of(
    signals: Signals, first: int, last: int, n: int | None = None, *, most: int = 800
) -> Rows:
    """Return the load over samples first to last - 1, one row for every n samples.

    By default there are at most ``most`` rows, each at least `PhaseSettings.row` long.
    """
    rate = signals.rate
    n = max(1, -(-(last - first) // most), round(signals.settings.row * rate)) if n is None else n
    blocks = (last - first) // n
    if blocks < 8:  # too few for a fit
        return NO_ROWS
    last = first + blocks * n
    weights, sides = _weights(n)

    def means(signal: Floats) -> Floats:
        return signal[first:last].reshape(blocks, n) @ weights

    def at_rows(signal: Floats) -> Floats:
        each = means(signal)
        return (each[1:] + each[:-1]) / 2

    step = n / rate
    no_force, no_velocity = (
        at_rows(flags.astype(float)) > 0 if flags[first:last].any() else np.zeros(blocks - 1, bool)
        for flags in (signals.no_force, signals.no_velocity)
    )
    moved = means(signals.velocity)
    inertia = (moved[1:] - moved[:-1]) * (signals.inertial / step)
    # Difference of block means of a running sum: late samples of a block, early ones of the next.
    parts = signals.force[first:last].reshape(blocks, n) @ sides
    load = (parts[:-1, 0] + parts[1:, 1]) / n - inertia
    if no_velocity.any() and not no_velocity.all():
        # Lines between means over 0.5 ms on either side.
        good, place, width = ~no_velocity, np.arange(blocks - 1), max(1, round(0.5e-3 / step))
        kernel = np.ones(2 * width + 1)
        count = np.convolve(good, kernel)[width:-width]
        around = np.convolve(inertia * good, kernel)[width:-width] / np.maximum(count, 1)
        bridged = np.where(good, inertia, np.interp(place, place[good], around[good]))
        load, inertia = load + inertia - bridged, bridged
    # Sums of the squared weights of a row, late / n and (1 - late) / n, and of those it shares.
    of_force = signals.force_noise**2 / n
    of_velocity = (signals.inertial * signals.velocity_noise / step) ** 2 / n
    # An interpolated velocity adds the error of the interpolation instead of its noise.
    variance = of_force * (2 / 3 - 1 / (6 * n**2))
    variance = variance + np.where(no_velocity, BRIDGED**2, 2 * of_velocity)
    shared = of_force * (1 / 6 + 1 / (12 * n**2)) - of_velocity
    alone = no_force | no_velocity
    return Rows(
        time=signals.time[first] + (np.arange(1, blocks) * n - 0.5) / rate,
        step=step,
        load=load,
        inertia=inertia,
        variance=variance + 100.0 * no_force,  # of no weight
        covariance=np.where(alone[1:] | alone[:-1], 0.0, shared),
        rise=at_rows(signals.rise),
        speed=at_rows(signals.speed),
    )


@lru_cache(maxsize=32)
def _weights(n: int) -> tuple[Floats, Floats]:
    """Return the weights of a mean of n samples, and of late and early samples, shape (n, 2)."""
    late = (np.arange(n) + 0.5) / n
    return np.full(n, 1 / n), np.stack([late, 1 - late], 1)
