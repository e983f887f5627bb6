"""Plectrum and string for the world: a tabulated law of the jack's height, and its events."""

from dataclasses import dataclass, field

import numpy as np

from analysis.model.predict import rig_pluck
from rig.schema import Rig

TABLE = 2048
"""Cells of the table of the force over the height."""


@dataclass
class PluckEvents:
    """When the world's string was met and let go; s on the world's clock."""

    contacts: list[float] = field(default_factory=list)
    releases: list[float] = field(default_factory=list)


class Plucking:
    """The quasi-static pluck of one string, as the jack's height changes.

    After release the string is out of reach until the jack has come down again: the
    tongue lets the plectrum pass under it.
    """

    def __init__(self, rig: Rig, level: str):
        pluck = rig_pluck(rig, level)
        self.clearance = rig.jack.string_clearance * 1e3
        self.release_height = pluck.release_height * 1e3
        heights = np.linspace(0, pluck.release_height, TABLE + 1)
        self._force = [*pluck.force_on_jack(heights).tolist(), 0.0]
        self._per_mm = TABLE / self.release_height
        self._held = False
        self._released = False
        self.events = PluckEvents()

    def force(self, rise: float, previous: float, time: float, step: float) -> float:
        """Return the string's force [N] on the jack, and note what happened on the way.

        Args:
            rise: mm, of the jack at the end of the step.
            previous: mm, at its start.
            time: s, of the start of the step.
            step: s.
        """
        height = rise - self.clearance
        if not height > 0:  # nor where it is no number, for which the world looks itself
            self._held = self._released = False
            return 0.0
        if self._released:
            return 0.0
        if not self._held:
            self._held = True
            part = (self.clearance - previous) / (rise - previous) if rise != previous else 1.0
            self.events.contacts.append(time + min(max(part, 0.0), 1.0) * step)
        if height > self.release_height:
            self._held, self._released = False, True
            part = (self.clearance + self.release_height - previous) / (rise - previous)
            self.events.releases.append(time + part * step)
            return 0.0
        cell = height * self._per_mm
        low = int(cell)
        return self._force[low] + (cell - low) * (self._force[low + 1] - self._force[low])
