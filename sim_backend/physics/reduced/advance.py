"""From one time to another in the reduced engine; compiled.

All that a mode of motion needs is a number that must stay positive. A step at whose end one
is negative is taken again and ends where the first of them vanishes.
"""

import math

from sautereau.sim_backend.physics.reduced.compile import compiled
from sautereau.sim_backend.physics.reduced.locate import (
    evaluate_guards,
    locate,
)
from sautereau.sim_backend.physics.reduced.state import (
    ANGLE,
    ANGULAR_VELOCITY,
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
    TOUCH,
)
from sautereau.sim_backend.physics.reduced.step import (
    accept_step,
    try_step,
)
from sautereau.sim_backend.physics.reduced.switch import change_mode, select_mode

RESOLVED, RATED_STEP, LEAST_ERROR = 3e-6, 1e-3, 1e-13
"""1 and s, share of a speed that the fourth order may bring to a step of so long; it goes with
the step's fourth power, not below the last. What has more of it is divided."""
SHORTEST = 1e-8
"""s, of a step that is divided."""
MOST_CHANGES = 1000
"""Changes within one stretch of time that are no motion any more."""


@compiled
def advance(bench, cells, state, modes, guards, events, segment, time, end, new_segment):
    """Advance a state within a leg from a time to another [s]; return how that went.

    Args:
        bench: The press.
        cells: Of the strings' laws.
        state: Is changed, as are what everything does, the marks and the events.
        modes: What everything does.
        guards: Room for what must stay positive.
        events: Room for what the strings meet.
        segment: Of the drive; a push is taken off where it ends.
        time: s.
        end: s.
        new_segment: 1 where the leg begins, else 0.
    """
    last = end
    if segment[PUSH] > 0.0 and bench[0, PUSH_END] < end:
        end = max(bench[0, PUSH_END], time)
    while True:
        if new_segment == 1:
            status = select_mode(bench, cells, state, modes, segment, time)
            if status != FINE:
                return status
        status = advance_segment(bench, cells, state, modes, guards, events, segment, time, end)
        if status != FINE or end == last:
            return status
        segment[PUSH] = 0.0
        time, end, new_segment = end, last, 1


@compiled
def advance_segment(bench, cells, state, modes, guards, events, segment, time, end):
    """Advance from a time to another [s] in which the leg stays; return how that went."""
    allowed = max(RESOLVED * ((end - time) / RATED_STEP) ** 4, LEAST_ERROR)
    size, changes = end - time, 0
    while time < end:
        if at_rest(modes, segment):
            return FINE
        step = min(size, end - time)
        error = try_step(bench, cells, state, modes, segment, time, step) / allowed
        if error > 1.0 and step > SHORTEST:
            size = max(step * max(0.8 * error**-0.25, 0.1), SHORTEST)
            continue
        if evaluate_guards(bench, state, modes, segment, time + step, guards):
            accept_step(state)
            time = end if step == end - time else time + step
            size = step * min(2.0, 0.8 * max(error, 1e-3) ** -0.25)
            if not math.isfinite(state[0, ANGLE] + state[0, ANGULAR_VELOCITY]):
                return LOST
            continue
        time += locate(bench, cells, state, modes, guards, segment, time, step)
        accept_step(state)
        status = change_mode(bench, cells, state, modes, guards, events, segment, time)
        if status != FINE:
            return status
        size = end - time
        changes += 1
        if changes > MOST_CHANGES:
            return CHATTERS
    return FINE


@compiled
def at_rest(modes, segment):
    """Return whether nothing moves until the leg ends."""
    if modes[0, SLIP] != 0 or (segment[IDEAL] > 0 and modes[0, TOUCH] == 0):
        return False
    for k in range(1, len(modes)):
        if modes[k, JACK] == FALLS or modes[k, JACK] == RISES:
            return False
    return True
