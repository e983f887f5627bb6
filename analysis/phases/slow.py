"""Smoothed signals and their derivatives, and the load on a compliant key.

The finger presses on a key that bends, heaves on its felt and carries its jacks on cloth, so the
laser does not see what the jack does. Between the finger's force F, the key's velocity v at the
laser and the load s of the string stands a linear system. Slowly compared with its modes it is

    s = F + k F'' - m v' + (error of m) v' + c F' + d v'' + e v''' + g F''''

of which a rigid key has m = I/(l p) alone. k is the key's compliance between finger and laser
times m; the other terms are losses, delays of the sensors and the next order. They are linear, and
are fitted with the string. The jack's rise is that of the laser less k / m F.

All signals are smoothed by one B-spline, so that each derivative is a difference of a spline of
lower order, and relations between the signals hold for the smoothed ones too.
"""

import numpy as np

from sautereau.analysis.phases.signals import Signals
from sautereau.trajectory.motion import Floats

WIDTH, HOPS, ORDER = 1e-3, 6, 6
"""s, width of the spline's boxcars; blocks of samples in one; number of boxcars."""
MARGIN = 4
"""Widths of signal before and after, as far as there is any."""
TERMS = {"inertia": 0.4, "F''": 1.5e-5, "F'": 3e-4, "v''": 3e-5, "v'''": 3e-7, "F''''": 3e-12}
"""Prior standard deviations of the terms: dimensionless; s^2, s; kg s, kg s^2; s^4."""
SUDDEN, CALM = 0.3, 0.2
"""Error of the load over the rms of what is too fast for this relation: impacts and ringing, above
the noise, which is the rms of this calmest fraction of the rows."""
MOST_COMPLIANT = 6e-5
"""s^2, largest k."""


class Slow:
    """The smoothed signals of a stretch, in rows of half a width; arrays of shape (n,).

    Args:
        signals: Of the press.
        begin: First sample.
        end: Last sample.
    """

    def __init__(self, signals: Signals, begin: int, end: int):
        n = max(1, round(WIDTH / HOPS * signals.rate))
        self.hop = n / signals.rate
        self.width = HOPS * self.hop
        first = max(0, begin - MARGIN * HOPS * n)
        hops = (min(len(signals.time), end + MARGIN * HOPS * n) - first) // n

        def means(signal: Floats) -> Floats:
            return signal[first : first + hops * n].reshape(hops, n) @ np.full(n, 1 / n)

        self.hops = means(signals.time)
        """s, instants of the blocks, of which a row covers several."""
        start, stop = np.searchsorted(self.hops, signals.time[[begin, end]])
        self._rows = slice(int(start), int(stop), HOPS // 2)
        self.inertial = signals.inertial
        self.time, self.step = self.hops[self._rows], self.hop * (HOPS // 2)
        force, velocity = means(signals.force), means(signals.velocity)
        self._rise, self._speed = means(signals.rise), means(signals.speed)
        self._slow_force = _convolved(force - force[0], _spline(3, HOPS))
        self._lever = float(signals.rise[end] / max(1e-9, signals.deflection[end]))
        self.force, self.force_2 = self.smooth(force), self.smooth(force, 2)
        acceleration = self.smooth(velocity, 1)
        self.terms = np.stack(
            [
                self.inertial * acceleration * TERMS["inertia"],
                self.force_2 * TERMS["F''"],
                self.smooth(force, 1) * TERMS["F'"],
                self.smooth(velocity, 2) * TERMS["v''"],
                self.smooth(velocity, 3) * TERMS["v'''"],
                self.smooth(force, 4) * TERMS["F''''"],
            ],
            1,
        )
        """N, the terms times their prior standard deviations; shape (n, 6)."""
        self._rigid = self.force - self.inertial * acceleration
        sudden = force - self.inertial * np.gradient(velocity, self.hop)
        sudden -= np.interp(self.hops, self.time, self._rigid)
        rms = np.sqrt(np.maximum(self.smooth(sudden**2), 0.0))
        self._error = SUDDEN * np.maximum(rms - float(np.quantile(rms, CALM)), 0.0)

    def smooth(self, signal: Floats, derivative: int = 0) -> Floats:
        """Return a signal of the blocks, or a derivative of it, smoothed, at the rows."""
        kernel = _spline(ORDER - derivative, HOPS)
        for _ in range(derivative):
            kernel = np.convolve(kernel, np.concatenate([[1.0], np.zeros(HOPS - 1), [-1.0]]))
        return _convolved(signal, kernel)[self._rows] / self.width**derivative

    def load(self, compliance: float) -> Floats:
        """Return the load [N] for a compliance k [s^2]."""
        return self._rigid + compliance * self.force_2

    def rise(self, compliance: float) -> Floats:
        """Return the jack's rise [m] at the blocks for a compliance k [s^2]."""
        lag = compliance / self.inertial * self._lever * self._slow_force
        return np.maximum.accumulate(self._rise - lag)

    def at(self, time: Floats) -> Floats:
        """Return the terms at other times [s], shape (times, 6)."""
        return np.stack([np.interp(time, self.time, term) for term in self.terms.T], 1)

    def error(self, time: Floats) -> Floats:
        """Return the standard uncertainty [N] of the load at times [s] by what is too fast."""
        return np.interp(time, self.time, self._error)

    def speed(self) -> Floats:
        """Return the jack's speed [m/s]."""
        return self.smooth(self._speed)


def _spline(order: int, width: int) -> Floats:
    """Return the B-spline of a number of boxcars."""
    kernel = np.ones(1)
    for _ in range(order):
        kernel = np.convolve(kernel, np.full(width, 1 / width))
    return kernel


def _convolved(signal: Floats, kernel: Floats) -> Floats:
    """Return a convolution centred on each sample; the ends are continued."""
    n = len(kernel)
    every = np.convolve(np.pad(signal, n, mode="edge"), kernel)
    first = n + n // 2
    later = every[first : first + len(signal)]
    return later if n % 2 else (later + every[first - 1 : first - 1 + len(signal)]) / 2
