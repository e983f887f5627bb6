"""From one mode of the reduced engine to the next one that lasts; compiled."""

import math

from sautereau.sim_backend.physics.reduced.compile import compiled
from sautereau.sim_backend.physics.reduced.forces import (
    burden,
    felt_push,
    fingertip,
    foot,
    jack_acceleration,
    key_motion,
)
from sautereau.sim_backend.physics.reduced.impact import (
    CLOSE,
    SLOW,
    meet_string,
    strike,
    surroundings,
)
from sautereau.sim_backend.physics.reduced.state import (
    ACCELERATION,
    AFTER,
    ANGLE,
    ARM,
    AT_PIN,
    CUBICS,
    DRY,
    FALLS,
    FELT,
    FINE,
    FINGER,
    FRICTION,
    HANGS,
    HEAVINESS,
    HEIGHT,
    IDEAL,
    JACK,
    JUMPED,
    LEAVES,
    LETS_GO,
    MASS,
    PERIOD,
    PRESSED,
    PUSH,
    RISE,
    RISES,
    SLIP,
    SPEED,
    SPIN,
    STANDS,
    TOUCH,
    TURN,
    TURNED_OVER,
)

SHARE = 1e-12
"""1, of the weights on a key: force that is none."""
DEEP = 1e-6
"""rad, by which a fingertip cannot suddenly be within a key."""
AHEAD = 1e-6
"""1, of a controller sample: how far to look which way a standing finger sets off."""


@compiled
def switch(bench, cells, state, kinds, marks, events, leg, time):
    """Change what a step has ended with, and return how that went."""
    if marks[AFTER, 2] < 0.0:
        return TURNED_OVER
    if marks[AFTER, 0] < 0.0:
        state[0, SPIN] = 0.0
    if marks[AFTER, 1] < 0.0:
        state[0, ANGLE] = 0.0
    kinds[0, LETS_GO] = 1 if kinds[0, TOUCH] == 1 and marks[AFTER, 3] < 0.0 else 0
    kinds[0, LEAVES] = -1
    for k in range(1, len(bench)):
        at = 2 + 4 * k
        if marks[AFTER, at] < 0.0 and kinds[k, JACK] == STANDS:
            kinds[0, LEAVES] = k
        if marks[AFTER, at + 1] < 0.0:
            state[k, SPEED] = 0.0
        meet_string(bench, cells, state, kinds, events, k, time)
    return settle(bench, cells, state, kinds, leg, time)


@compiled
def settle(bench, cells, state, kinds, leg, time):
    """Choose the mode that lasts, after all impacts, and return how that went.

    Args:
        bench: The press.
        state: Its places and speeds count, its strings, and who has just left the key.
        leg: Of the drive.
        time: s.
    """
    lets_go, leaves = kinds[0, LETS_GO] == 1, kinds[0, LEAVES]
    kinds[0, LETS_GO], kinds[0, LEAVES] = 0, -1
    under, under_spin, led, _ = 0.0, 0.0, 0.0, 0.0
    ideal = leg[IDEAL] > 0
    if ideal:
        under, under_spin, led, _ = fingertip(leg, time)
        if not math.isfinite(under):
            return AT_PIN
        if under - state[0, ANGLE] > DEEP:
            return JUMPED
    strike(bench, state, ideal, under, under_spin)
    angle, spin = state[0, ANGLE], state[0, SPIN]
    surroundings(bench, state, kinds)
    for k in range(1, len(bench)):
        rise, slope, _ = foot(bench[k, ARM], bench[0, HEIGHT], angle)
        near = state[k, RISE] - rise <= CLOSE and abs(state[k, SPEED] - slope * spin) <= SLOW
        kinds[k, JACK] = STANDS if near and k != leaves else FALLS
    near = ideal and not lets_go and angle - under <= CLOSE and abs(spin - under_spin) <= SLOW
    touch, slip = False, 0
    balance, most, least = standing_balance(bench, cells, state, kinds, leg[PUSH])
    if abs(spin) > SLOW:
        slip = 1 if spin > 0 else -1
    else:
        state[0, SPIN] = spin = 0.0
        none = SHARE * (abs(balance) + most)
        up, down = balance > most + none, balance < -least - none and angle > CLOSE
        heading = way(leg, time) if near else 0
        if heading > 0 or up:
            slip = 1
        elif near and heading == 0:
            touch = True
        elif down:
            slip = -1
    kinds[0, SLIP], kinds[0, TOUCH] = slip, touch
    if slip != 0:
        free = loosen(bench, cells, state, kinds, leg[PUSH], led)
        if near and free <= led:
            kinds[0, TOUCH] = True
            for k in range(1, len(bench)):  # those that a free key leaves a led one may not
                rise, slope, _ = foot(bench[k, ARM], bench[0, HEIGHT], angle)
                apart = state[k, RISE] - rise > CLOSE or abs(state[k, SPEED] - slope * spin) > SLOW
                if not apart and k != leaves:
                    kinds[k, JACK] = STANDS
            loosen(bench, cells, state, kinds, leg[PUSH], led)
    fly(bench, cells, state, kinds)
    acceleration, finger = key_motion(bench, cells, state, kinds, leg[PUSH], angle, spin, led)
    if slip == 0:
        acceleration, finger = 0.0, 0.0
        if touch:  # friction holds the key as long as it can, the finger the rest
            finger = -balance - min(max(-balance, -most), least)
    state[0, TURN], state[0, FINGER] = acceleration, finger
    return FINE


