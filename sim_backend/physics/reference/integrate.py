"""Integration of a scene's drive, mode by mode."""

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
    first_violated,
    locate,
)
from sautereau.sim_backend.physics.reference.drive_segments import DriveSegment, SegmentSource
from sautereau.sim_backend.physics.reference.equations import Instant, ModeEquations
from sautereau.sim_backend.physics.reference.jack import StringMode
from sautereau.sim_backend.physics.reference.projection import projected, with_fingertip_on_key
from sautereau.sim_backend.physics.reference.switch import (
    force_modes_of,
    resolve_impacts,
    select_mode,
)
from sautereau.sim_backend.physics.reference.system import State, System

MOST_CHANGES = 400
"""Changes of mode between two grid points above which the motion counts as chattering."""
MOST_STEPS = 200_000
"""Steps of the integrator for a complete drive, about 60 s of computing."""
LONGEST_STEP = 1e-3
"""s, longest step of the integrator."""
LEAST_SPACING = 1e-7
"""s, least distance of an additional point from the grid."""

_STRINGS = {
    "contact": StringMode.HELD,
    "contact lost": StringMode.BELOW,
    "release": StringMode.ABOVE,
    "the plectrum falls on the string": StringMode.PASSING,
    "above again": StringMode.ABOVE,
    "return": StringMode.BELOW,
}


@dataclass
class Solution:
    """The integrated motion; the lists correspond element by element."""

    times: list[float] = field(default_factory=list)
    """s."""
    states: list[State] = field(default_factory=list)
    """See `State`."""
    instants: list[Instant] = field(default_factory=list)
    """Motion and forces at those times."""
    segments: list[DriveSegment] = field(default_factory=list)
    """Drive segment at those times."""
    events: PluckEvents = field(default_factory=PluckEvents)
    switches: list[tuple[float, str]] = field(default_factory=list)
    """Every change of mode: time [s] and cause."""


