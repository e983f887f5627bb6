"""States of plectra and strings, their events, and the rows of a motion; compiled."""

from sautereau.sim_backend.physics.exact import structures as ix
from sautereau.sim_backend.physics.exact.compile import compiled, inlined
from sautereau.sim_backend.physics.exact.forces import string_force

NO_EVENT = -1
RISEN = (ix.STUCK, ix.SLIDING, ix.ABOVE, ix.ABOVE, ix.ABOVE)
RISEN_EVENT = (ix.CONTACT, NO_EVENT, ix.RELEASE, NO_EVENT, NO_EVENT)
FALLEN = (ix.BELOW, ix.BELOW, ix.STUCK, ix.PASSING, ix.BELOW)
FALLEN_EVENT = (NO_EVENT, NO_EVENT, NO_EVENT, NO_EVENT, ix.RETURN)
"""Next state above and below the rises of each, and the event at which it starts."""


@compiled
def update_strings(press):
    """Let the strings follow the rises of their jacks, and record the events."""
    run = press.run
    for k in range(len(press.jacks)):
        jack, rise = press.jacks[k], press.x[k + 1]
        for _ in range(8):
            state = jack.string
            if rise > jack.range[state, 1]:
                following, event = RISEN[state], RISEN_EVENT[state]
            elif rise < jack.range[state, 0]:
                following, event = FALLEN[state], FALLEN_EVENT[state]
            else:
                break
            if event != NO_EVENT and run.events < ix.EVENTS:
                found = press.events[run.events]
                found[0], found[1], found[2], found[3] = run.time, event, k, string_force(press, k)
                run.events += 1
            jack.string = following


@inlined
def write_row(press):
    """Write a row of `Motions`, while there is room for it and for the ends of all steps."""
    run, finger = press.run, press.finger
    if len(press.rows) - run.rows <= run.ends:
        return
    row = press.rows[run.rows]
    run.rows += 1
    row[0], row[1], row[2], row[3] = run.time, press.x[0], press.v[0], press.x[1]
    row[4] = finger.moment / press.key.press_arm
    if finger.kind != ix.PUSH:
        pushed = finger.moment if finger.pad == ix.PRESSED else 0.0
        row[4] = (finger.reaction if finger.touch else pushed) / finger.lever
    row[5] = 0.0
    for k in range(len(press.jacks)):
        row[5] += string_force(press, k)
