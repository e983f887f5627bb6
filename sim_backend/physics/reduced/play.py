"""Controller samples and whole presses of the reduced engine; compiled."""

import math

from sautereau.sim_backend.physics.reduced.advance import advance
from sautereau.sim_backend.physics.reduced.compile import compiled, entry
from sautereau.sim_backend.physics.reduced.forces import fingertip, foot, string_force
from sautereau.sim_backend.physics.reduced.state import (
    ANGLE,
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
    LEAVES,
    PERIOD,
    PUSH,
    PUSHES,
    RELEASE,
    RISE,
    SPIN,
    STANDS,
    START,
    TIME,
)


@compiled
def rest(bench, state, kinds, leg):
    """Bring a state to rest: the key on its rail, or on an ideal finger above it.

    Args:
        bench: The press.
        state: Is changed.
        leg: Of the drive, with which it begins.
    """
    angle = 0.0
    if leg[IDEAL] > 0:
        under, _, _, _ = fingertip(leg, leg[START])
        angle = max(angle, under)
    state.fill(0.0)
    kinds.fill(0)
    state[0, ANGLE] = angle
    kinds[0, LEAVES] = -1
    for k in range(1, len(bench)):
        state[k, RISE], _, _ = foot(bench[k, ARM], bench[0, HEIGHT], angle)
        kinds[k, JACK] = STANDS


@entry
def play_sample(bench, cells, state, kinds, marks, events, leg, time, end, rows, fresh):
    """Advance by a controller sample, in as many steps as there are rows.

    Args:
        bench: The press.
        cells: Of the strings' laws.
        state: Is changed, as are what everything does and the events.
        kinds: What everything does.
        marks: Room for what must stay positive.
        events: Room for what the strings meet.
        leg: Of the drive; a push is taken off where it ends.
        time: s, where the sample begins.
        end: s, where it ends.
        rows: Time, angle, speed, rise of the first jack, forces of finger and strings at the
            end of each step; shape (steps, 6).
        fresh: 2 where the press begins, from rest; 1 where another leg does; else 0.
    """
    kinds[0, COUNT] = 0
    if fresh == 2:
        rest(bench, state, kinds, leg)
    steps = len(rows)
    step = (end - time) / steps
    for j in range(steps):
        before = leg[PUSH]
        now, stop = time + j * step, end if j == steps - 1 else time + (j + 1) * step
        begins = 1 if j == 0 and fresh > 0 else 0
        status = advance(bench, cells, state, kinds, marks, events, leg, now, stop, begins)
        if status != FINE:
            return status
        rows[j, 0], rows[j, 1], rows[j, 2] = stop, state[0, ANGLE], state[0, SPIN]
        rows[j, 3] = state[1, RISE]
        rows[j, 4] = finger_force(state, leg, stop)
        if leg[IDEAL] == 0.0:
            rows[j, 4] = before
        rows[j, 5] = 0.0
        for k in range(1, len(bench)):
            rows[j, 5] += string_force(bench, cells, kinds, k, state[k, RISE])
    return FINE


@compiled
def finger_force(state, leg, time):
    """Return the force [N] of an ideal finger on the key, normal to it."""
    if leg[IDEAL] == 0.0 or state[0, FINGER] == 0.0:
        return 0.0
    _, _, _, arm = fingertip(leg, time)
    return state[0, FINGER] / arm


@entry
def play_presses(
    benches,
    cells,
    first,
    last,
    state,
    kinds,
    marks,
    events,
    leg,
    cubics,
    samples,
    timing,
    found,
    status,
):
    """Play whole presses and note each string's first contact and release.

    Args:
        benches: All presses in numbers; shape (presses, 1 + choirs, NUMBERS).
        cells: Of the strings' laws.
        first: The first one to play.
        last: The one not to play any more.
        state: Room for a state.
        kinds: Room for what everything does.
        marks: Room for what must stay positive.
        events: Room for what the strings meet.
        leg: Room for the leg; `IDEAL` says whether the finger is, and its linkage counts.
        cubics: rad, joints of an ideal finger over each controller sample; (samples, 8).
        samples: Of the controller, in each press; shape (presses,).
        timing: Period of the controller [s], steps in it.
        found: Contact and release [s], force at release [N], speed of the jack there [m/s];
            shape (presses, choirs, 4), infinite before and where there is none.
        status: How each press ended; shape (presses,).
    """
    period, steps = timing
    step = period / steps
    ideal = leg[IDEAL] > 0
    for i in range(first, last):
        if status[i] != FINE:
            continue
        bench = benches[i]
        leg[START], leg[PERIOD], leg[PUSH] = 0.0, period, bench[0, PUSHES]
        for c in range(8):
            leg[CUBICS + c] = cubics[0, c]
        rest(bench, state, kinds, leg)
        how = FINE
        for sample in range(samples[i]):
            time = sample * period
            if ideal:
                leg[START] = time
                for c in range(8):
                    leg[CUBICS + c] = cubics[sample, c]
            for j in range(steps):
                if how != FINE:
                    break
                now, end = time + j * step, time + (j + 1) * step
                if j == steps - 1:
                    end = (sample + 1) * period
                begins = 1 if j == 0 and (ideal or sample == 0) else 0
                how = advance(bench, cells, state, kinds, marks, events, leg, now, end, begins)
                keep_first(kinds, events, found[i])
        status[i] = how


@compiled
def keep_first(kinds, events, found):
    """Move events to where only the first of each kind stay."""
    for e in range(min(kinds[0, COUNT], EVENTS)):
        event = events[e]
        kind, k = int(event[KIND]), int(event[CHOIR])
        if kind == CONTACT and found[k, 0] == math.inf:
            found[k, 0] = event[TIME]
        elif kind == RELEASE and found[k, 1] == math.inf:
            found[k, 1], found[k, 2], found[k, 3] = event[TIME], event[FORCE], event[JACK_SPEED]
    kinds[0, COUNT] = 0
