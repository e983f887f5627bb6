"""Transition between modes of the reduced engine; compiled."""

import math

from sautereau.sim_backend.physics.reduced import state as ix
from sautereau.sim_backend.physics.reduced.compile import compiled
from sautereau.sim_backend.physics.reduced.forces import (
    felt_push,
    fingertip,
    jack_acceleration,
    jack_kinematics,
    key_motion,
    static_load,
)
from sautereau.sim_backend.physics.reduced.impact import (
    CLOSE,
    SLOW,
    resolve_impacts,
    update_force_modes,
    update_string,
)

FORCE_TOLERANCE = 1e-12
"""Dimensionless, fraction of the weights on a key: force that counts as zero."""
DEPTH_TOLERANCE = 1e-6
"""rad, largest overlap of fingertip and key."""
LOOK_AHEAD = 1e-6
"""Dimensionless, fraction of a controller sample: look-ahead for a finger's direction."""


@compiled
def change_mode(bench, cells, state, modes, guards, events, segment, time):
    """Apply the event that ended a step; return a status."""
    if guards[ix.AFTER, 2] < 0.0:
        return ix.TURNED_OVER
    if guards[ix.AFTER, 0] < 0.0:
        state[0, ix.ANGULAR_VELOCITY] = 0.0
    if guards[ix.AFTER, 1] < 0.0:
        state[0, ix.ANGLE] = 0.0
    modes[0, ix.FINGER_RELEASES] = 1 if modes[0, ix.TOUCH] == 1 and guards[ix.AFTER, 3] < 0.0 else 0
    modes[0, ix.LEAVING_JACK] = -1
    for k in range(1, len(bench)):
        at = 2 + 4 * k
        if guards[ix.AFTER, at] < 0.0 and modes[k, ix.JACK] == ix.STANDS:
            modes[0, ix.LEAVING_JACK] = k
        if guards[ix.AFTER, at + 1] < 0.0:
            state[k, ix.SPEED] = 0.0
        update_string(bench, cells, state, modes, events, k, time)
    return select_mode(bench, cells, state, modes, segment, time)


@compiled
def select_mode(bench, cells, state, modes, segment, time):
    """Apply all impacts and select the next mode; return a status.

    Args:
        bench: Parameters of the press.
        state: Positions and speeds before the impacts.
        segment: Drive segment.
        time: s.
    """
    finger_releases, leaving = modes[0, ix.FINGER_RELEASES] == 1, modes[0, ix.LEAVING_JACK]
    modes[0, ix.FINGER_RELEASES], modes[0, ix.LEAVING_JACK] = 0, -1
    tip_angle, tip_omega, prescribed, _ = 0.0, 0.0, 0.0, 0.0
    ideal = segment[ix.IDEAL] > 0
    if ideal:
        tip_angle, tip_omega, prescribed, _ = fingertip(segment, time)
        if not math.isfinite(tip_angle):
            return ix.AT_PIN
        if tip_angle - state[0, ix.ANGLE] > DEPTH_TOLERANCE:
            return ix.JUMPED
    resolve_impacts(bench, state, ideal, tip_angle, tip_omega)
    angle, omega = state[0, ix.ANGLE], state[0, ix.ANGULAR_VELOCITY]
    update_force_modes(bench, state, modes)
    for k in range(1, len(bench)):
        rise, slope, _ = jack_kinematics(bench[k, ix.ARM], bench[0, ix.HEIGHT], angle)
        near = state[k, ix.RISE] - rise <= CLOSE and abs(state[k, ix.SPEED] - slope * omega) <= SLOW
        modes[k, ix.JACK] = ix.STANDS if near and k != leaving else ix.FALLS
    near = (
        ideal
        and not finger_releases
        and angle - tip_angle <= CLOSE
        and abs(omega - tip_omega) <= SLOW
    )
    touch, slip = False, 0
    balance, most, least = static_balance(bench, cells, state, modes, segment[ix.PUSH])
    if abs(omega) > SLOW:
        slip = 1 if omega > 0 else -1
    else:
        state[0, ix.ANGULAR_VELOCITY] = omega = 0.0
        none = FORCE_TOLERANCE * (abs(balance) + most)
        up, down = balance > most + none, balance < -least - none and angle > CLOSE
        heading = finger_direction(segment, time) if near else 0
        if heading > 0 or up:
            slip = 1
        elif near and heading == 0:
            touch = True
        elif down:
            slip = -1
    modes[0, ix.SLIP], modes[0, ix.TOUCH] = slip, touch
    if slip != 0:
        free = release_jacks(bench, cells, state, modes, segment[ix.PUSH], prescribed)
        if near and free <= prescribed:
            modes[0, ix.TOUCH] = True
            for k in range(
                1, len(bench)
            ):  # jacks that a free key would leave may stay on a prescribed one
                rise, slope, _ = jack_kinematics(bench[k, ix.ARM], bench[0, ix.HEIGHT], angle)
                apart = (
                    state[k, ix.RISE] - rise > CLOSE
                    or abs(state[k, ix.SPEED] - slope * omega) > SLOW
                )
                if not apart and k != leaving:
                    modes[k, ix.JACK] = ix.STANDS
            release_jacks(bench, cells, state, modes, segment[ix.PUSH], prescribed)
    set_flight_modes(bench, cells, state, modes)
    acceleration, finger = key_motion(
        bench, cells, state, modes, segment[ix.PUSH], angle, omega, prescribed
    )
    if slip == 0:
        acceleration, finger = 0.0, 0.0
        if touch:  # friction carries as much as it can, the finger the remainder
            finger = -balance - min(max(-balance, -most), least)
    state[0, ix.ANGULAR_ACCELERATION], state[0, ix.FINGER] = acceleration, finger
    return ix.FINE


