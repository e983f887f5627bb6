"""The drive of a scene, integrated mode by mode."""

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import DOP853, DenseOutput

from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.events import PluckEvents, StringEvent
from sautereau.sim_backend.physics.reference.conditions import (
    Condition,
    conditions,
    first_broken,
    locate,
)
from sautereau.sim_backend.physics.reference.drive_segments import Hand, Leg
from sautereau.sim_backend.physics.reference.equations import Instant, Stretch
from sautereau.sim_backend.physics.reference.jack import StringState
from sautereau.sim_backend.physics.reference.projection import pinned, settled
from sautereau.sim_backend.physics.reference.switch import begin, meeting_of, strike
from sautereau.sim_backend.physics.reference.system import State, System

SWITCHES = 400
"""Changes of mode between two points of the grid that are no motion any more."""
STEPS = 200_000
"""Steps of the integrator for a whole drive, some 60 s of computing."""
LONGEST = 1e-3
"""s, step of the integrator."""
APART = 1e-7
"""s, between the points that are kept."""

_STRINGS = {
    "contact": StringState.HELD,
    "held no more": StringState.BELOW,
    "release": StringState.ABOVE,
    "the plectrum falls on the string": StringState.PASSING,
    "above again": StringState.ABOVE,
    "return": StringState.BELOW,
}


@dataclass
class Solution:
    """All that was integrated; rows belong together."""

    times: list[float] = field(default_factory=list)
    """s."""
    states: list[State] = field(default_factory=list)
    """See `State`."""
    instants: list[Instant] = field(default_factory=list)
    """Motion and forces there."""
    legs: list[Leg] = field(default_factory=list)
    """What the finger did there."""
    events: PluckEvents = field(default_factory=PluckEvents)
    switches: list[tuple[float, str]] = field(default_factory=list)
    """Every change of mode: s, and why."""


