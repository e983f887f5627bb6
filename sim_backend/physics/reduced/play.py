"""Controller samples and complete presses of the reduced engine; compiled."""

import math

from sautereau.sim_backend.physics.reduced.advance import advance
from sautereau.sim_backend.physics.reduced.compile import compiled, entry
from sautereau.sim_backend.physics.reduced.forces import fingertip, jack_kinematics, string_force
from sautereau.sim_backend.physics.reduced.state import (
    ANGLE,
    ANGULAR_VELOCITY,
    ARM,
    CHOIR,
    CONTACT,
    COUNT,
    CUBICS,
    EVENTS,
    FINE,
    FINGER,
    FORCE,
    HEIGHT,
    IDEAL,
    JACK,
    JACK_SPEED,
    KIND,
    LEAVING_JACK,
    PERIOD,
    PUSH,
    PUSHES,
    RELEASE,
    RISE,
    STANDS,
    START,
    TIME,
)


@compiled
def rest(bench, state, modes, segment):
    """Set a state to rest: the key on its rail, or on an ideal finger above that.

    Args:
        bench: Parameters of the press.
        state: Updated in place.
        segment: The first drive segment.
    """
    angle = 0.0
    if segment[IDEAL] > 0:
        tip_angle, _, _, _ = fingertip(segment, segment[START])
        angle = max(angle, tip_angle)
    state.fill(0.0)
    modes.fill(0)
    state[0, ANGLE] = angle
    modes[0, LEAVING_JACK] = -1
    for k in range(1, len(bench)):
        state[k, RISE], _, _ = jack_kinematics(bench[k, ARM], bench[0, HEIGHT], angle)
        modes[k, JACK] = STANDS


@entry
def play_sample(bench, cells, state, modes, guards, events, segment, time, end, rows, new_segment):
    """Advance by a controller sample, in as many steps as there are rows.

    Args:
        bench: Parameters of the press.
        cells: Of the strings' force laws.
        state: Updated in place, as are modes and events.
        modes: Discrete modes.
        guards: Work space for the guards.
        events: Work space for the strings' events.
        segment: Drive segment; a push is removed at its end.
        time: s, start of the sample.
        end: s, end of the sample.
        rows: Time, angle, angular velocity, rise of the first jack, forces of finger and strings
            at the end of each step; shape (steps, 6).
        new_segment: 2 at the start of the press, from rest; 1 at the start of any other drive
            segment; else 0.
    """
    modes[0, COUNT] = 0
    if new_segment == 2:
        rest(bench, state, modes, segment)
    steps = len(rows)
    step = (end - time) / steps
    for j in range(steps):
        before = segment[PUSH]
        step_start, step_end = time + j * step, end if j == steps - 1 else time + (j + 1) * step
        new = 1 if j == 0 and new_segment > 0 else 0
        status = advance(
            bench, cells, state, modes, guards, events, segment, step_start, step_end, new
        )
        if status != FINE:
            return status
        rows[j, 0], rows[j, 1], rows[j, 2] = step_end, state[0, ANGLE], state[0, ANGULAR_VELOCITY]
        rows[j, 3] = state[1, RISE]
        rows[j, 4] = finger_force(state, segment, step_end)
        if segment[IDEAL] == 0.0:
            rows[j, 4] = before
        rows[j, 5] = 0.0
        for k in range(1, len(bench)):
            rows[j, 5] += string_force(bench, cells, modes, k, state[k, RISE])
    return FINE


@compiled
def finger_force(state, segment, time):
    """Return the force [N] of an ideal finger on the key, normal to it."""
    if segment[IDEAL] == 0.0 or state[0, FINGER] == 0.0:
        return 0.0
    _, _, _, arm = fingertip(segment, time)
    return state[0, FINGER] / arm


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
    ideal = segment[IDEAL] > 0
    for i in range(first, last):
        if status[i] != FINE:
            continue
        bench = benches[i]
        segment[START], segment[PERIOD], segment[PUSH] = 0.0, period, bench[0, PUSHES]
        for c in range(8):
            segment[CUBICS + c] = cubics[0, c]
        rest(bench, state, modes, segment)
        result = FINE
        for sample in range(samples[i]):
            time = sample * period
            if ideal:
                segment[START] = time
                for c in range(8):
                    segment[CUBICS + c] = cubics[sample, c]
            for j in range(steps):
                if result != FINE:
                    break
                step_start, end = time + j * step, time + (j + 1) * step
                if j == steps - 1:
                    end = (sample + 1) * period
                new = 1 if j == 0 and (ideal or sample == 0) else 0
                result = advance(
                    bench, cells, state, modes, guards, events, segment, step_start, end, new
                )
                keep_first_events(modes, events, found[i])
        status[i] = result


@compiled
def keep_first_events(modes, events, found):
    """Copy the first event of each kind, and clear the list of events."""
    for e in range(min(modes[0, COUNT], EVENTS)):
        event = events[e]
        kind, k = int(event[KIND]), int(event[CHOIR])
        if kind == CONTACT and found[k, 0] == math.inf:
            found[k, 0] = event[TIME]
        elif kind == RELEASE and found[k, 1] == math.inf:
            found[k, 1], found[k, 2], found[k, 3] = event[TIME], event[FORCE], event[JACK_SPEED]
    modes[0, COUNT] = 0
