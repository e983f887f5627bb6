"""States of plectra and strings, their events, and the rows of a motion; compiled."""

import math

from sautereau.sim_backend.physics.exact import structures as ix
from sautereau.sim_backend.physics.exact.compile import compiled, inlined
from sautereau.sim_backend.physics.exact.forces import string_force


@inlined
def string_range(jack, choir):
    """Return the rises [m] between which a string keeps its state and its piece of the law."""
    if choir.string == ix.BELOW:
        return -math.inf, jack.clearance
    if choir.string == ix.HELD:
        low, high = jack.border[choir.piece], jack.border[choir.piece + 1]
        return jack.clearance + low, jack.clearance + high
    if choir.string == ix.ABOVE:
        return jack.clearance, math.inf
    return jack.clearance - jack.travel, jack.clearance


@compiled
def update_strings(press, time):
    """Let the strings follow the rises of their jacks, and record the events."""
    for k in range(len(press.jacks)):
        jack, choir, rise = press.jacks[k], press.choirs[k], press.x[k + 1]
        for _ in range(8):
            low, high = string_range(jack, choir)
            state, piece, event = choir.string, choir.piece, -1
            if low <= rise <= high:
                break
            up = rise > high
            if state == ix.BELOW:
                state, piece, event = ix.HELD, 0, ix.CONTACT
            elif state == ix.HELD and up and piece + 1 < jack.pieces:
                piece += 1
            elif state == ix.HELD and up:
                state, event = ix.ABOVE, ix.RELEASE
            elif state == ix.HELD and piece > 0:
                piece -= 1
            elif state == ix.HELD:
                state = ix.BELOW
            elif state == ix.ABOVE:
                state = ix.PASSING
            elif up:
                state = ix.ABOVE
            else:
                state, event = ix.BELOW, ix.RETURN
            if event >= 0 and press.mode.events < ix.EVENTS:
                found = press.events[press.mode.events]
                found[0], found[1], found[2] = time, event, k
                found[3], found[4] = string_force(press, k, rise), press.v[k + 1]
                press.mode.events += 1
            choir.string, choir.piece = state, piece


@inlined
def write_row(press, time):
    """Write a row of `Motions`, while there is room for it and for the ends of all steps."""
    mode, finger = press.mode, press.finger
    if len(press.rows) - mode.rows <= mode.ends:
        return
    row = press.rows[mode.rows]
    mode.rows += 1
    row[0], row[1], row[2], row[3] = time, press.x[0], press.v[0], press.x[1]
    row[4] = finger.moment / press.key.press_arm
    if finger.kind != ix.PUSH:
        pushed = finger.moment if mode.pad == ix.PRESSED else 0.0
        row[4] = (mode.moment if mode.touch else pushed) / finger.lever
    row[5] = 0.0
    for k in range(len(press.jacks)):
        row[5] += string_force(press, k, press.x[k + 1])
