"""Damped modes of a short stretch of several channels, with standard errors.

Channel c is modelled as the sum of Re(A_c exp((-d + i w) t)) over the modes, plus a polynomial.
All channels share frequency and decay. A least-squares fit starts from the poles that ESPRIT finds
(R. Roy and T. Kailath, IEEE Trans. ASSP 37, 1989). Amplitudes and polynomials are eliminated from
it (variable projection, G. Golub and V. Pereyra, 1973). Modes are added one by one as long as noise
alone would cause their gain with a probability below 0.1 % per stretch.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import chi2

from sautereau.analysis.phases.response import esprit
from sautereau.trajectory.motion import Floats

MOST_DAMPING = 0.1  # Largest damping ratio of an oscillation
LEAST_SAMPLES = 32  # Smallest number of samples of a stretch


@dataclass(frozen=True)
class DampedMode:
    """One damped mode of a stretch; arrays of shape (channels,)."""

    frequency: float
    """Hz, of the damped oscillation."""
    frequency_std: float
    """Hz, standard uncertainty."""
    decay: float
    """1/s, of the amplitude."""
    decay_std: float
    """1/s."""
    amplitude: NDArray[np.complex128]
    """Complex amplitude of a cosine at the start of the stretch, in the channels' units."""
    amplitude_std: Floats
    """Standard uncertainty of its real part, and of its imaginary part."""

    @property
    def damping(self) -> float:
        """Damping ratio."""
        return self.decay / float(np.hypot(self.decay, 2 * np.pi * self.frequency))

    @property
    def damping_std(self) -> float:
        """Standard uncertainty of `damping`."""
        omega = 2 * np.pi * self.frequency
        return self.decay_std * omega**2 / float(np.hypot(self.decay, omega)) ** 3


@dataclass(frozen=True)
class StretchModes:
    """The fitted modes of a stretch."""

    modes: tuple[DampedMode, ...]
    """Ordered by their amplitude in the first channel, the largest first."""
    smallest: Floats
    """Smallest amplitude that would be found, for each channel; shape (channels,)."""
    fit: Floats
    """Sum of modes and polynomials, shape (channels, n)."""
    excess: float
    """Variance of the residuals, divided by that of the noise."""


def fit_modes(signals: Floats, rate: float, noise: Floats) -> StretchModes:
    """Return the damped modes of a stretch; there may be none.

    Args:
        signals: Shape (channels, n), n at least `LEAST_SAMPLES`.
        rate: Hz.
        noise: Standard deviation of each channel's white noise, shape (channels,).
    """
    white = (signals / noise[:, None]).T
    fit = _Fit(white, rate)
    poles = np.zeros(0)
    linear, left = fit.solve(poles)
    dof = white.size - linear.size
    while len(poles) < 2 * 7:  # 7 modes, including those that are not oscillations
        start = _best_start(fit, poles, left)
        if start is None:
            break
        more = fit.refine(start)
        _, after = fit.solve(more)
        gain = float(np.sum(left**2) - np.sum(after**2))
        excess = max(1.0, float(np.sum(after**2)) / (dof - 2 - 2 * white.shape[1]))
        if gain / excess < _threshold(white):
            break
        poles, left = more, after
        dof -= 2 + 2 * white.shape[1]
    excess = float(np.sum(left**2)) / dof
    scale = noise * np.sqrt(max(1.0, excess))
    return StretchModes(
        modes=fit.described(poles, scale),
        smallest=scale * np.sqrt(4 * _threshold(white) / len(white)),
        fit=(white - left).T * noise[:, None],
        excess=excess,
    )


def _threshold(white: Floats) -> float:
    """Return the gain in chi-squared that noise alone rarely exceeds."""
    n, channels = white.shape
    # In 0.1 % of the stretches, with three independent trials of frequency and decay per frequency
    # of the Fourier transform.
    return float(chi2.isf(1e-3 / (3.0 * n / 2), 2 + 2 * channels))


