"""A spring string under its plectrum: the four modes of docs/stand-in.md, in mm and N."""

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.choirs import choir_pluck
from sautereau.rig.instrument import Choir
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.events import PluckEvents, StringEvent
from sautereau.sim_backend.scene import Scene

TABLE = 2048  # Cells of the table of force over height
MM = 1e3


class StringForce(Protocol):
    """The force of a string, through its plectrum, on a jack."""

    low: float
    """mm, rise of the jack below which the present mode ends; -inf where no rise ends it."""
    high: float
    """mm, rise of the jack above which the present mode ends; inf where no rise ends it."""
    stiffness: float
    """N/mm, largest stiffness against the jack in the present mode."""
    stiffest: float
    """N/mm, largest in any mode."""
    steady: bool
    """Whether the force depends on the jack's rise and on the mode alone."""

    def force(self, rise: float, previous: float, time: float, step: float, /) -> float:
        """Return the force [N] on the jack at the end of a step, downwards.

        Call once for every step of the world, in order; the steps need not be equal.

        Args:
            rise: mm, of the jack at the end of the step.
            previous: mm, at its start.
            time: s of simulated time, at its start.
            step: s.
        """
        ...

    def cross(self, upwards: bool, time: float) -> None:
        """Enter the next mode: the jack has reached `high`, or else `low`.

        Args:
            upwards: Whether it has reached `high`.
            time: s of simulated time.
        """
        ...


class Plucking:
    """The quasi-static string of one choir; the engine locates the end of each mode.

    Args:
        scene: Level of the plectrum; whether the tongue is enabled.
        number: Of the choir, 0 for the first.
        events: List to which contacts, releases and returns are appended.

    Raises:
        SceneError: The level has no pluck for this choir.
    """

    steady = True

    def __init__(self, choir: Choir, scene: Scene, number: int, events: PluckEvents):
        try:
            pluck = choir_pluck(choir, scene.plectrum)
        except ModelError as error:
            at = f"more_choirs[{number - 1}]." if number else ""
            raise SceneError(f"{at}{error}") from error
        self.number = number
        self.events = events
        self.clearance = choir.jack.string_clearance * MM
        self.release_height = pluck.release_height * MM
        heights = np.linspace(0, pluck.release_height, TABLE + 1)
        force = pluck.force_on_jack(heights)
        self._force = [*force.tolist(), float(force[-1])]
        self._rises = [*np.diff(force).tolist(), 0.0]
        self._per_mm = TABLE / self.release_height
        self._steepest = float(np.abs(np.diff(force)).max()) * self._per_mm
        self._travel, self._moment, self._turning, self._lever = _tongue(choir, scene)
        self._yielding = self._turning / self._lever**2 if self._travel else 0.0
        self.stiffest = max(self._steepest, self._yielding)
        self._go_below()

    def cross(self, upwards: bool, time: float) -> None:
        """Enter the next mode; see `StringForce`."""
        self._upwards[upwards](time)

    def _go_below(self, time: float = 0.0) -> None:
        self._enter(_nothing, -math.inf, self.clearance, 0.0, self._never, self._contact)

    def _go_above(self, time: float) -> None:
        self._enter(_nothing, self.clearance, math.inf, 0.0, self._reach_from_above, self._never)

    def _contact(self, time: float) -> None:
        self.events.contacts.append(StringEvent(time, self.number, self._force[0]))
        top = self.clearance + self.release_height
        self._enter(self._held, self.clearance, top, self._steepest, self._go_below, self._release)

    def _release(self, time: float) -> None:
        self.events.releases.append(StringEvent(time, self.number, self._force[TABLE]))
        self._go_above(time)

    def _reach_from_above(self, time: float) -> None:
        if self._travel == 0:
            self._return(time)
            return
        low, high = self.clearance - self._travel, self.clearance
        self._enter(self._passing, low, high, self._yielding, self._return, self._go_above)

    def _return(self, time: float) -> None:
        force = self._passing(self.clearance - self._travel)
        self.events.returns.append(StringEvent(time, self.number, force))
        self._go_below()

    def _never(self, time: float) -> None:
        raise SceneError(
            f"choir {self.number}: at {time:.6g} s the jack left its string's mode on a side where"
            " the mode has no end; lower the scene's step"
        )

    def _enter(
        self,
        law: Callable[[float, float, float, float], float],
        low: float,
        high: float,
        stiffness: float,
        at_low: Callable[[float], None],
        at_high: Callable[[float], None],
    ) -> None:
        self.force, self.low, self.high, self.stiffness = law, low, high, stiffness
        self._upwards = (at_low, at_high)

    def _held(self, rise: float, previous: float, time: float, step: float) -> float:
        cell = (rise - self.clearance) * self._per_mm
        low = min(max(int(cell), 0), TABLE)
        return self._force[low] + (cell - low) * self._rises[low]

    def _passing(
        self, rise: float, previous: float = 0.0, time: float = 0.0, step: float = 0.0
    ) -> float:
        if self._travel == 0:
            return 0.0
        drop = self.clearance - rise
        return -(self._moment + self._turning * drop / self._lever) / self._lever


def _tongue(choir: Choir, scene: Scene) -> tuple[float, float, float, float]:
    """Return travel [mm], bristle moment [N mm] and stiffness [N mm/rad], and lever [mm]."""
    tongue, plectrum = choir.jack.tongue, choir.plectrum
    if not scene.tongue or tongue is None:
        return 0.0, 0.0, 0.0, 0.0
    lever = (plectrum.length - plectrum.overlap) * MM
    travel = lever * plectrum.overlap / tongue.pivot
    return travel, tongue.bristle_moment * MM, tongue.bristle_stiffness * MM, lever


def _nothing(rise: float, previous: float, time: float, step: float) -> float:
    return 0.0
