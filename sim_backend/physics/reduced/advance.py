"""From one time to another in the reduced engine; compiled.

All that a mode of motion needs is a number that must stay positive. A step at whose end one
is negative is taken again and ends where the first of them vanishes.
"""

import math

from sautereau.sim_backend.physics.reduced.compile import compiled
from sautereau.sim_backend.physics.reduced.locate import (
    hold,
    locate,
)
from sautereau.sim_backend.physics.reduced.state import (
    ANGLE,
    CHATTERS,
    FALLS,
    FINE,
    IDEAL,
    JACK,
    LOST,
    PUSH,
    PUSH_END,
    RISES,
    SLIP,
    SPIN,
    TOUCH,
)
from sautereau.sim_backend.physics.reduced.step import (
    take,
    try_step,
)
from sautereau.sim_backend.physics.reduced.switch import settle, switch

RESOLVED, RATED, LEAST = 3e-6, 1e-3, 1e-13
"""1 and s, share of a speed that the fourth order may bring to a step of so long; it goes with
the step's fourth power, not below the last. What has more of it is divided."""
SHORTEST = 1e-8
"""s, of a step that is divided."""
SWITCHES = 1000
"""Changes within one stretch of time that are no motion any more."""


@compiled
def advance(bench, cells, state, kinds, marks, events, leg, time, end, fresh):
    """Advance a state within a leg from a time to another [s]; return how that went.

    Args:
        bench: The press.
        cells: Of the strings' laws.
        state: Is changed, as are what everything does, the marks and the events.
        kinds: What everything does.
        marks: Room for what must stay positive.
        events: Room for what the strings meet.
        leg: Of the drive; a push is taken off where it ends.
        time: s.
        end: s.
        fresh: 1 where the leg begins, else 0.
    """
    last = end
    if leg[PUSH] > 0.0 and bench[0, PUSH_END] < end:
        end = max(bench[0, PUSH_END], time)
    while True:
        if fresh == 1:
            status = settle(bench, cells, state, kinds, leg, time)
            if status != FINE:
                return status
        status = go_on(bench, cells, state, kinds, marks, events, leg, time, end)
        if status != FINE or end == last:
            return status
        leg[PUSH] = 0.0
        time, end, fresh = end, last, 1


@compiled
def go_on(bench, cells, state, kinds, marks, events, leg, time, end):
    """Advance from a time to another [s] in which the leg stays; return how that went."""
    allowed = max(RESOLVED * ((end - time) / RATED) ** 4, LEAST)
    size, switches = end - time, 0
    while time < end:
        if at_rest(kinds, leg):
            return FINE
        step = min(size, end - time)
        error = try_step(bench, cells, state, kinds, leg, time, step) / allowed
        if error > 1.0 and step > SHORTEST:
            size = max(step * max(0.8 * error**-0.25, 0.1), SHORTEST)
            continue
        if hold(bench, state, kinds, leg, time + step, marks):
            take(state)
            time = end if step == end - time else time + step
            size = step * min(2.0, 0.8 * max(error, 1e-3) ** -0.25)
            if not math.isfinite(state[0, ANGLE] + state[0, SPIN]):
                return LOST
            continue
        time += locate(bench, cells, state, kinds, marks, leg, time, step)
        take(state)
        status = switch(bench, cells, state, kinds, marks, events, leg, time)
        if status != FINE:
            return status
        size = end - time
        switches += 1
        if switches > SWITCHES:
            return CHATTERS
    return FINE


@compiled
def at_rest(kinds, leg):
    """Return whether nothing moves until the leg ends."""
    if kinds[0, SLIP] != 0 or (leg[IDEAL] > 0 and kinds[0, TOUCH] == 0):
        return False
    for k in range(1, len(kinds)):
        if kinds[k, JACK] == FALLS or kinds[k, JACK] == RISES:
            return False
    return True