class _Fit:
    """Variable projection of whitened signals (n, channels) onto modes and polynomial."""

    def __init__(self, white: Floats, rate: float):
        self.white, self.rate = white, rate
        n = len(white)
        self.time = np.arange(n) / rate
        self.duration = n / rate
        self.trend = np.polynomial.legendre.legvander(np.linspace(-1, 1, n), 4)
        self.slowest = 2 * np.pi * 3.0 / self.duration  # A slower oscillation is not reported
        self.fastest = 2 * np.pi * 0.4 * rate  # Of the sampling rate

    def bounds(self, poles: Floats) -> tuple[Floats, Floats]:
        """Return the smallest and largest decays and angular frequencies, shape (poles,)."""
        count, slow = len(poles) // 2, np.pi / 2 / self.duration
        least, most = (-2 / self.duration, slow), (self.fastest / 2, self.fastest)
        return np.repeat(least, count), np.repeat(most, count)

    def oscillates(self, decay: float, omega: float) -> bool:
        """Return whether a pole is an oscillation, and not a slow or overdamped motion."""
        return bool(
            self.slowest < omega < 0.99 * self.fastest
            and -1.5 / self.duration < decay < MOST_DAMPING * omega
        )

    def basis(self, poles: Floats) -> Floats:
        """Return the columns cos, -sin of each mode, then the polynomial; shape (n, columns)."""
        decay, omega = np.split(poles, 2)
        shrunk, turned = np.exp(np.outer(self.time, -decay)), np.outer(self.time, omega)
        waves = shrunk * np.cos(turned), -shrunk * np.sin(turned)
        return np.asarray(np.hstack([*waves, self.trend]), float)

    def solve(self, poles: Floats) -> tuple[Floats, Floats]:
        """Return the linear parameters (columns, channels), and the residuals (n, channels)."""
        basis = self.basis(poles)
        linear = np.asarray(np.linalg.lstsq(basis, self.white, rcond=None)[0], float)
        return linear, self.white - basis @ linear

    def residuals(self, poles: Floats) -> Floats:
        """Return the residuals alone, shape (n, channels)."""
        q, _ = np.linalg.qr(self.basis(poles))
        return self.white - q @ (q.T @ self.white)

    def moved(self, poles: Floats, linear: Floats) -> Floats:
        """Return the derivatives of the modes by the poles, shape (channels, n, poles)."""
        decay, omega = np.split(poles, 2)
        count = len(decay)
        wave = -self.time[:, None] * np.exp(np.outer(self.time, -decay + 1j * omega))
        amplitude = (linear[:count] + 1j * linear[count : 2 * count]).T[:, None, :]
        by_decay = wave * amplitude
        return np.concatenate([by_decay.real, by_decay.imag], axis=2)

    def slopes(self, poles: Floats) -> Floats:
        """Return the derivatives of the residuals, shape (channels n, poles), after L. Kaufman."""
        q, _ = np.linalg.qr(self.basis(poles))
        moved = self.moved(poles, self.solve(poles)[0])
        return (q @ (q.T @ moved) - moved).reshape(-1, len(poles))

    def refine(self, poles: Floats) -> Floats:
        """Return the least-squares poles near a start."""
        span, (least, most) = self.duration, self.bounds(poles)
        found = least_squares(
            lambda x: self.residuals(x / span).T.ravel(),
            np.clip(poles, least + 1e-6 * (most - least), most) * span,
            lambda x: self.slopes(x / span) / span,  # pyright: ignore[reportArgumentType]
            bounds=(least * span, most * span),
            xtol=1e-7,
            ftol=1e-7,
            max_nfev=40,
        )
        return found.x / span

    def described(self, poles: Floats, scale: Floats) -> tuple[DampedMode, ...]:
        """Return the modes with the standard errors of the Cramer-Rao bound.

        Args:
            poles: Decays [1/s], then angular frequencies [rad/s].
            scale: Noise of each channel in its unit, shape (channels,).
        """
        count = len(poles) // 2
        if not count:
            return ()
        linear, left = self.solve(poles)
        basis, channels = self.basis(poles), self.white.shape[1]
        excess = max(1.0, float(np.sum(left**2)) / (left.size - linear.size - len(poles)))
        decay, omega = np.split(poles, 2)
        complex_ = linear[:count] + 1j * linear[count : 2 * count]
        columns = basis.shape[1]
        by_poles = self.moved(poles, linear).reshape(-1, 2 * count)
        jacobian = np.hstack([by_poles, np.kron(np.eye(channels), basis)])
        size = np.linalg.norm(jacobian, axis=0)
        bound = np.linalg.pinv((jacobian / size).T @ (jacobian / size))
        std = np.sqrt(np.clip(np.diag(bound), 0, None) * excess) / size
        of_amplitude = std[2 * count :].reshape(channels, columns)[:, : 2 * count]
        of_amplitude = np.sqrt(np.mean(of_amplitude.reshape(channels, 2, count) ** 2, axis=1))
        units = scale / np.sqrt(excess)
        return tuple(
            DampedMode(
                frequency=float(omega[k] / (2 * np.pi)),
                frequency_std=float(std[count + k] / (2 * np.pi)),
                decay=float(decay[k]),
                decay_std=float(std[k]),
                amplitude=complex_[k] * units,
                amplitude_std=of_amplitude[:, k] * units,
            )
            for k in np.argsort(-np.abs(complex_[:, 0])).tolist()
            if self.oscillates(float(decay[k]), float(omega[k]))
            # Less certain frequencies are not reported.
            and std[count + k] < 0.05 * omega[k]
            and np.any(np.abs(complex_[k]) > 3 * of_amplitude[:, k])
        )


def _best_start(fit: _Fit, poles: Floats, left: Floats) -> Floats | None:
    """Return the poles with the pole of the residuals that explains most; None without one."""
    found = esprit([left.T], len(left) // 3, 10) * fit.rate  # 10 poles
    decay, omega = -found.real, found.imag
    decay = np.clip(decay, 0, fit.fastest / 4)
    near = (omega > np.pi / fit.duration) & (omega < 0.98 * fit.fastest)
    old_decay, old_omega = np.split(poles, 2)
    best, least = None, np.inf
    for d, w in zip(decay[near], omega[near], strict=True):
        tried = np.concatenate([old_decay, [d], old_omega, [w]])
        rest = float(np.sum(fit.residuals(tried) ** 2))
        if rest < least:
            best, least = tried, rest
    return best
