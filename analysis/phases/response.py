"""The response of a signal to a sudden event: a curve, and damped modes that it excites.

A key bends and heaves, its jack stands on cloth, and the transducer resonates. At a release the
laser and the transducer show the step of the string's force, convolved with the response of all
these. The response is a sum of exponentials exp(p t) with poles p, which are found together with
the instant of the event. Since all these parts have inertia, neither the signals nor their slopes
jump at the event: the signals begin with t^2. Only the velocity of a key with a jack on a hard
cloth begins with t. What the event excites is then filtered by the sensors' low-passes.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from sautereau.analysis.phases.signals import LowPass
from sautereau.trajectory.motion import Floats

Poles = NDArray[np.complex128]
Orders = tuple[int, ...]
"""Powers of time with which signals begin: one for all, or one for each."""

SCALE = 1e-2  # s, after which a curve of coefficient 1 has reached 1
CURVE = 2  # Power of the curve of an event


def pole(frequency: float, damping: float) -> complex:
    """Return the pole of a mode [1/s] with this frequency [Hz] and damping ratio."""
    turn = 2 * math.pi * frequency
    return complex(-damping * turn, turn * math.sqrt(max(0.0, 1 - damping**2)))


def esprit(parts: Sequence[Floats], size: int, order: int) -> Poles:
    """Return the poles (logarithms per sample) that all signals share, shape (order,).

    Windows of a sum of exponentials lie in a subspace that a shift by one sample maps to itself;
    the eigenvalues of this map are the poles (R. Roy and T. Kailath, IEEE Trans. ASSP 37 (1989)
    984).

    Args:
        parts: Signals without a sudden event, shape (signals, n) each; too short ones do not
            count.
        size: Samples of a window.
        order: Number of poles; a real oscillation has two.
    """
    windows = np.concatenate(
        [
            sliding_window_view(part, size, axis=1).reshape(-1, size)
            for part in parts
            if part.shape[1] > size + 1
        ]
    )
    _, vectors = np.linalg.eigh(windows.T @ windows)
    space = vectors[:, -order:]
    turned = np.linalg.lstsq(space[:-1], space[1:])[0]
    return np.log(np.linalg.eigvals(turned).astype(complex) + 1e-300)


def ringing_in(parts: Sequence[Floats], step: float) -> Poles:
    """Return the poles [1/s] of the modes that ring in parts of signals.

    What is slower and more damped than ringing is omitted.

    Args:
        parts: Signals over their noise without a sudden event, shape (signals, n) each.
        step: s, of the samples.

    Returns:
        Those of 60 Hz or more with a positive imaginary part; none if all parts are too short.
    """
    size = min(40, max(part.shape[1] for part in parts) // 2)
    if size < 6:
        return np.zeros(0, complex)
    poles = esprit(parts, size, min(11, size - 2)) / step  # a parabola and four modes
    poles = poles[poles.imag > 0]
    turn = np.abs(poles)
    damping = -poles.real / turn
    ringing = (turn * step < 0.84 * math.pi) & (turn > 2 * math.pi * 60) & (damping < 0.8)
    damping, turn = np.maximum(damping, 0.005)[ringing], turn[ringing]
    return turn * (-damping + 1j * np.sqrt(1 - damping**2))


@dataclass(frozen=True)
class Response:
    """Responses to events, as means over the blocks of a stretch of signal."""

    time: Floats
    """s, middles of the blocks, shape (n,)."""
    step: float
    """s, length of a block."""
    degree: int = 2
    """Of the polynomial that continues from before the events."""
    low_passes: tuple[LowPass | None, ...] = ()
    """Of the signals, one for each if any has one."""

    @cached_property
    def _ends(self) -> Floats:
        """s, of the blocks, and of those that the filters need after them; shape (n + ... + 1,)."""
        ahead = max((each.ahead(self.step) for each in self.low_passes if each), default=0)
        later = self.time[-1] + self.step * (np.arange(ahead + 1) + 0.5)
        return np.append(self.time - self.step / 2, later)

    @cached_property
    def _polynomial(self) -> Floats:
        """Columns of a polynomial, shape (n, degree + 1)."""
        return (self.time[:, None] / SCALE) ** np.arange(self.degree + 1)

    def _since(self, instants: Floats) -> Floats:
        """Return the times of the blocks' ends after each instant [s], shape (..., n + 1)."""
        return np.maximum(self._ends - instants[..., None], 0.0)

    def _waves(self, instants: Floats, poles: Poles) -> Poles:
        """Return exp(p t) at these times t, shape (..., n + 1, modes).

        It is a product, as exponentials take most of the time of many instants and poles.
        """
        start = np.exp(-instants[..., None, None] * poles)
        later = (self._ends > instants[..., None])[..., None]
        return np.where(later, np.exp(self._ends[:, None] * poles) * start, 1.0)

    def before(self, poles: Poles) -> Floats:
        """Return a polynomial, and ringing from before.

        Args:
            poles: 1/s, shape (..., modes).

        Returns:
            Shape (..., n, degree + 1 + 2 modes).
        """
        waves = np.exp((self.time - self.time[0])[:, None] * poles[..., None, :])
        known = np.broadcast_to(self._polynomial, (*waves.shape[:-1], self.degree + 1))
        return np.concatenate([known, waves.real, waves.imag], -1)

    def event(self, instants: Floats, poles: Poles, orders: Orders) -> Floats:
        """Return the curves and the modes from each instant on, which grow as a power of time.

        A mode is exp(p t) less the terms of its power series below that power, of which a column
        holds the real, another the imaginary part.

        Args:
            instants: s, shape (..., events).
            poles: 1/s, shape (..., modes) or (modes,).

        Returns:
            Shape (..., events, orders, n, curves + 2 modes), curves as of `curves`.
        """
        t, poles = self._since(instants)[..., None], poles[..., None, None, :]
        waves, powers = self._waves(instants, poles), _powers(orders)
        each = []
        for order in orders:
            curve = SCALE * (powers >= order) * (t / SCALE) ** (powers + 1) / (powers + 1)
            mode = _without(order + 1, waves, poles * t) / poles
            each.append(np.concatenate([curve, _pairs(mode)], -1))
        return self._means(np.stack(each, -3))

    def slopes(self, instants: Floats, poles: Poles, orders: Orders) -> tuple[Floats, Poles, Poles]:
        """Return the derivatives of the columns of events, and of ringing from before.

        Args:
            instants: s, shape (..., events).
            poles: 1/s, shape (..., modes).
            orders: As of `event`.

        Returns:
            Of each event by its instant, shape (..., events, orders, n, curves + 2 modes); of its
            complex modes by their poles, shape (..., events, orders, n, modes); of those from
            before, shape (..., n, modes).
        """
        early = (self.time - self.time[0])[:, None]
        waves_before = early * np.exp(early * poles[..., None, :])
        t, poles = self._since(instants)[..., None], poles[..., None, None, :]
        waves, powers = self._waves(instants, poles), _powers(orders)
        by_instant, by_pole = [], []
        for order in orders:
            curve = (powers >= order) * (t / SCALE) ** powers
            mode = _without(order, waves, poles * t)
            by_instant.append(np.concatenate([curve, _pairs(mode)], -1))
            by_pole.append((t * mode - _without(order + 1, waves, poles * t) / poles) / poles)
        columns, modes = (self._means(np.stack(each, -3)) for each in (by_instant, by_pole))
        return -columns, modes, waves_before

    def _means(self, ends: NDArray[Any]) -> NDArray[Any]:
        """Return filtered means over the blocks of columns whose integrals are given at the ends.

        Args:
            ends: Shape (..., orders, ends, columns).

        Returns:
            Shape (..., orders or signals, n, columns).
        """
        means = np.diff(ends, axis=-2) / self.step
        if not any(self.low_passes):
            return means
        n = len(self.time)
        each = []
        for number, low_pass in enumerate(self.low_passes):
            signal = means[..., min(number, means.shape[-3] - 1), :, :]
            if low_pass:
                signal = low_pass.filtered(signal, self.step, n)
            each.append(signal[..., :n, :])
        return np.stack(each, -3)


def curves(orders: Orders) -> int:
    """Return the number of curves of an event: t^2, and t if a signal begins with that."""
    return len(_powers(orders))


def _powers(orders: Orders) -> NDArray[np.int64]:
    return np.arange(min(orders), max(CURVE, *orders) + 1)


def _without(terms: int, waves: Poles, z: Poles) -> Poles:
    """Return waves = exp(z) less the first terms of its power series, at least one."""
    series = np.ones_like(z)
    for k in range(terms - 1, 0, -1):
        series = 1 + z / k * series
    return waves - series


def _pairs(waves: Poles) -> Floats:
    """Return real and imaginary parts side by side, shape (..., 2 modes)."""
    return np.concatenate([waves.real, waves.imag], -1)
