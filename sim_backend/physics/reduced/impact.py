"""Plastic impacts, and the modes of strings, dampers and felt; compiled."""

import math

from sautereau.sim_backend.physics.reduced import state as ix
from sautereau.sim_backend.physics.reduced.compile import compiled
from sautereau.sim_backend.physics.reduced.forces import (
    felt_push,
    jack_kinematics,
    string_force,
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
    angle, omega, base = state[0, ix.ANGLE], state[0, ix.ANGULAR_VELOCITY], -math.inf
    if ideal:
        angle = max(angle, tip_angle)
        if angle - tip_angle <= CLOSE:
            base = tip_omega
    if angle <= CLOSE:
        angle, base = max(angle, 0.0), max(base, 0.0)
    omega = max(omega, base)
    inertia = bench[0, ix.INERTIA]
    again = True
    for _ in range(4 * len(bench)):
        if not again:
            break
        again = False
        for k in range(1, len(bench)):
            rise, slope, _ = jack_kinematics(bench[k, ix.ARM], bench[0, ix.HEIGHT], angle)
            state[k, ix.RISE] = max(state[k, ix.RISE], rise)
            gap = state[k, ix.RISE] - rise
            if gap <= CLOSE and state[k, ix.SPEED] - slope * omega < -1e-2 * SLOW:
                carried = bench[k, ix.MASS] * slope
                momentum = inertia * omega + carried * state[k, ix.SPEED]
                omega = max(momentum / (inertia + carried * slope), base)
                state[k, ix.SPEED] = slope * omega
                again = True
    state[0, ix.ANGLE], state[0, ix.ANGULAR_VELOCITY] = (
        angle,
        merge_slow_contacts(bench, state, angle, omega, base),
    )


@compiled
def merge_slow_contacts(bench, state, angle, omega, base):
    """Let jacks that hardly move relative to the key stand on it; return its velocity [rad/s].

    Momentum is conserved unless the key is held at its least velocity.
    """
    inertia, momentum = bench[0, ix.INERTIA], bench[0, ix.INERTIA] * omega
    for k in range(1, len(bench)):
        if nearly_standing(bench, state, k, angle, omega):
            _, slope, _ = jack_kinematics(bench[k, ix.ARM], bench[0, ix.HEIGHT], angle)
            inertia += bench[k, ix.MASS] * slope * slope
            momentum += bench[k, ix.MASS] * slope * state[k, ix.SPEED]
    together = momentum / inertia if omega > base else omega
    for k in range(1, len(bench)):
        if nearly_standing(bench, state, k, angle, omega):
            rise, slope, _ = jack_kinematics(bench[k, ix.ARM], bench[0, ix.HEIGHT], angle)
            state[k, ix.RISE], state[k, ix.SPEED] = rise, slope * together
    return max(together, base)


@compiled
def nearly_standing(bench, state, k, angle, omega):
    """Return whether a jack is in contact with the key at nearly equal speed."""
    rise, slope, _ = jack_kinematics(bench[k, ix.ARM], bench[0, ix.HEIGHT], angle)
    near = state[k, ix.RISE] - rise <= CONTACT_GAP
    return near and abs(state[k, ix.SPEED] - slope * omega) <= CONTACT_SPEED


@compiled
def update_string(bench, cells, state, modes, events, k, time):
    """Update the mode of a string for its jack's rise, and record the events."""
    rise, clearance = state[k, ix.RISE], bench[k, ix.CLEARANCE]
    for _ in range(8):
        mode, stretch = modes[k, ix.STRING], modes[k, ix.STRETCH]
        after, event = mode, -1
        if mode == ix.BELOW and rise > clearance:
            after, event, stretch = ix.HELD, ix.CONTACT, 0
        elif mode == ix.HELD and rise > clearance + bench[k, ix.BORDER + stretch + 1]:
            if stretch + 1 < bench[k, ix.STRETCHES]:
                stretch += 1
            else:
                after, event = ix.ABOVE, ix.RELEASE
        elif mode == ix.HELD and rise < clearance + bench[k, ix.BORDER + stretch]:
            if stretch > 0:
                stretch -= 1
            else:
                after = ix.BELOW
        elif mode == ix.ABOVE and rise < clearance:
            after = ix.PASSING
        elif mode == ix.PASSING and rise > clearance:
            after = ix.ABOVE
        elif mode == ix.PASSING and rise < clearance - bench[k, ix.TRAVEL]:
            after, event = ix.BELOW, ix.RETURN
        else:
            break
        if event >= 0:
            note(bench, cells, state, modes, events, k, time, event)
        modes[k, ix.STRING], modes[k, ix.STRETCH] = after, stretch


@compiled
def note(bench, cells, state, modes, events, k, time, kind):
    """Record an event of a string, with the force just before it."""
    count = modes[0, ix.COUNT]
    if count < ix.EVENTS:
        event = events[count]
        event[ix.TIME], event[ix.KIND], event[ix.CHOIR] = time, kind, k - 1
        event[ix.FORCE] = string_force(bench, cells, modes, k, state[k, ix.RISE])
        event[ix.JACK_SPEED] = state[k, ix.SPEED]
    modes[0, ix.COUNT] = count + 1


@compiled
def update_force_modes(bench, state, modes):
    """Update the modes of felt and dampers, and the rises between which no mode changes."""
    angle, omega = state[0, ix.ANGLE], state[0, ix.ANGULAR_VELOCITY]
    modes[0, ix.FELT] = ix.OFF
    if angle > bench[0, ix.DIP]:
        modes[0, ix.FELT] = ix.PRESSED if felt_push(bench, angle, omega) >= 0.0 else ix.SLACK
    for k in range(1, len(bench)):
        clearance, lift, mode = bench[k, ix.CLEARANCE], bench[k, ix.LIFT], modes[k, ix.STRING]
        low, high = -math.inf, math.inf
        if mode == ix.BELOW:
            high = clearance
        elif mode == ix.HELD:
            stretch = modes[k, ix.STRETCH]
            low = clearance + bench[k, ix.BORDER + stretch]
            high = clearance + bench[k, ix.BORDER + stretch + 1]
        elif mode == ix.ABOVE:
            low = clearance
        else:
            low, high = clearance - bench[k, ix.TRAVEL], clearance
        damped = state[k, ix.RISE] < lift
        modes[k, ix.DAMPED] = damped
        if damped:
            high = min(high, lift)
        else:
            low = max(low, lift)
        state[k, ix.LOW], state[k, ix.HIGH] = low, high
