"""Expected force against the finger in a press, with contact and release."""

from dataclasses import dataclass

import numpy as np

from sautereau.trajectory.motion import Floats


@dataclass(frozen=True)
class Expectation:
    """A curve of force over rise, measured or predicted by a model."""

    rise: Floats
    """m, of the jack, increasing; shape (n,)."""
    force: Floats
    """N, of the finger on the key's normal; shape (n,)."""
    contact: float
    """m, rise of the jack at contact."""
    release: float
    """m, rise of the jack at release."""

    def force_at(self, rise: Floats) -> Floats:
        """Return the force [N] at rises of the jack [m]; constant beyond the curve's ends."""
        return np.interp(rise, self.rise, self.force)

    def range_between(self, low: Floats, high: Floats) -> tuple[Floats, Floats]:
        """Return the least and the largest force [N] from rises low to high [m]; any shape."""
        ends = self.force_at(low), self.force_at(high)
        inside = np.searchsorted(self.rise, np.stack([low, high], -1)).ravel()

        def of(choose: np.ufunc, none: float) -> Floats:
            within = choose.reduceat(np.append(self.force, [none, none]), inside)[::2]
            within = np.where(inside[::2] < inside[1::2], within, none)
            return choose(choose(*ends), within.reshape(low.shape))

        return of(np.minimum, np.inf), of(np.maximum, -np.inf)