class Integrator:
    """Goes from event to event.

    Args:
        system: The bench.
        hand: What the finger does.
        grid: s, where the motion is wanted, increasing; the last one is the end.
        tolerance: 1, of each step of the integrator.
    """

    def __init__(self, system: System, hand: Hand, grid: list[float], tolerance: float):
        self.system, self.hand, self.grid, self.tolerance = system, hand, grid, tolerance
        self.solution = Solution()
        self._next = bisect_right(grid, 0.0)
        self._strings = [StringState.BELOW] * len(system.jacks)
        self._latest = (0, 0)
        self._steps_done = 0

    def run(self, x: State) -> Solution:
        """Integrate from a state at time 0 to the end of the grid.

        Raises:
            SceneError: The motion cannot be followed.
        """
        time = 0.0
        try:
            with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
                while leg := self.hand.leg(time, self._joints(x)):
                    time = leg.start
                    while time < leg.end:
                        time, x = self._stretch(leg, time, x)
        except (ArithmeticError, ValueError) as error:
            raise SceneError(
                f"rig {self.system.name}: at {time:.9g} s the reference lost its numbers ({error});"
                " the masses, the stiffness or the damping in the scene are out of its range"
            ) from error
        return self.solution

    def _joints(self, x: State) -> tuple[float, float]:
        return (x[-4], x[-3]) if self.system.arm else (0.0, 0.0)

    def _stretch(self, leg: Leg, time: float, x: State) -> tuple[float, State]:
        """Go on to the next event, or to the end of the leg."""
        x = strike(self.system, leg, time, x)
        meeting = meeting_of(self.system, x, self._strings)
        stretch = begin(self.system, leg, time, x, meeting)
        x = settled(stretch, time, x)
        event, time, x = self._advance(stretch, time, x)
        x = settled(stretch, time, x)
        if event:
            self._note(event, time, stretch, x)
            self._count(time, event)
            x = self._after(event, stretch, x)
        return time, x

    def _advance(
        self, stretch: Stretch, time: float, x: State
    ) -> tuple[Condition | None, float, State]:
        """Integrate until a condition fails; return it, when, and the state there."""
        end = stretch.leg.end
        broken = first_broken(conditions(stretch, stretch.at(time, x)))
        if broken:
            return broken, time, x
        for after, dense in self._steps(stretch, time, x, end):
            points = self._grid_between(time, after)
            if not points or points[-1] < after:
                points.append(after)
            before = time
            for t in points:
                state = dense(t)
                now = stretch.at(t, state)
                if first_broken(conditions(stretch, now)):
                    event, when = locate(stretch, dense, before, t)
                    return event, when, dense(when)
                self._keep(t, stretch, state, now)
                before = t
            time, x = after, dense(after)
        return None, end, x

    def _steps(self, stretch: Stretch, time: float, x: State, end: float):
        """Yield the ends of the integrator's steps with the motion in between."""
        if not stretch.moving:
            yield end, lambda t: x
            return
        solver = DOP853(
            lambda t, y: stretch.rates(t, y.tolist()),
            time,
            np.array(x),
            end,
            max_step=LONGEST,
            rtol=self.tolerance,
            atol=self.tolerance * self._scales(),  # pyright: ignore[reportArgumentType]
        )
        while solver.status == "running":
            solver.step()
            self._steps_done += 1
            lost = solver.status == "failed" or not np.isfinite(solver.y).all()
            if lost or self._steps_done > STEPS:
                raise SceneError(
                    f"rig {self.system.name}: the reference stopped at {solver.t:.9g} s, after"
                    f" {self._steps_done} steps of {STEPS} at most; the scene is stiffer than it"
                    " can follow: lower the stiffness or damping in it"
                )
            yield solver.t, _dense(solver.dense_output())

    def _scales(self):
        """Return a small motion of each coordinate and speed: rad, rad/s, m, m/s."""
        arm = [1e-2, 1e-2, 1e-1, 1e-1] if self.system.arm else []
        return np.array([1e-2, 1e-1] + [1e-3, 1e-2] * len(self.system.jacks) + arm)

    def _grid_between(self, time: float, end: float) -> list[float]:
        last = bisect_right(self.grid, end)
        return self.grid[self._next : last]

    def _keep(self, time: float, stretch: Stretch, state: State, now: Instant) -> None:
        if self._next < len(self.grid) and time == self.grid[self._next]:
            self._next += 1
            self._append(time, stretch, state, now)

    def _append(self, time: float, stretch: Stretch, state: State, now: Instant) -> None:
        solution = self.solution
        solution.times.append(time)
        solution.states.append(now.complete(state))
        solution.instants.append(now)
        solution.legs.append(stretch.leg)

    def _note(self, event: Condition, time: float, stretch: Stretch, x: State) -> None:
        """Keep the instant before an event, and the event if it is a string's."""
        now = stretch.at(time, x)
        solution = self.solution
        last = solution.times[-1] if solution.times else 0.0
        coming = self.grid[self._next] if self._next < len(self.grid) else math.inf
        if time - last > APART and coming - time > APART:
            self._append(time, stretch, x, now)
        solution.switches.append((time, event.name))
        lists = {
            "contact": solution.events.contacts,
            "release": solution.events.releases,
            "return": solution.events.returns,
        }
        if event.name in lists:
            force = now.jacks[event.jack].string
            lists[event.name].append(StringEvent(time, event.jack, force))

    def _count(self, time: float, event: Condition) -> None:
        """Refuse what changes without end."""
        place, count = self._latest
        count = count + 1 if self._next == place else 1
        self._latest = (self._next, count)
        if event.name == "the key turns over":
            raise SceneError(
                f"rig {self.system.name}: at {time:.6g} s the key has turned by 1.2 rad, where it"
                " is no key any more; lower the push, or let the scene have its felt"
            )
        if count > SWITCHES:
            raise SceneError(
                f"rig {self.system.name}: at {time:.9g} s the motion changed more than {SWITCHES}"
                f" times within one point of its grid, at last because {event.name}; it chatters,"
                " and the reference has no solution for that"
            )

    def _after(self, event: Condition, stretch: Stretch, x: State) -> State:
        """Return the state after an event, which no impact changes yet."""
        k = event.jack
        if event.name in _STRINGS:
            self._strings[k] = _STRINGS[event.name]
        elif event.name == "the jack stops":
            x[3 + 2 * k] = 0.0
        elif event.name == "the key meets the rail":
            x[0] = 0.0
        elif event.name == "the key stops":
            x[1] = 0.0
            if self.system.arm and stretch.mode.touch:
                x = pinned(self.system.arm, x)
        return x


def _dense(interpolant: DenseOutput) -> Callable[[float], State]:
    return lambda time: interpolant(time).tolist()
