"""An analog-to-digital converter."""

from dataclasses import dataclass

import numpy as np

from sautereau.trajectory.motion import Floats


@dataclass(frozen=True)
class Converter:
    """Rounds volts to its steps, and clips them at its range."""

    range: float
    """V, full scale either way."""
    bits: int

    def convert(self, volts: Floats) -> Floats:
        """Return what it reads [V]."""
        step = 2 * self.range / 2**self.bits
        return np.clip(np.rint(volts / step) * step, -self.range, self.range - step)
