"""Plastic impacts, and the modes of strings, dampers and felt; compiled."""

import math

from sautereau.sim_backend.physics.reduced.compile import compiled
from sautereau.sim_backend.physics.reduced.forces import (
    felt_push,
    jack_kinematics,
    string_force,
)
from sautereau.sim_backend.physics.reduced.state import (
    ABOVE,
    ANGLE,
    ANGULAR_VELOCITY,
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
    STRETCH,
    STRETCHES,
    STRING,
    TIME,
    TRAVEL,
)

CLOSE = 1e-13
"""rad and m, gap below which surfaces are in contact."""
SLOW = 1e-11
"""rad/s and m/s, speed below which it counts as zero."""
CONTACT_GAP, CONTACT_SPEED = 1e-11, 1e-6
"""m and m/s, gap and speed between jack and key below which the jack stands; without this limit
it would land without end."""


@compiled
def resolve_impacts(bench, state, ideal, tip_angle, tip_omega):
    """Apply plastic impacts (without rebound): repulsive impulses that conserve momentum."""
    angle, omega, base = state[0, ANGLE], state[0, ANGULAR_VELOCITY], -math.inf
    if ideal:
        angle = max(angle, tip_angle)
        if angle - tip_angle <= CLOSE:
            base = tip_omega
    if angle <= CLOSE:
        angle, base = max(angle, 0.0), max(base, 0.0)
    omega = max(omega, base)
    inertia = bench[0, INERTIA]
    again = True
    for _ in range(4 * len(bench)):
        if not again:
            break
        again = False
        for k in range(1, len(bench)):
            rise, slope, _ = jack_kinematics(bench[k, ARM], bench[0, HEIGHT], angle)
            state[k, RISE] = max(state[k, RISE], rise)
            gap = state[k, RISE] - rise
            if gap <= CLOSE and state[k, SPEED] - slope * omega < -1e-2 * SLOW:
                carried = bench[k, MASS] * slope
                momentum = inertia * omega + carried * state[k, SPEED]
                omega = max(momentum / (inertia + carried * slope), base)
                state[k, SPEED] = slope * omega
                again = True
    state[0, ANGLE], state[0, ANGULAR_VELOCITY] = (
        angle,
        merge_slow_contacts(bench, state, angle, omega, base),
    )


@compiled
def merge_slow_contacts(bench, state, angle, omega, base):
    """Let jacks that hardly move relative to the key stand on it; return its velocity [rad/s].

    Momentum is conserved unless the key is held at its least velocity.
    """
    inertia, momentum = bench[0, INERTIA], bench[0, INERTIA] * omega
    for k in range(1, len(bench)):
        if nearly_standing(bench, state, k, angle, omega):
            _, slope, _ = jack_kinematics(bench[k, ARM], bench[0, HEIGHT], angle)
            inertia += bench[k, MASS] * slope * slope
            momentum += bench[k, MASS] * slope * state[k, SPEED]
    together = momentum / inertia if omega > base else omega
    for k in range(1, len(bench)):
        if nearly_standing(bench, state, k, angle, omega):
            rise, slope, _ = jack_kinematics(bench[k, ARM], bench[0, HEIGHT], angle)
            state[k, RISE], state[k, SPEED] = rise, slope * together
    return max(together, base)


@compiled
def nearly_standing(bench, state, k, angle, omega):
    """Return whether a jack is in contact with the key at nearly equal speed."""
    rise, slope, _ = jack_kinematics(bench[k, ARM], bench[0, HEIGHT], angle)
    near = state[k, RISE] - rise <= CONTACT_GAP
    return near and abs(state[k, SPEED] - slope * omega) <= CONTACT_SPEED


@compiled
def update_string(bench, cells, state, modes, events, k, time):
    """Update the mode of a string for its jack's rise, and record the events."""
    rise, clearance = state[k, RISE], bench[k, CLEARANCE]
    for _ in range(8):
        mode, stretch = modes[k, STRING], modes[k, STRETCH]
        after, event = mode, -1
        if mode == BELOW and rise > clearance:
            after, event, stretch = HELD, CONTACT, 0
        elif mode == HELD and rise > clearance + bench[k, BORDER + stretch + 1]:
            if stretch + 1 < bench[k, STRETCHES]:
                stretch += 1
            else:
                after, event = ABOVE, RELEASE
        elif mode == HELD and rise < clearance + bench[k, BORDER + stretch]:
            if stretch > 0:
                stretch -= 1
            else:
                after = BELOW
        elif mode == ABOVE and rise < clearance:
            after = PASSING
        elif mode == PASSING and rise > clearance:
            after = ABOVE
        elif mode == PASSING and rise < clearance - bench[k, TRAVEL]:
            after, event = BELOW, RETURN
        else:
            break
        if event >= 0:
            note(bench, cells, state, modes, events, k, time, event)
        modes[k, STRING], modes[k, STRETCH] = after, stretch


@compiled
def note(bench, cells, state, modes, events, k, time, kind):
    """Record an event of a string, with the force just before it."""
    count = modes[0, COUNT]
    if count < EVENTS:
        event = events[count]
        event[TIME], event[KIND], event[CHOIR] = time, kind, k - 1
        event[FORCE] = string_force(bench, cells, modes, k, state[k, RISE])
        event[JACK_SPEED] = state[k, SPEED]
    modes[0, COUNT] = count + 1


@compiled
def update_force_modes(bench, state, modes):
    """Update the modes of felt and dampers, and the rises between which no mode changes."""
    angle, omega = state[0, ANGLE], state[0, ANGULAR_VELOCITY]
    modes[0, FELT] = OFF
    if angle > bench[0, DIP]:
        modes[0, FELT] = PRESSED if felt_push(bench, angle, omega) >= 0.0 else SLACK
    for k in range(1, len(bench)):
        clearance, lift, mode = bench[k, CLEARANCE], bench[k, LIFT], modes[k, STRING]
        low, high = -math.inf, math.inf
        if mode == BELOW:
            high = clearance
        elif mode == HELD:
            stretch = modes[k, STRETCH]
            low = clearance + bench[k, BORDER + stretch]
            high = clearance + bench[k, BORDER + stretch + 1]
        elif mode == ABOVE:
            low = clearance
        else:
            low, high = clearance - bench[k, TRAVEL], clearance
        damped = state[k, RISE] < lift
        modes[k, DAMPED] = damped
        if damped:
            high = min(high, lift)
        else:
            low = max(low, lift)
        state[k, LOW], state[k, HIGH] = low, high
