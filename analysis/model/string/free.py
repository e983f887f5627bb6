"""The free string: its motion and its force on the bridge at any later time."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.string.string import ModalState, ModalString
from sautereau.rig.progress import tracked

PART = 10_000  # Instants that are computed together, to limit memory


@dataclass(frozen=True)
class FreeString:
    """A freely vibrating string; times in s from its release."""

    string: ModalString
    state: ModalState
    """State of the moving modes at time 0."""

    def motion(self, time: ArrayLike, place: float | None = None) -> tuple[Floats, Floats]:
        """Return displacement [m] and velocity [m/s] along x and z, shapes (n, 2).

        Args:
            time: s, shape (n,).
            place: m, from the nut; None for the plucking point.
        """
        parts = [
            [self.string.displacement(coordinates, place).T for coordinates in part]
            for part in self._parts(time)
        ]
        q, v = zip(*parts, strict=True)
        return np.concatenate(q), np.concatenate(v)

    def bridge_force(self, time: ArrayLike) -> Floats:
        """Return the string's force [N] on the bridge along x and z, shape (n, 2).

        Args:
            time: s, shape (n,).
        """
        return np.concatenate([self.string.bridge_force(p.q).T for p in self._parts(time)])

    def _parts(self, time: ArrayLike) -> Iterator[ModalState]:
        """Yield the coordinates in parts of `PART` instants."""
        time = np.atleast_1d(np.asarray(time, float))
        for part in tracked(np.split(time, range(PART, len(time), PART))):
            yield self.string.free(self.state, part)
