"""Controller samples and complete presses of the reduced engine; compiled."""

import math

from sautereau.sim_backend.physics.reduced import state as ix
from sautereau.sim_backend.physics.reduced.advance import advance
from sautereau.sim_backend.physics.reduced.compile import compiled, entry
from sautereau.sim_backend.physics.reduced.forces import fingertip, jack_kinematics
from sautereau.sim_backend.physics.reduced.rows import write_row


@compiled
def rest(bench, state, modes, segment):
    """Set a state to rest: the key on its rail, or on an ideal finger above that.

    Args:
        bench: Parameters of the press.
        state: Updated in place.
        segment: The first drive segment.
    """
    angle = 0.0
    if segment[ix.IDEAL] > 0:
        tip_angle, _, _, _ = fingertip(segment, segment[ix.START])
        angle = max(angle, tip_angle)
    state.fill(0.0)
    modes.fill(0)
    state[0, ix.ANGLE] = angle
    modes[0, ix.LEAVING_JACK] = -1
    for k in range(1, len(bench)):
        state[k, ix.RISE], _, _ = jack_kinematics(bench[k, ix.ARM], bench[0, ix.HEIGHT], angle)
        modes[k, ix.JACK] = ix.STANDS


@entry
def play_sample(
    bench, cells, state, modes, guards, events, changes, segment, time, end, rows, new_segment
):
    """Advance by a controller sample, in as many steps as there are rows.

    Args:
        bench: Parameters of the press.
        cells: Of the strings' force laws.
        state: Updated in place, as are modes and events.
        modes: Discrete modes.
        guards: Work space for the guards.
        events: Work space for the strings' events.
        changes: Rows before and after each change of mode, as those below.
        segment: Drive segment; a push is removed at its end.
        time: s, start of the sample.
        end: s, end of the sample.
        rows: Time, angle, angular velocity, rise of the first jack, forces of finger and strings
            at the end of each step; shape (steps, 6).
        new_segment: 2 at the start of the press, from rest; 1 at the start of any other drive
            segment; else 0.
    """
    modes[0, ix.COUNT] = modes[0, ix.CHANGES] = 0
    if new_segment == 2:
        rest(bench, state, modes, segment)
    steps = len(rows)
    step = (end - time) / steps
    for j in range(steps):
        step_start, step_end = time + j * step, end if j == steps - 1 else time + (j + 1) * step
        new = 1 if j == 0 and new_segment > 0 else 0
        status = advance(
            bench, cells, state, modes, guards, events, changes, segment, step_start, step_end, new
        )
        if status != ix.FINE:
            return status
        write_row(bench, cells, state, modes, segment, step_end, rows[j])
    return ix.FINE


@entry
def play_presses(
    benches,
    cells,
    first,
    last,
    state,
    modes,
    guards,
    events,
    segment,
    cubics,
    samples,
    timing,
    found,
    status,
):
    """Simulate complete presses and record each string's first contact and release.

    Args:
        benches: Parameters of all presses; shape (presses, 1 + choirs, NUMBERS).
        cells: Of the strings' force laws.
        first: Index of the first press.
        last: Index after the last press.
        state: Work space for a state.
        modes: Work space for the modes.
        guards: Work space for the guards.
        events: Work space for the strings' events.
        segment: Work space for a drive segment, with `IDEAL` and the linkage set.
        cubics: rad, joints of an ideal finger over each controller sample; (samples, 8).
        samples: Controller samples of each press; shape (presses,).
        timing: Controller period [s], and steps per period.
        found: Contact and release [s], force at release [N], speed of the jack there [m/s];
            shape (presses, choirs, 4); initially infinite, as it stays without the event.
        status: Of each press; shape (presses,).
    """
    period, steps = timing
    step = period / steps
    ideal = segment[ix.IDEAL] > 0
    for i in range(first, last):
        if status[i] != ix.FINE:
            continue
        bench = benches[i]
        segment[ix.START], segment[ix.PERIOD], segment[ix.PUSH] = 0.0, period, bench[0, ix.PUSHES]
        for c in range(8):
            segment[ix.CUBICS + c] = cubics[0, c]
        rest(bench, state, modes, segment)
        result = ix.FINE
        for sample in range(samples[i]):
            time = sample * period
            if ideal:
                segment[ix.START] = time
                for c in range(8):
                    segment[ix.CUBICS + c] = cubics[sample, c]
            for j in range(steps):
                if result != ix.FINE:
                    break
                step_start, end = time + j * step, time + (j + 1) * step
                if j == steps - 1:
                    end = (sample + 1) * period
                new = 1 if j == 0 and (ideal or sample == 0) else 0
                result = advance(
                    bench, cells, state, modes, guards, events, found[0, :0], segment,
                    step_start, end, new,
                )  # fmt: skip
                keep_first_events(modes, events, found[i])
        status[i] = result


@compiled
def keep_first_events(modes, events, found):
    """Copy the first event of each kind, and clear the list of events."""
    for e in range(min(modes[0, ix.COUNT], ix.EVENTS)):
        event = events[e]
        kind, k = int(event[ix.KIND]), int(event[ix.CHOIR])
        if kind == ix.CONTACT and found[k, 0] == math.inf:
            found[k, 0] = event[ix.TIME]
        elif kind == ix.RELEASE and found[k, 1] == math.inf:
            found[k, 1], found[k, 2], found[k, 3] = (
                event[ix.TIME],
                event[ix.FORCE],
                event[ix.JACK_SPEED],
            )
    modes[0, ix.COUNT] = 0
