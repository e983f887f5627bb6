"""What a press is expected to meet: the force against the finger, contact and release."""

from dataclasses import dataclass

import numpy as np

from trajectory.motion import Floats


@dataclass(frozen=True)
class Expectation:
    """A force-against-depression curve, measured once or predicted by a model."""

    rise: Floats
    """m, of the jack, increasing; shape (n,)."""
    force: Floats
    """N, of the finger on the key's normal; shape (n,)."""
    contact: float
    """m, rise of the jack at which the string is met."""
    release: float
    """m, rise of the jack at which the string is let go."""

    def force_at(self, rise: Floats) -> Floats:
        """Return the force [N] at rises of the jack [m]; held beyond the curve's ends."""
        return np.interp(rise, self.rise, self.force)