@compiled
def static_balance(bench, cells, state, modes, push):
    """Return the moment on a key at rest without dry friction, and the limits of friction [N m].

    The limits are those against a rise and against a fall. A jack that its friction can hold
    without the key loads the key only if the key rises.
    """
    balance = push + bench[0, ix.GRAVITY_MOMENT]
    if modes[0, ix.FELT] == ix.PRESSED:
        balance -= felt_push(bench, state[0, ix.ANGLE], 0.0)
    most = least = bench[0, ix.DRY]
    for k in range(1, len(bench)):
        if modes[k, ix.JACK] == ix.STANDS:
            _, slope, _ = jack_kinematics(bench[k, ix.ARM], bench[0, ix.HEIGHT], state[0, ix.ANGLE])
            load, friction = (
                static_load(bench, cells, modes, k, state[k, ix.RISE]),
                bench[k, ix.FRICTION],
            )
            if load + friction >= 0.0:
                balance -= slope * load
                most += slope * friction
                least += slope * min(load, friction)
    return balance, most, least


@compiled
def finger_direction(segment, time):
    """Return the sign of an ideal finger's velocity just after a time [s]; 0 at rest."""
    moves = 0.0
    for c in range(ix.CUBICS, ix.CUBICS + 8):
        if c != ix.CUBICS and c != ix.CUBICS + 4:
            moves += abs(segment[c])
    if moves == 0.0:
        return 0
    _, omega, _, _ = fingertip(segment, time + LOOK_AHEAD * segment[ix.PERIOD])
    return 1 if omega >= 0.0 else -1


@compiled
def release_jacks(bench, cells, state, modes, push, prescribed):
    """Release the jacks that the key would otherwise pull; return its angular acceleration.

    Args:
        bench: Parameters of the press.
        state: Jacks in contact with the key stand on it.
        push: N m, of a push.
        prescribed: rad/s^2, angular acceleration under an ideal finger in contact.
    """
    angle, omega = state[0, ix.ANGLE], state[0, ix.ANGULAR_VELOCITY]
    acceleration = 0.0
    for _ in range(len(bench) + 1):
        acceleration, _ = key_motion(bench, cells, state, modes, push, angle, omega, prescribed)
        again = False
        for k in range(1, len(bench)):
            if modes[k, ix.JACK] == ix.STANDS:
                rise, slope, curvature = jack_kinematics(
                    bench[k, ix.ARM], bench[0, ix.HEIGHT], angle
                )
                load = (
                    static_load(bench, cells, modes, k, rise)
                    + modes[0, ix.SLIP] * bench[k, ix.FRICTION]
                )
                load += bench[k, ix.MASS] * (slope * acceleration + curvature * omega * omega)
                if load < 0.0:
                    modes[k, ix.JACK] = ix.FALLS
                    again = True
        if not again:
            break
    return acceleration


@compiled
def set_flight_modes(bench, cells, state, modes):
    """Set mode and acceleration of each jack off the key."""
    for k in range(1, len(bench)):
        load = static_load(bench, cells, modes, k, state[k, ix.RISE])
        friction = bench[k, ix.FRICTION]
        held = modes[0, ix.SLIP] != 0 or load + friction >= 0.0
        if modes[k, ix.JACK] == ix.STANDS and held:
            continue
        if abs(state[k, ix.SPEED]) > SLOW:
            modes[k, ix.JACK] = ix.RISES if state[k, ix.SPEED] > 0.0 else ix.FALLS
        else:
            state[k, ix.SPEED] = 0.0
            if abs(load) <= friction + FORCE_TOLERANCE * bench[k, ix.MASS]:
                modes[k, ix.JACK] = ix.HANGS
            else:
                modes[k, ix.JACK] = ix.RISES if load < 0.0 else ix.FALLS
        state[k, ix.ACCELERATION] = jack_acceleration(bench, cells, modes, k, state[k, ix.RISE])