class Integrator:
    """Integrate from event to event.

    Args:
        system: The bench.
        source: Drive segments of the finger.
        grid: s, output times, increasing; the last one is the end.
        tolerance: Dimensionless, relative tolerance of the integrator.
    """

    def __init__(self, system: System, source: SegmentSource, grid: list[float], tolerance: float):
        self.system, self.source, self.grid, self.tolerance = system, source, grid, tolerance
        self.solution = Solution()
        self._next = bisect_right(grid, 0.0)
        self._strings = [StringMode.BELOW] * len(system.jacks)
        self._latest = (0, 0)
        self._steps_done = 0

    def run(self, x: State) -> Solution:
        """Integrate from a state at time 0 to the end of the grid.

        Raises:
            SceneError: The motion diverges or chatters.
        """
        time = 0.0
        try:
            with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
                while segment := self.source.next_segment(time, self._joints(x)):
                    time = segment.start
                    while time < segment.end:
                        time, x = self._advance_mode(segment, time, x)
        except (ArithmeticError, ValueError) as error:
            raise SceneError(
                f"rig {self.system.name}: at {time:.9g} s the reference diverged ({error});"
                " the masses, the stiffness or the damping in the scene are out of its range"
            ) from error
        return self.solution

    def _joints(self, x: State) -> tuple[float, float]:
        return (x[-4], x[-3]) if self.system.arm else (0.0, 0.0)

    def _advance_mode(self, segment: DriveSegment, time: float, x: State) -> tuple[float, State]:
        """Advance to the next event, or to the end of the segment."""
        x = resolve_impacts(self.system, segment, time, x)
        force_modes = force_modes_of(self.system, x, self._strings)
        equations = select_mode(self.system, segment, time, x, force_modes)
        x = projected(equations, time, x)
        event, time, x = self._advance(equations, time, x)
        x = projected(equations, time, x)
        if event:
            self._record_event(event, time, equations, x)
            self._count_event(time, event)
            x = self._state_after(event, equations, x)
        return time, x

    def _advance(
        self, equations: ModeEquations, time: float, x: State
    ) -> tuple[Condition | None, float, State]:
        """Integrate until a condition fails; return the condition, its time and the state there."""
        end = equations.segment.end
        violated = first_violated(conditions(equations, equations.at(time, x)))
        if violated:
            return violated, time, x
        for after, dense in self._steps(equations, time, x, end):
            points = self._grid_between(time, after)
            if not points or points[-1] < after:
                points.append(after)
            before = time
            for t in points:
                state = dense(t)
                now = equations.at(t, state)
                if first_violated(conditions(equations, now)):
                    event, when = locate(equations, dense, before, t)
                    return event, when, dense(when)
                self._keep_grid_point(t, equations, state, now)
                before = t
            time, x = after, dense(after)
        return None, end, x

    def _steps(self, equations: ModeEquations, time: float, x: State, end: float):
        """Yield the end of each step of the integrator, with its dense output."""
        if not equations.moving:
            yield end, lambda t: x
            return
        solver = DOP853(
            lambda t, y: equations.rates(t, y.tolist()),
            time,
            np.array(x),
            end,
            max_step=LONGEST_STEP,
            rtol=self.tolerance,
            atol=self.tolerance * self._scales(),  # pyright: ignore[reportArgumentType]
        )
        while solver.status == "running":
            solver.step()
            self._steps_done += 1
            lost = solver.status == "failed" or not np.isfinite(solver.y).all()
            if lost or self._steps_done > MOST_STEPS:
                raise SceneError(
                    f"rig {self.system.name}: the reference stopped at {solver.t:.9g} s, after"
                    f" {self._steps_done} steps of {MOST_STEPS} at most; the scene is too stiff:"
                    " lower its stiffness or damping"
                )
            yield solver.t, _dense(solver.dense_output())

    def _scales(self):
        """Return the scale of each coordinate and speed [rad, rad/s, m, m/s]."""
        arm = [1e-2, 1e-2, 1e-1, 1e-1] if self.system.arm else []
        return np.array([1e-2, 1e-1] + [1e-3, 1e-2] * len(self.system.jacks) + arm)

    def _grid_between(self, time: float, end: float) -> list[float]:
        last = bisect_right(self.grid, end)
        return self.grid[self._next : last]

    def _keep_grid_point(
        self, time: float, equations: ModeEquations, state: State, now: Instant
    ) -> None:
        if self._next < len(self.grid) and time == self.grid[self._next]:
            self._next += 1
            self._append(time, equations, state, now)

    def _append(self, time: float, equations: ModeEquations, state: State, now: Instant) -> None:
        solution = self.solution
        solution.times.append(time)
        solution.states.append(now.complete(state))
        solution.instants.append(now)
        solution.segments.append(equations.segment)

    def _record_event(
        self, event: Condition, time: float, equations: ModeEquations, x: State
    ) -> None:
        """Record the instant before an event, and the event if it is a string's."""
        now = equations.at(time, x)
        solution = self.solution
        last = solution.times[-1] if solution.times else 0.0
        coming = self.grid[self._next] if self._next < len(self.grid) else math.inf
        if time - last > LEAST_SPACING and coming - time > LEAST_SPACING:
            self._append(time, equations, x, now)
        solution.switches.append((time, event.name))
        lists = {
            "contact": solution.events.contacts,
            "release": solution.events.releases,
            "return": solution.events.returns,
        }
        if event.name in lists:
            force = now.jacks[event.jack].string
            lists[event.name].append(StringEvent(time, event.jack, force))

    def _count_event(self, time: float, event: Condition) -> None:
        """Refuse a key that turns over, and a motion that chatters.

        Raises:
            SceneError: Either of them.
        """
        place, count = self._latest
        count = count + 1 if self._next == place else 1
        self._latest = (self._next, count)
        if event.name == "the key turns over":
            raise SceneError(
                f"rig {self.system.name}: at {time:.6g} s the key has turned by 1.2 rad, the"
                " limit of the model; lower the push, or enable the felt in the scene"
            )
        if count > MOST_CHANGES:
            raise SceneError(
                f"rig {self.system.name}: at {time:.9g} s the motion chatters: more than"
                f" {MOST_CHANGES} changes of mode between two grid points, the last because"
                f" {event.name}; the reference cannot solve that, change the scene's forces"
            )

    def _state_after(self, event: Condition, equations: ModeEquations, x: State) -> State:
        """Return the state after an event, before any impact."""
        k = event.jack
        if event.name in _STRINGS:
            self._strings[k] = _STRINGS[event.name]
        elif event.name == "the jack stops":
            x[3 + 2 * k] = 0.0
        elif event.name == "contact of key and rail":
            x[0] = 0.0
        elif event.name == "the key stops":
            x[1] = 0.0
            if self.system.arm and equations.mode.touching:
                x = with_fingertip_on_key(self.system.arm, x)
        return x


def _dense(interpolant: DenseOutput) -> Callable[[float], State]:
    return lambda time: interpolant(time).tolist()
