"""Searches for the home switch and the encoder's index: FE, FI and HM.

A search is a sequence of legs. Each leg is a `Ramp` that ends by itself, or as soon as a sensor
that is read at the start of every sample has found what it looks for.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

from sautereau.sim_backend.devices.galil.axis import Axis
from sautereau.sim_backend.devices.galil.motion import (
    SAMPLES_PER_SECOND,
    Profile,
    Ramp,
    StopCode,
    brake,
    jog,
    trapezoid,
)


class Leg(NamedTuple):
    """A piece of a search."""

    pieces: list[tuple[float, float]]
    """Pieces of the `Ramp` that the axis follows."""
    found: Callable[[], bool] | None = None
    """What ends it before its end."""
    target: float | None = None
    """Counts, of its end."""


class Search(Profile):
    """The execution of a search's legs; ends at rest.

    Args:
        legs: Computed one after the other, from the axis's state then.
        code: Stop code of its end.
        homes: Whether its end becomes position 0.
    """

    def __init__(self, axis: Axis, legs: Iterator[Leg], code: StopCode, *, homes: bool) -> None:
        self.code = StopCode.RUNNING
        self.done = False
        self.homes = homes
        self._axis, self._legs, self._end = axis, legs, code
        self._next()

    def step(self) -> tuple[float, float]:
        axis = self._axis
        while not self.done and (self._ramp.done or (self._found is not None and self._found())):
            self._next()
        if self.done:
            return axis.position, 0.0
        return self._ramp.step()

    def _next(self) -> None:
        leg = next(self._legs, None)
        if leg is None:
            self.done, self.code = True, self._end
            return
        axis = self._axis
        self._found = leg.found
        self._ramp = Ramp(axis.position, axis.velocity, leg.pieces, StopCode.RUNNING, leg.target)


def _jog(axis: Axis, speed: float, found: Callable[[], bool]) -> Leg:
    return Leg(jog(axis.velocity, speed, axis.rate("AC"), axis.rate("DC")), found)


def _stop(axis: Axis) -> Leg:
    return Leg(brake(axis.velocity, axis.rate("DC")))


def find_edge(axis: Axis, home: Callable[[], bool]) -> Iterator[Leg]:
    """FE: move at SP until the home input changes; backward if it is 1."""
    start = home()
    yield _jog(axis, axis.speed("SP") * (-1 if start else 1), lambda: home() != start)
    yield _stop(axis)


def find_index(axis: Axis, speed: float) -> Iterator[Leg]:
    """FI: move until the index passes, then back to it at HV."""
    axis.arm_latch()
    yield _jog(axis, speed, lambda: axis.latched is not None)
    yield _stop(axis)
    if axis.latched is None:
        return
    way = axis.latched - axis.position
    pieces = trapezoid(way, axis.speed("HV"), axis.rate("AC"), axis.rate("DC"))
    yield Leg(pieces, target=float(axis.latched))


def go_home(axis: Axis, home: Callable[[], bool]) -> Iterator[Leg]:
    """HM: find the edge, approach it again at HV and stop there at once, then find the index."""
    start = home()
    yield from find_edge(axis, home)
    back = axis.speed("HV") * (1 if start else -1)
    yield _jog(axis, back, lambda: home() == start)
    axis.velocity = 0.0
    yield from find_index(axis, axis.speed("HV"))


def begin_search(axis: Axis, home: Callable[[], bool]) -> None:
    """Start HM, FE or FI on an axis; ``home`` reads the home input."""
    if axis.mode == "HM":
        search = Search(axis, go_home(axis, home), StopCode.HOMED, homes=True)
    elif axis.mode == "FE":
        search = Search(axis, find_edge(axis, home), StopCode.EDGE_FOUND, homes=False)
    else:
        legs = find_index(axis, axis.jog_speed / SAMPLES_PER_SECOND)
        search = Search(axis, legs, StopCode.HOMED, homes=True)
    axis.start(search)
    axis.mode = "PR"
