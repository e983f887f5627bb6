"""A spring string under its plectrum: the four modes of docs/stand-in.md, in mm and N."""

from bisect import bisect_right

import numpy as np

from sautereau.rig.instrument import Choir
from sautereau.sim_backend.physics import structures as ix
from sautereau.sim_backend.physics.events import PluckEvents, StringEvent
from sautereau.sim_backend.physics.parameters import jack_of
from sautereau.sim_backend.physics.rigid.bodies import MM
from sautereau.sim_backend.scene import Scene


class Plucking:
    """The quasi-static string of one choir; the engine locates the end of each mode.

    Args:
        scene: Level of the plectrum; whether the tongue is enabled.
        number: Of the choir, 0 for the first.
        events: List to which contacts, releases and returns are appended.

    Raises:
        SceneError: The level has no pluck for this choir.
    """

    low: float
    """mm, rise of the jack below which the present mode ends; -inf where no rise ends it."""
    high: float
    """mm, rise of the jack above which the present mode ends; inf where no rise ends it."""
    stiffness: float
    """N/mm, largest stiffness against the jack in the present mode."""
    stiffest: float
    """N/mm, largest in any mode."""
    steady = True
    """Whether the force depends on the jack's rise and on the mode alone."""

    def __init__(self, choir: Choir, scene: Scene, number: int, events: PluckEvents):
        jack, cells = jack_of(scene, choir, number)
        self.number, self.events = number, events
        self.clearance = float(jack["clearance"]) * MM
        self._ranges = ranges = (jack["range"] * MM).tolist()
        # Here the string is held in one mode, and its first slip is no event.
        ranges[ix.STUCK][1] = ranges[ix.SLIDING][0] = ranges[ix.SLIDING][1]
        self._starts = (cells[:, 0] * MM).tolist()
        cubics = cells[:, 1:] / MM ** np.arange(4)
        self._cubics = cubics.tolist()
        self._tongue = float(jack["tongue_force"]), float(jack["tongue_stiffness"]) / MM
        lengths = np.diff([*self._starts, ranges[ix.STUCK][1] - self.clearance])
        ends = cubics[:, 1] + lengths * (2 * cubics[:, 2] + 3 * lengths * cubics[:, 3])
        self._stiffnesses = {
            ix.STUCK: float(np.abs([cubics[:, 1], ends]).max()),
            ix.PASSING: self._tongue[1],
        }
        self.stiffest = max(self._stiffnesses.values())
        self._enter(ix.BELOW)

    def force(self, rise: float, previous: float, time: float, step: float) -> float:
        """Return the force [N] on the jack at the end of a step, downwards.

        Call once for every step of the world, in order; the steps need not be equal.

        Args:
            rise: mm, of the jack at the end of the step.
            previous: mm, at its start.
            time: s of simulated time, at its start.
            step: s.
        """
        if self._state == ix.STUCK:
            height = rise - self.clearance
            cell = max(0, bisect_right(self._starts, height) - 1)
            u, (c0, c1, c2, c3) = height - self._starts[cell], self._cubics[cell]
            return c0 + u * (c1 + u * (c2 + u * c3))
        if self._state == ix.PASSING:
            return -(self._tongue[0] + self._tongue[1] * (self.clearance - rise))
        return 0.0

    def cross(self, upwards: bool, time: float) -> None:
        """Enter the next mode with a range of rises: the jack has reached `high`, or else `low`.

        Args:
            upwards: Whether it has reached `high`.
            time: s of simulated time.
        """
        following, begins = (ix.RISEN, ix.RISEN_EVENT) if upwards else (ix.FALLEN, ix.FALLEN_EVENT)
        force = Plucking.force(self, self._ranges[self._state][upwards], 0.0, time, 0.0)
        while True:
            event = begins[self._state]
            if event != ix.NO_EVENT:
                self._report(event, time, force)
            self._enter(following[self._state])
            if self.low < self.high:
                return

    def _report(self, event: int, time: float, force: float) -> None:
        lists = self.events.contacts, self.events.releases, self.events.returns
        lists[event].append(StringEvent(time, self.number, force))

    def _enter(self, state: int) -> None:
        self._state, (self.low, self.high) = state, self._ranges[state]
        self.stiffness = self._stiffnesses.get(state, 0.0)
