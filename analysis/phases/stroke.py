"""The way down of a press, as rows of force with the inertia taken off and known noise.

The finger's force F at its arm p moves the key's inertia I and bears the load s that the rest
puts on it: s p = F p - I a''. With the vibrometer's velocity v = l a' that is an integral,
Q = int F dt - I v / (l p), whose growth is s. Its means over blocks, differenced, are s under a
triangular weight, without a derivative of the velocity, and with a noise that is known: of the
force white, of the velocity as the difference of white noise.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import get_lapack_funcs

from sautereau.analysis.phases.signals import Signals
from sautereau.trajectory.motion import Floats

ROWS = 800
"""Of a way down, at most."""
LEAST_ROWS = 8
"""Of a stretch that tells anything."""
LEAST_STEP = 80e-6
"""s, of a row, below which the noise of the velocity would drown the load."""
BRIDGE = 0.5e-3
"""s, on either side of a drop-out, of the means between which the acceleration is bridged."""
BRIDGED, HIDDEN = 0.03, 10.0
"""N, noise of a row whose velocity, or whose force, is not to be believed."""


FACTOR, SOLVE = get_lapack_funcs(("pbtrf", "tbtrs"))
"""LAPACK's Cholesky factor of a banded matrix, and the solve with it."""


@dataclass(frozen=True)
class Rows:
    """The load on the key over time; arrays of shape (n,)."""

    time: Floats
    """s from the trigger."""
    step: float
    """s, from row to row."""
    load: Floats
    """N at the finger."""
    rise: Floats
    """m, of the jack."""
    speed: Floats
    """m/s, of the jack."""
    inertia: Floats
    """N, of the inertia that was taken off."""
    variance: Floats
    """N^2, of each row's load."""
    covariance: Floats
    """N^2, with the next row's; shape (n - 1,)."""

    def whitener(self) -> "Whitener":
        """Return what makes this noise white and of variance 1."""
        return Whitener(self.variance, self.covariance)


NO_ROWS = Rows(*[np.zeros(0), 0.0, *[np.zeros(0)] * 6])
"""Of no samples."""


class Whitener:
    """Turns columns whose noise has a tridiagonal covariance into ones with white noise."""

    def __init__(self, variance: Floats, covariance: Floats):
        band = np.zeros((2, len(variance)))
        band[0], band[1, :-1] = variance, covariance
        self._factor, _ = FACTOR(band, lower=1)

    def __call__(self, columns: Floats) -> Floats:
        """Return columns, shape (n,) or (n, k), in units of their noise."""
        found, _ = SOLVE(self._factor, columns, uplo="L")
        return found


def rows_of(
    signals: Signals, first: int, last: int, n: int | None = None, *, most: int = ROWS
) -> Rows:
    """Return the load over samples first to last - 1, a row for every n of them.

    By default there are at most ``most``, each of `LEAST_STEP` at the least.
    """
    rate = signals.rate
    n = max(1, -(-(last - first) // most), round(LEAST_STEP * rate)) if n is None else n
    blocks = (last - first) // n
    if blocks < LEAST_ROWS:
        return NO_ROWS
    last = first + blocks * n
    share = np.full(n, 1 / n)

    def means(signal: Floats) -> Floats:
        return signal[first:last].reshape(blocks, n) @ share

    def at_rows(signal: Floats) -> Floats:
        each = means(signal)
        return (each[1:] + each[:-1]) / 2

    step = n / rate
    no_force, no_velocity = (
        at_rows(flags.astype(float)) > 0 if flags.any() else np.zeros(blocks - 1, bool)
        for flags in (signals.no_force, signals.no_velocity)
    )
    inertia = signals.inertial * _steps(means(signals.velocity)) / step
    # The mean of a sum that grows over a block grows by the rest of one and the first of the next.
    late = (np.arange(n) + 0.5) / n
    parts = signals.force[first:last].reshape(blocks, n) @ np.stack([late, 1 - late], 1)
    load = (parts[:-1, 0] + parts[1:, 1]) / n - inertia
    if no_velocity.any() and not no_velocity.all():
        bridged = _bridged(inertia, ~no_velocity, max(1, round(BRIDGE / step)))
        load, inertia = load + inertia - bridged, bridged
    shape = np.concatenate([late, 1 - late]) / n
    of_force = signals.force_noise**2
    of_velocity = (signals.inertial * signals.velocity_noise / step) ** 2 / n
    # Where the velocity is bridged its noise is not in the load, and the bridge's error is.
    variance = of_force * (shape @ shape) + np.where(no_velocity, BRIDGED**2, 2 * of_velocity)
    shared = of_force * (shape[n:] @ shape[:-n]) - of_velocity
    alone = no_force | no_velocity
    return Rows(
        time=signals.time[first] + (np.arange(1, blocks) * n - 0.5) / rate,
        step=step,
        load=load,
        rise=at_rows(signals.rise),
        speed=at_rows(signals.speed),
        inertia=inertia,
        variance=variance + (HIDDEN * no_force) ** 2,
        covariance=np.where(alone[1:] | alone[:-1], 0.0, shared),
    )


def _steps(signal: Floats) -> Floats:
    return signal[1:] - signal[:-1]


def _bridged(signal: Floats, good: NDArray[np.bool_], width: int) -> Floats:
    """Return a signal with lines over what is not good, from means of so many rows beside it."""
    kernel, place = np.ones(2 * width + 1), np.arange(len(signal))
    weight = np.convolve(good, kernel)[width:-width]
    means = np.convolve(signal * good, kernel)[width:-width] / np.maximum(weight, 1)
    return np.where(good, signal, np.interp(place, place[good], means[good]))