@compiled
def standing_balance(bench, cells, state, kinds, push):
    """Return all on a standing key without dry friction [N m], and what friction holds of it.

    The two are against a rise and against a fall. A jack that its friction can hold up
    without the key burdens it only as the key turns up.
    """
    balance = push + bench[0, HEAVINESS]
    if kinds[0, FELT] == PRESSED:
        balance -= felt_push(bench, state[0, ANGLE], 0.0)
    most = least = bench[0, DRY]
    for k in range(1, len(bench)):
        if kinds[k, JACK] == STANDS:
            _, slope, _ = foot(bench[k, ARM], bench[0, HEIGHT], state[0, ANGLE])
            load, friction = burden(bench, cells, kinds, k, state[k, RISE]), bench[k, FRICTION]
            if load + friction >= 0.0:
                balance -= slope * load
                most += slope * friction
                least += slope * min(load, friction)
    return balance, most, least


@compiled
def way(leg, time):
    """Return the sign of an ideal finger's speed a moment later, 0 where it stands."""
    moves = 0.0
    for c in range(CUBICS, CUBICS + 8):
        if c != CUBICS and c != CUBICS + 4:
            moves += abs(leg[c])
    if moves == 0.0:
        return 0
    _, spin, _, _ = fingertip(leg, time + AHEAD * leg[PERIOD])
    return 1 if spin >= 0.0 else -1


@compiled
def loosen(bench, cells, state, kinds, push, led):
    """Take off the key the jacks that it would have to pull; return its acceleration.

    Args:
        bench: The press.
        state: Jacks at the key are on it.
        push: N m, of a push.
        led: rad/s^2, with which an ideal finger leads it, where one does.
    """
    angle, spin = state[0, ANGLE], state[0, SPIN]
    acceleration = 0.0
    for _ in range(len(bench) + 1):
        acceleration, _ = key_motion(bench, cells, state, kinds, push, angle, spin, led)
        again = False
        for k in range(1, len(bench)):
            if kinds[k, JACK] == STANDS:
                rise, slope, curve = foot(bench[k, ARM], bench[0, HEIGHT], angle)
                load = burden(bench, cells, kinds, k, rise) + kinds[0, SLIP] * bench[k, FRICTION]
                load += bench[k, MASS] * (slope * acceleration + curve * spin * spin)
                if load < 0.0:
                    kinds[k, JACK] = FALLS
                    again = True
        if not again:
            break
    return acceleration


@compiled
def fly(bench, cells, state, kinds):
    """Say of each jack off the key which way it goes, and how it is accelerated."""
    for k in range(1, len(bench)):
        load = burden(bench, cells, kinds, k, state[k, RISE])
        friction = bench[k, FRICTION]
        held = kinds[0, SLIP] != 0 or load + friction >= 0.0
        if kinds[k, JACK] == STANDS and held:
            continue
        if abs(state[k, SPEED]) > SLOW:
            kinds[k, JACK] = RISES if state[k, SPEED] > 0.0 else FALLS
        else:
            state[k, SPEED] = 0.0
            if abs(load) <= friction + SHARE * bench[k, MASS]:
                kinds[k, JACK] = HANGS
            else:
                kinds[k, JACK] = RISES if load < 0.0 else FALLS
        state[k, ACCELERATION] = jack_acceleration(bench, cells, kinds, k, state[k, RISE])
