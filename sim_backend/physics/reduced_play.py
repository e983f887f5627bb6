"""Controller samples and whole presses of the reduced engine; compiled."""

import math

from sim_backend.physics.reduced_advance import advance
from sim_backend.physics.reduced_compile import compiled, entry
from sim_backend.physics.reduced_forces import fingertip, foot, string_force
from sim_backend.physics.reduced_state import (
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
    LINKAGE,
    PERIOD,
    PUSH,
    PUSH_END,
    PUSHES,
    RELEASE,
    RISE,
    SPIN,
    STANDS,
    START,
    TIME,
)
from sim_backend.physics.reduced_switch import settle


@entry
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
    state[:] = 0.0
    kinds[:] = 0
    state[0, ANGLE] = angle
    kinds[0, LEAVES] = -1
    for k in range(1, len(bench)):
        state[k, RISE], _, _ = foot(bench[k, ARM], bench[0, HEIGHT], angle)
        kinds[k, JACK] = STANDS


@compiled
def move(bench, cells, state, kinds, marks, events, leg, time, end):
    """Advance from one time to another [s]; a push ends where it does."""
    pushed = bench[0, PUSH_END]
    if leg[PUSH] > 0.0 and pushed < end:
        if pushed > time:
            status = advance(bench, cells, state, kinds, marks, events, leg, time, pushed)
            if status != FINE:
                return status
            time = pushed
        leg[PUSH] = 0.0
        status = settle(bench, cells, state, kinds, leg, time)
        if status != FINE:
            return status
    return advance(bench, cells, state, kinds, marks, events, leg, time, end)


@entry
def play_sample(bench, cells, state, kinds, marks, events, leg, time, end, rows, fresh):
    """Advance by a controller sample, in as many steps as there are rows.

    Args:
        bench: The press.
        state: Is changed.
        leg: Of the drive; its push is taken off where it ends.
        time: s, where the sample begins.
        end: s, where it ends.
        rows: Time, angle, speed, rise of the first jack, forces of finger and strings at the
            end of each step; shape (steps, 6).
        fresh: Whether the leg is another than before.
    """
    status = FINE
    kinds[0, COUNT] = 0
    if fresh:
        status = settle(bench, cells, state, kinds, leg, time)
    steps = len(rows)
    step = (end - time) / steps
    for j in range(steps):
        if status != FINE:
            return status
        before = leg[PUSH]
        stop = end if j == steps - 1 else time + (j + 1) * step
        status = move(bench, cells, state, kinds, marks, events, leg, time + j * step, stop)
        rows[j, 0], rows[j, 1], rows[j, 2] = stop, state[0, ANGLE], state[0, SPIN]
        rows[j, 3] = state[1, RISE]
        rows[j, 4] = finger_force(state, leg, stop)
        if leg[IDEAL] == 0.0:
            rows[j, 4] = before
        rows[j, 5] = 0.0
        for k in range(1, len(bench)):
            rows[j, 5] += string_force(bench, cells, kinds, k, state[k, RISE])
    return status


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
        state: To work in.
        leg: To work in; `IDEAL` says whether the finger is.
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
        leg[CUBICS:LINKAGE] = cubics[0]
        rest(bench, state, kinds, leg)
        how = settle(bench, cells, state, kinds, leg, 0.0)
        for sample in range(samples[i]):
            time = sample * period
            if ideal and sample > 0 and how == FINE:
                leg[START] = time
                leg[CUBICS:LINKAGE] = cubics[sample]
                how = settle(bench, cells, state, kinds, leg, time)
            for j in range(steps):
                if how != FINE:
                    break
                end = (sample + 1) * period if j == steps - 1 else time + (j + 1) * step
                how = move(bench, cells, state, kinds, marks, events, leg, time + j * step, end)
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
