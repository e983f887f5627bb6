"""Noise of the smoothed force and acceleration, measured while the key is at rest."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sautereau.trajectory.motion import Floats, Motion

WINDOW = 2e-3
"""s, of the smoothing window."""
SLOW = 0.03
"""Dimensionless, fraction of the largest speed below which the key counts as at rest."""
BESIDE_TURN = 4e-3
"""s, excluded on either side of a reversal or rest of the key, where friction is indeterminate."""
LEAST_REST, AFTER_RETURN = 10e-3, 10e-3
"""s, shortest rest from which the noise is estimated, and the time after the return before it."""


@dataclass(frozen=True)
class Noise:
    """RMS of smoothed signals at rest, without mean and trend."""

    slow_force: float
    """N, what is slower than the smoothing window, such as hum."""
    fast_force: float
    """N, the rest."""
    acceleration: float
    """rad/s^2, of the key."""

    def of_load(self, inertia: float, gain: float = 1.0) -> float:
        """Return the RMS [N] of a force residual.

        Args:
            inertia: kg m, of the key with its jacks over the lever arm of the finger.
            gain: Of the fast force, by elastic modes.
        """
        parts = self.slow_force, gain * self.fast_force, inertia * self.acceleration
        return float(np.linalg.norm(parts))


def noise_at_rest(
    rate: float, time: Floats, force: Floats, motion: Motion, clean: NDArray[np.bool_]
) -> Noise | None:
    """Return the noise at rest; None without a rest.

    Args:
        rate: Hz, of the samples.
        time: s, shape (n,).
        force: N, smoothed, shape (n,).
        motion: Smoothed motion of the key [rad], arrays of shape (n,).
        clean: Which samples are none of a drop-out or overload, shape (n,).
    """
    speed = np.abs(motion.velocity)
    moving = time[speed > SLOW * speed.max(initial=0.0)]
    rests = (time < moving[0] - BESIDE_TURN, time > moving[-1] + AFTER_RETURN)
    found = []
    for rest in rests:
        kept = rest & clean
        if np.count_nonzero(kept) >= LEAST_REST * rate:
            every, fast = _scatter(time, force, kept, rate), _fast(force, kept, rate)
            slow = float(np.sqrt(max(0.0, every**2 - fast**2)))
            found.append(Noise(slow, fast, _scatter(time, motion.acceleration, kept, rate)))
    # After a return the arm may still vibrate.
    return min(found, key=lambda noise: np.hypot(noise.slow_force, noise.fast_force), default=None)


def _scatter(time: Floats, signal: Floats, kept: NDArray[np.bool_], rate: float) -> float:
    """Return the RMS of a smoothed signal without its mean and trend."""
    at, left = time[kept] - time[kept].mean(), signal[kept] - signal[kept].mean()
    left -= at * (at @ left) / (at @ at)
    # The smoothing leaves about one independent value in half a window.
    return float(np.sqrt(left @ left / (len(left) - WINDOW * rate)))


def _fast(signal: Floats, kept: NDArray[np.bool_], rate: float) -> float:
    """Return the RMS of what differs from one smoothing window to the next; 0 of too few."""
    lag = round(WINDOW * rate)
    change = signal[lag:-lag] - (signal[: -2 * lag] + signal[2 * lag :]) / 2
    change = change[kept[lag:-lag] & kept[: -2 * lag] & kept[2 * lag :]]
    return float(np.sqrt(change @ change / max(1, len(change)) / 1.5))
