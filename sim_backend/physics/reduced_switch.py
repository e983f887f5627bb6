"""From one mode of the reduced engine to the next: impacts, and the mode that lasts; compiled."""

import math

from sim_backend.physics.reduced_compile import compiled
from sim_backend.physics.reduced_forces import (
    burden,
    felt_push,
    fingertip,
    foot,
    jack_acceleration,
    key_motion,
    string_force,
)
from sim_backend.physics.reduced_state import (
    ABOVE,
    ACCELERATION,
    AFTER,
    ANGLE,
    ARM,
    AT_PIN,
    BELOW,
    BORDER,
    CHOIR,
    CLEARANCE,
    CONTACT,
    COUNT,
    CUBICS,
    DAMPED,
    DIP,
    DRY,
    EVENTS,
    FALLS,
    FELT,
    FINE,
    FINGER,
    FORCE,
    FRICTION,
    HANGS,
    HEAVINESS,
    HEIGHT,
    HELD,
    HIGH,
    IDEAL,
    INERTIA,
    JACK,
    JACK_SPEED,
    JUMPED,
    KIND,
    LEAVES,
    LETS_GO,
    LIFT,
    LOW,
    MASS,
    OFF,
    PASSING,
    PERIOD,
    PRESSED,
    PUSH,
    RELEASE,
    RETURN,
    RISE,
    RISES,
    SLACK,
    SLIP,
    SPEED,
    SPIN,
    STANDS,
    STRETCH,
    STRETCHES,
    STRING,
    TIME,
    TOUCH,
    TRAVEL,
    TURN,
    TURNED_OVER,
)

CLOSE = 1e-13
"""rad and m, gap that is none."""
SLOW = 1e-11
"""rad/s and m/s, speed that is none."""
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
def meet_string(bench, cells, state, kinds, events, k, time):
    """Bring a string to the state in which a rise leaves it, and note what happened."""
    rise, clearance = state[k, RISE], bench[k, CLEARANCE]
    for _ in range(8):
        kind, stretch = kinds[k, STRING], kinds[k, STRETCH]
        after, event = kind, -1
        if kind == BELOW and rise > clearance:
            after, event, stretch = HELD, CONTACT, 0
        elif kind == HELD and rise > clearance + bench[k, BORDER + stretch + 1]:
            if stretch + 1 < bench[k, STRETCHES]:
                stretch += 1
            else:
                after, event = ABOVE, RELEASE
        elif kind == HELD and rise < clearance + bench[k, BORDER + stretch]:
            if stretch > 0:
                stretch -= 1
            else:
                after = BELOW
        elif kind == ABOVE and rise < clearance:
            after = PASSING
        elif kind == PASSING and rise > clearance:
            after = ABOVE
        elif kind == PASSING and rise < clearance - bench[k, TRAVEL]:
            after, event = BELOW, RETURN
        else:
            break
        if event >= 0:
            note(bench, cells, state, kinds, events, k, time, event)
        kinds[k, STRING], kinds[k, STRETCH] = after, stretch


@compiled
def note(bench, cells, state, kinds, events, k, time, kind):
    """Keep an event of a string, with its force before it."""
    count = kinds[0, COUNT]
    if count < EVENTS:
        event = events[count]
        event[TIME], event[KIND], event[CHOIR] = time, kind, k - 1
        event[FORCE] = string_force(bench, cells, kinds, k, state[k, RISE])
        event[JACK_SPEED] = state[k, SPEED]
    kinds[0, COUNT] = count + 1


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
def strike(bench, state, ideal, under, under_spin):
    """Let all that is met be met without rebound: impulses push only and conserve momentum."""
    angle, spin, base = state[0, ANGLE], state[0, SPIN], -math.inf
    if ideal:
        angle = max(angle, under)
        if angle - under <= CLOSE:
            base = under_spin
    if angle <= CLOSE:
        angle, base = max(angle, 0.0), max(base, 0.0)
    spin = max(spin, base)
    inertia = bench[0, INERTIA]
    again = True
    for _ in range(4 * len(bench)):
        if not again:
            break
        again = False
        for k in range(1, len(bench)):
            rise, slope, _ = foot(bench[k, ARM], bench[0, HEIGHT], angle)
            state[k, RISE] = max(state[k, RISE], rise)
            gap = state[k, RISE] - rise
            if gap <= CLOSE and state[k, SPEED] - slope * spin < -1e-2 * SLOW:
                carried = bench[k, MASS] * slope
                momentum = inertia * spin + carried * state[k, SPEED]
                spin = max(momentum / (inertia + carried * slope), base)
                state[k, SPEED] = slope * spin
                again = True
    state[0, ANGLE], state[0, SPIN] = angle, spin


@compiled
def surroundings(bench, state, kinds):
    """Note what felt and dampers do, and between which rises of the jacks nothing changes."""
    angle, spin = state[0, ANGLE], state[0, SPIN]
    kinds[0, FELT] = OFF
    if angle > bench[0, DIP]:
        kinds[0, FELT] = PRESSED if felt_push(bench, angle, spin) >= 0.0 else SLACK
    for k in range(1, len(bench)):
        clearance, lift, kind = (
            bench[k, CLEARANCE],
            bench[k, LIFT],
            kinds[k, STRING],
        )
        low, high = -math.inf, math.inf
        if kind == BELOW:
            high = clearance
        elif kind == HELD:
            stretch = kinds[k, STRETCH]
            low = clearance + bench[k, BORDER + stretch]
            high = clearance + bench[k, BORDER + stretch + 1]
        elif kind == ABOVE:
            low = clearance
        else:
            low, high = clearance - bench[k, TRAVEL], clearance
        damped = state[k, RISE] < lift
        kinds[k, DAMPED] = damped
        if damped:
            high = min(high, lift)
        else:
            low = max(low, lift)
        state[k, LOW], state[k, HIGH] = low, high


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
