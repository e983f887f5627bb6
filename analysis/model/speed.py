"""The speed of a jack as a function of its rise."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from sautereau.analysis.model.plectrum.base import Floats


@dataclass(frozen=True)
class JackSpeed:
    """Speed and acceleration of a jack at increasing rises; arrays of shape (n,).

    Below the first rise and above the last both are as there.
    """

    rise: Floats
    """m."""
    speed: Floats
    """m/s, above 0."""
    acceleration: Floats
    """m/s^2."""

    @classmethod
    def constant(cls, speed: float) -> Self:
        """Return a constant speed [m/s]."""
        return cls(np.zeros(1), np.array([speed]), np.zeros(1))

    def at(self, rise: Floats) -> tuple[Floats, Floats]:
        """Return speed [m/s] and acceleration [m/s^2] at rises [m]."""
        return (
            np.interp(rise, self.rise, self.speed),
            np.interp(rise, self.rise, self.acceleration),
        )

    def scaled(self, factor: float) -> Self:
        """Return the motion with all rises multiplied by a factor."""
        return type(self)(factor * self.rise, factor * self.speed, factor * self.acceleration)

    def followed_by(self, later: Self) -> Self:
        """Return this speed, and beyond its last rise a later one."""
        beyond = later.rise > self.rise[-1]
        return type(self)(
            np.concatenate([self.rise, later.rise[beyond]]),
            np.concatenate([self.speed, later.speed[beyond]]),
            np.concatenate([self.acceleration, later.acceleration[beyond]]),
        )

    def time(self, rise: Floats) -> Floats:
        """Return the times [s] of increasing rises [m], the first of which is at 0 s."""
        slowness = 1 / self.at(rise)[0]
        steps = (slowness[1:] + slowness[:-1]) / 2 * np.diff(rise)
        return np.concatenate([[0.0], np.cumsum(steps)])
