"""Noise of the smoothed force and acceleration, measured while the key is at rest."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sautereau.trajectory.motion import Floats, Motion

WINDOW = 2e-3  # Width of the smoothing window (s)
REST_SPEED = 0.03  # Fraction of the largest speed below which the key counts as at rest
TURN_MARGIN = 4e-3
"""Time excluded before and after a reversal or a rest of the key (s). The friction is
indeterminate there."""
MIN_REST = 10e-3  # Shortest rest from which the noise is estimated (s)
RETURN_MARGIN = 10e-3  # Time from the end of the return to the start of that rest (s)


@dataclass(frozen=True)
class Noise:
    """RMS of the smoothed signals at rest, after removal of mean and linear trend."""

    slow_force: float
    """N, part slower than the smoothing window, such as mains hum."""
    fast_force: float
    """N, part faster than that."""
    acceleration: float
    """rad/s^2, of the key's angular acceleration."""

    def of_load(self, inertia: float) -> float:
        """Return the RMS [N] of the force residual of a rigid key that this noise causes.

        Args:
            inertia: kg m, inertia of the key with its jacks divided by the finger's lever arm.
        """
        return float(np.hypot(self.slow_force, self.fast_of_load(inertia)))

    def fast_of_load(self, inertia: float, gain: float = 1.0) -> float:
        """Return the RMS [N] of its fast part, which hum and offset do not explain.

        Args:
            inertia: As for `of_load`.
            gain: Amplification of the fast force by the elastic modes.
        """
        return float(np.hypot(gain * self.fast_force, inertia * self.acceleration))


def noise_at_rest(
    rate: float, time: Floats, force: Floats, motion: Motion, clean: NDArray[np.bool_]
) -> Noise | None:
    """Return the noise at rest, or None if the recording has no rest.

    Args:
        rate: Hz, sampling rate.
        time: s, shape (n,).
        force: N, smoothed, shape (n,).
        motion: Smoothed motion of the key [rad], arrays of shape (n,).
        clean: Which samples are outside drop-outs and overloads, shape (n,).
    """
    speed = np.abs(motion.velocity)
    moving = time[speed > REST_SPEED * speed.max(initial=0.0)]
    rests = (time < moving[0] - TURN_MARGIN, time > moving[-1] + RETURN_MARGIN)
    found = []
    for rest in rests:
        kept = rest & clean
        if np.count_nonzero(kept) >= MIN_REST * rate:
            every, fast = _scatter(time, force, kept, rate), _fast(force, kept, rate)
            slow = float(np.sqrt(max(0.0, every**2 - fast**2)))
            found.append(Noise(slow, fast, _scatter(time, motion.acceleration, kept, rate)))
    # After a return the arm may still vibrate.
    return min(found, key=lambda noise: np.hypot(noise.slow_force, noise.fast_force), default=None)


def _scatter(time: Floats, signal: Floats, kept: NDArray[np.bool_], rate: float) -> float:
    """Return the RMS of a smoothed signal after removal of its mean and linear trend."""
    at, left = time[kept] - time[kept].mean(), signal[kept] - signal[kept].mean()
    left -= at * (at @ left) / (at @ at)
    # The smoothing leaves about one independent value in half a window.
    return float(np.sqrt(left @ left / (len(left) - WINDOW * rate)))


def _fast(signal: Floats, kept: NDArray[np.bool_], rate: float) -> float:
    """Return the RMS of the part that changes from one smoothing window to the next.

    It is 0 if there are too few samples.
    """
    lag = round(WINDOW * rate)
    change = signal[lag:-lag] - (signal[: -2 * lag] + signal[2 * lag :]) / 2
    change = change[kept[lag:-lag] & kept[: -2 * lag] & kept[2 * lag :]]
    return float(np.sqrt(change @ change / max(1, len(change)) / 1.5))
