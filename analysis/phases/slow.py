"""Smoothed signals and their derivatives, and the load on a compliant key.

The finger presses on a key that bends, heaves on its felt and carries its jacks on cloth, so the
laser does not see what the jack does. Between the finger's force F, the key's velocity v at the
laser and the load s of the string stands a linear system. Slowly compared with its modes it is

    s = F + k F'' - m v' + (error of m) v' + c F' + d v'' + e v''' + g F''''

of which a rigid key has m = I/(l p) alone. k is the key's compliance between finger and laser
times m; the other terms are losses, delays of the sensors and the next order. They are linear, and
are fitted with the string. The jack's rise is that of the laser less k / m F.

All signals are smoothed by the same B-spline. Linear relations between the signals therefore hold
for the smoothed signals, and each derivative is a difference of a spline of lower order.
"""

from functools import lru_cache

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.sparse import csr_array

from sautereau.analysis.phases.signals import Signals
from sautereau.trajectory.motion import Floats

HOPS = 6  # Blocks of samples in a width
ORDER = 8  # Number of boxcars of the spline
TERMS = {
    "v1": 0.4,
    "F2": 1.5e-5,
    "F1": 3e-4,
    "v2": 3e-5,
    "v3": 3e-7,
    "F4": 3e-12,
    "F3": 1e-9,
    "v4": 1e-10,
    "v5": 3e-13,
    "F6": 3e-18,
}
"""Prior standard deviations of the terms: dimensionless; s^2, s; kg s, kg s^2; s^4."""


class Slow:
    """The smoothed signals of a stretch, in rows of half a width; arrays of shape (n,).

    Args:
        finer: Factor of the largest number of widths.
    """

    def __init__(self, signals: Signals, begin: int, end: int, finer: int = 1):
        self.settings = signals.settings
        widths = finer * self.settings.widths
        width = max(self.settings.width, (end - begin) / signals.rate / widths)
        n = max(1, round(width / HOPS * signals.rate))
        self.hop = n / signals.rate
        self.width = HOPS * self.hop
        # Four widths before and after, as far as there is any signal.
        first = max(0, begin - 4 * HOPS * n)
        hops = (min(len(signals.time), end + 4 * HOPS * n) - first) // n

        def means(signal: Floats) -> Floats:
            return signal[first : first + hops * n].reshape(hops, n) @ np.full(n, 1 / n)

        self.hops = means(signals.time)
        """s, instants of the blocks, of which a row covers several."""
        start, stop = np.searchsorted(self.hops, signals.time[[begin, end]])
        self.inertial = signals.inertial
        self.time, self.step = self.hops[start : stop : HOPS // 2], self.hop * (HOPS // 2)
        places = np.arange(start, stop, HOPS // 2)[:, None] + np.arange(ORDER * HOPS + 1)
        self._places = np.clip(places - ORDER * HOPS // 2, 0, hops - 1)
        """Blocks that are part of a row, shape (n, blocks)."""
        self._smoothing: dict[int, csr_array] = {}
        """Of each derivative the matrix that makes rows of blocks."""
        force, velocity = means(signals.force), means(signals.velocity)
        self._rise, self._speed = means(signals.rise), means(signals.speed)
        self._slow_force = uniform_filter1d(force - force[0], 2 * HOPS + 1, mode="nearest")
        self._lever = float(signals.rise[end] / max(1e-9, signals.deflection[end]))
        # All derivatives at once: the matrices of `smooth` take longer if each is used once.
        kernels = np.stack([_kernel(k) / self.width**k for k in range(ORDER + 1)], 1)
        signal = {"v": velocity[self._places] @ kernels, "F": force[self._places] @ kernels}
        self.force, self.force_2 = signal["F"][:, 0], signal["F"][:, 2]
        acceleration = signal["v"][:, 1]
        terms = [std * signal[name[0]][:, int(name[1])] for name, std in TERMS.items()]
        terms[0] *= self.inertial
        self.terms = np.stack(terms, 1)
        """N, the terms times their prior standard deviations; shape (n, terms)."""
        self._rigid = self.force - self.inertial * acceleration
        sudden = force - self.inertial * np.gradient(velocity, self.hop)
        sudden -= np.interp(self.hops, self.time, self._rigid)
        rms = np.sqrt(np.maximum(self.smooth(sudden**2), 0.0))
        # In the calmest fifth of the rows there is only noise.
        self._error = self.settings.sudden * np.maximum(rms - float(np.quantile(rms, 0.2)), 0.0)

    def smooth(self, signal: Floats, derivative: int = 0) -> Floats:
        """Return signals of the blocks, smoothed, or a derivative of that, at the rows.

        Args:
            signal: Shape (blocks,) or (blocks, k).
            derivative: Its order.
        """
        if derivative not in self._smoothing:
            rows, size = self._places.shape
            weights = np.tile(_kernel(derivative) / self.width**derivative, rows)
            ends = np.arange(0, rows * size + 1, size)
            self._smoothing[derivative] = csr_array(
                (weights, self._places.ravel(), ends), shape=(rows, len(self.hops))
            )
        return self._smoothing[derivative] @ signal

    def load(self, compliance: float) -> Floats:
        """Return the load [N] for a compliance k [s^2]."""
        return self._rigid + compliance * self.force_2

    def rise(self, compliance: float) -> Floats:
        """Return the jack's rise [m] at the blocks for a compliance k [s^2]."""
        lag = compliance / self.inertial * self._lever * self._slow_force
        return np.maximum.accumulate(self._rise - lag)

    def error(self, time: Floats) -> Floats:
        """Return the standard uncertainty [N] of the load at times [s] by what is too fast."""
        return np.interp(time, self.time, self._error)

    def speed(self) -> Floats:
        """Return the jack's speed [m/s]."""
        return self.smooth(self._speed)


@lru_cache
def _kernel(derivative: int) -> Floats:
    """Return the weights of a smoothed signal's derivative, centred, times the width's power."""
    kernel = np.ones(1)  # the B-spline of so many boxcars
    for _ in range(ORDER - derivative):
        kernel = np.convolve(kernel, np.full(HOPS, 1 / HOPS))
    for _ in range(derivative):
        kernel = np.convolve(kernel, np.concatenate([[1.0], np.zeros(HOPS - 1), [-1.0]]))
    if len(kernel) % 2 == 0:  # the mean of both neighbours is centred
        kernel = np.convolve(kernel, [0.5, 0.5])
    return np.pad(kernel, (ORDER * HOPS + 1 - len(kernel)) // 2)[::-1]
