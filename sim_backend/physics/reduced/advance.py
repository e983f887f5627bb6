"""Time integration with events in the reduced engine; compiled.

Every mode has guards that stay positive while it lasts. A step at whose end a guard is negative
is repeated, and ends where the first guard vanishes.
"""

import math

from sautereau.sim_backend.physics.reduced import state as ix
from sautereau.sim_backend.physics.reduced.compile import compiled
from sautereau.sim_backend.physics.reduced.locate import (
    evaluate_guards,
    locate,
)
from sautereau.sim_backend.physics.reduced.rows import write_change
from sautereau.sim_backend.physics.reduced.step import (
    accept_step,
    try_step,
)
from sautereau.sim_backend.physics.reduced.switch import change_mode, select_mode

RESOLVED, RATED_STEP, LEAST_ERROR = 3e-6, 1e-3, 1e-13
"""Error control: a step of length `RATED_STEP` [s] may change a speed by the fraction `RESOLVED`
at fourth order; the limit scales with the fourth power of the step, and is at least
`LEAST_ERROR`. A step with a larger error is divided."""
SHORTEST = 1e-8
"""s, shortest divided step."""
MOST_CHANGES = 1000
"""Changes of mode within one interval above which the motion counts as chattering."""


@compiled
def advance(bench, cells, state, modes, guards, events, changes, segment, time, end, new_segment):
    """Advance a state within a drive segment from a time to another [s]; return a status.

    Args:
        bench: Parameters of the press.
        cells: Of the strings' force laws.
        state: Updated in place, as are modes, guards and events.
        modes: Discrete modes.
        guards: Work space for the guards.
        events: Work space for the strings' events.
        changes: Rows before and after each change of mode; see `rows.write_row`.
        segment: Drive segment; a push is removed at its end.
        time: s.
        end: s.
        new_segment: 1 at the start of a drive segment, else 0.
    """
    last = end
    if segment[ix.PUSH] > 0.0 and bench[0, ix.PUSH_END] < end:
        end = max(bench[0, ix.PUSH_END], time)
    while True:
        if new_segment == 1:
            status = select_mode(bench, cells, state, modes, segment, time)
            if status != ix.FINE:
                return status
            write_change(bench, cells, state, modes, segment, time, changes)
        status = advance_segment(
            bench, cells, state, modes, guards, events, changes, segment, time, end
        )
        if status != ix.FINE or end == last:
            return status
        write_change(bench, cells, state, modes, segment, end, changes)
        segment[ix.PUSH] = 0.0
        time, end, new_segment = end, last, 1


@compiled
def advance_segment(bench, cells, state, modes, guards, events, changes, segment, time, end):
    """Advance from a time to another [s] without a change of the drive; return a status."""
    allowed = max(RESOLVED * ((end - time) / RATED_STEP) ** 4, LEAST_ERROR)
    size, count = end - time, 0
    while time < end:
        if at_rest(modes, segment):
            return ix.FINE
        step = min(size, end - time)
        error = try_step(bench, cells, state, modes, segment, time, step) / allowed
        if error > 1.0 and step > SHORTEST:
            size = max(step * max(0.8 * error**-0.25, 0.1), SHORTEST)
            continue
        if evaluate_guards(bench, state, modes, segment, time + step, guards):
            accept_step(state)
            time = end if step == end - time else time + step
            size = step * min(2.0, 0.8 * max(error, 1e-3) ** -0.25)
            if not math.isfinite(state[0, ix.ANGLE] + state[0, ix.ANGULAR_VELOCITY]):
                return ix.LOST
            continue
        time += locate(bench, cells, state, modes, guards, segment, time, step)
        accept_step(state)
        write_change(bench, cells, state, modes, segment, time, changes)
        status = change_mode(bench, cells, state, modes, guards, events, segment, time)
        if status != ix.FINE:
            return status
        write_change(bench, cells, state, modes, segment, time, changes)
        size = end - time
        count += 1
        if count > MOST_CHANGES:
            return ix.CHATTERS
    return ix.FINE


@compiled
def at_rest(modes, segment):
    """Return whether everything is at rest until the drive segment ends."""
    if modes[0, ix.SLIP] != 0 or (segment[ix.IDEAL] > 0 and modes[0, ix.TOUCH] == 0):
        return False
    for k in range(1, len(modes)):
        if modes[k, ix.JACK] == ix.FALLS or modes[k, ix.JACK] == ix.RISES:
            return False
    return True
