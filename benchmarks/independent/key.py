"""The key: a free-free beam that rotates on its pin, heaves on its felt and bends.

Coordinates are [heave,] rotation and the bending modes. With a rigid pin the heave is eliminated:
the displacement of the beam at the pin is zero, so a mode's shape is measured from its value there.
"""

from dataclasses import dataclass

import numpy as np

from .conditions import Conditions
from .kernel import GRAVITY

ROOTS = (4.730040744862704, 7.853204624095838)
"""Of cos b cosh b = 1, the free-free beam (Blevins, Formulas for Natural Frequency, table 8-1)."""


@dataclass(frozen=True)
class KeyModel:
    """Linear model M p'' + C p' + K p = sum w(x) f(x) of the key; all shapes (n, n)."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    front: float
    back: float
    heaves: bool
    modes: int

    def at(self, x: float) -> np.ndarray:
        """Return the displacement at x (m, from the pin to the back) per coordinate; shape (n,)."""
        pin = np.array([mode_shape(k, 0.0, self.front, self.back) for k in range(self.modes)])
        here = np.array([mode_shape(k, x, self.front, self.back) for k in range(self.modes)])
        if self.heaves:
            return np.concatenate(([1.0, x], here))
        return np.concatenate(([x], here - pin))

    @property
    def rotation(self) -> int:
        """Index of the rotation among the coordinates."""
        return int(self.heaves)

    def frequencies(self) -> np.ndarray:
        """Return the undamped natural frequencies, Hz, ascending; shape (n,)."""
        values = np.linalg.eigvals(np.linalg.solve(self.mass, self.stiffness)).real
        return np.sqrt(np.sort(np.clip(values, 0, None))) / (2 * np.pi)


def mode_shape(k: int, x: float, front: float, back: float) -> float:
    """Return bending mode k of a uniform free-free beam from -front to back, of rms 1."""
    beta = ROOTS[k]
    u = (x + front) / (front + back)
    sigma = (np.cosh(beta) - np.cos(beta)) / (np.sinh(beta) - np.sin(beta))
    even = np.cosh(beta * u) + np.cos(beta * u)
    return float(even - sigma * (np.sinh(beta * u) + np.sin(beta * u)))


def key_model(c: Conditions) -> KeyModel:
    """Return the key's matrices; an infinite heave frequency is a rigid pin."""
    mass, front, back = c.key_mass, c.front_arm, c.back_arm
    bending = _bending_modes(c)
    n = len(bending)
    full = np.diag([mass, c.inertia] + [mass] * n).astype(float)
    full[0, 1] = full[1, 0] = -c.gravity_moment / GRAVITY
    stiffness = np.zeros((n + 2, n + 2))
    damping = np.zeros((n + 2, n + 2))
    for k, (frequency, ratio) in enumerate(bending):
        omega = 2 * np.pi * frequency
        stiffness[k + 2, k + 2] = mass * omega**2
        damping[k + 2, k + 2] = 2 * ratio * mass * omega
    pin = np.array([mode_shape(k, 0.0, front, back) for k in range(n)])
    if np.isfinite(c.heave_frequency):
        omega = 2 * np.pi * c.heave_frequency
        at_pin = np.concatenate(([1.0, 0.0], pin))
        stiffness += mass * omega**2 * np.outer(at_pin, at_pin)
        damping += 2 * c.heave_damping * mass * omega * np.outer(at_pin, at_pin)
        return KeyModel(full, damping, stiffness, front, back, True, n)
    kept = np.vstack([np.concatenate(([0.0], -pin)), np.eye(n + 1)])
    mass_matrix, damping, stiffness = (kept.T @ each @ kept for each in (full, damping, stiffness))
    return KeyModel(mass_matrix, damping, stiffness, front, back, False, n)


def _bending_modes(c: Conditions) -> tuple[tuple[float, float], ...]:
    """Return frequency (Hz) of the free-free key and damping of each mode, at most two."""
    if not np.isfinite(c.bending_frequency):
        return ()
    ratio = (ROOTS[1] / ROOTS[0]) ** 2
    first = ((c.bending_frequency, c.bending_damping),)
    return first + ((c.bending_frequency * ratio, c.bending_damping),) * c.second_mode
