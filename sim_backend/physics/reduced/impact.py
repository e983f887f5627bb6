"""What things of the reduced engine meet: impacts without rebound, strings, felt; compiled."""

import math

from sautereau.sim_backend.physics.reduced.compile import compiled
from sautereau.sim_backend.physics.reduced.forces import (
    felt_push,
    foot,
    string_force,
)
from sautereau.sim_backend.physics.reduced.state import (
    ABOVE,
    ANGLE,
    ARM,
    BELOW,
    BORDER,
    CHOIR,
    CLEARANCE,
    CONTACT,
    COUNT,
    DAMPED,
    DIP,
    EVENTS,
    FELT,
    FORCE,
    HEIGHT,
    HELD,
    HIGH,
    INERTIA,
    JACK_SPEED,
    KIND,
    LIFT,
    LOW,
    MASS,
    OFF,
    PASSING,
    PRESSED,
    RELEASE,
    RETURN,
    RISE,
    SLACK,
    SPEED,
    SPIN,
    STRETCH,
    STRETCHES,
    STRING,
    TIME,
    TRAVEL,
)

CLOSE = 1e-13
"""rad and m, gap that is none."""
SLOW = 1e-11
"""rad/s and m/s, speed that is none."""
SETTLED_GAP, SETTLED_SPEED = 1e-11, 1e-6
"""m and m/s, of a jack from the key: nearer and slower it stands, or it would land without end."""


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
    state[0, ANGLE], state[0, SPIN] = angle, unite(bench, state, angle, spin, base)


@compiled
def unite(bench, state, angle, spin, base):
    """Let jacks that hardly move against the key go with it; return its speed [rad/s].

    Momentum is conserved, but for what holds the key at its least speed.
    """
    inertia, momentum = bench[0, INERTIA], bench[0, INERTIA] * spin
    for k in range(1, len(bench)):
        if settled(bench, state, k, angle, spin):
            _, slope, _ = foot(bench[k, ARM], bench[0, HEIGHT], angle)
            inertia += bench[k, MASS] * slope * slope
            momentum += bench[k, MASS] * slope * state[k, SPEED]
    together = momentum / inertia if spin > base else spin
    for k in range(1, len(bench)):
        if settled(bench, state, k, angle, spin):
            rise, slope, _ = foot(bench[k, ARM], bench[0, HEIGHT], angle)
            state[k, RISE], state[k, SPEED] = rise, slope * together
    return max(together, base)


@compiled
def settled(bench, state, k, angle, spin):
    """Return whether a jack hardly moves against the key."""
    rise, slope, _ = foot(bench[k, ARM], bench[0, HEIGHT], angle)
    near = state[k, RISE] - rise <= SETTLED_GAP
    return near and abs(state[k, SPEED] - slope * spin) <= SETTLED_SPEED


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
