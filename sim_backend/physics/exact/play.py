"""From event to event through controller samples and a complete press; compiled.

A step at whose end a guard of the mode is violated is repeated, and ends where the first one is.
Impacts and the next mode then follow from the state alone. Where events accumulate, as when
landings alternate between two jacks, a nonsmooth step of first order passes them.
"""

import math

from sautereau.sim_backend.physics import laws
from sautereau.sim_backend.physics import structures as ix
from sautereau.sim_backend.physics.exact.compile import compiled, entry, expanded, inlined
from sautereau.sim_backend.physics.exact.fingertip import locate_tip
from sautereau.sim_backend.physics.exact.forces import string_force, surface
from sautereau.sim_backend.physics.exact.inclusion import resolve, select
from sautereau.sim_backend.physics.exact.step import guard, hold_tip, locate, try_step

SHORTEST = 1e-8  # s, shortest divided step
MOST_STEPS, MORE_STEPS = 200_000, 1000
"""Divided steps of one call, and more of them per sample, above which a scene is too stiff."""

opened, close_loop = expanded(ix.opened), compiled(laws.close_loop)


@compiled
def update_strings(press):
    """Let the strings follow the rises of their jacks, and record the events."""
    run = press.run
    for k in range(len(press.jacks)):
        jack, rise = press.jacks[k], press.x[k + 1]
        for _ in range(8):
            state = jack.string
            if rise > jack.range[state, 1]:
                following, event = ix.RISEN[state], ix.RISEN_EVENT[state]
            elif rise < jack.range[state, 0]:
                following, event = ix.FALLEN[state], ix.FALLEN_EVENT[state]
            else:
                break
            if event != ix.NO_EVENT and run.events < ix.EVENTS:
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
    row[4] = finger.force
    if finger.kind != ix.PUSH:
        pushed = finger.force if finger.pad == ix.PRESSED else 0.0
        row[4] = finger.reaction / finger.lever if finger.touch else pushed
    row[5] = 0.0
    for k in range(len(press.jacks)):
        row[5] += string_force(press, k)
    row[6] = finger.blow


@expanded
def rest(press):
    """Set a press to rest: the key on its rail, or on a fingertip above that; return a status."""
    press.work[:] = 0.0
    key, finger, n = press.key, press.finger, len(press.jacks)
    if finger.kind == ix.SERVO:
        press.x[n + 1], press.x[n + 2] = finger.start[0], finger.start[1]
    locate_tip(press, press.run.time)
    if math.isnan(finger.angle):
        return ix.AT_PIN
    press.x[0] = max(0.0, finger.angle)
    for k in range(n):
        press.x[k + 1], _, _ = surface(press.jacks[k].arm, key.height, press.x[0])
        press.jacks[k].string = press.jacks[k].cell = 0
    key.slip, finger.touch, finger.impulse, finger.blow = 0.0, 0, 0.0, 0.0
    return ix.FINE


@compiled
def change(press):
    """Let strings, impacts and mode follow the state, and write a row; return a status."""
    if press.x[0] >= ix.LARGEST_ANGLE:
        return ix.TURNED_OVER
    update_strings(press)
    status = resolve(press, 0.0)
    if status == ix.FINE:
        select(press)
        write_row(press)
    return status


@expanded
def rests(press):
    """Return whether nothing moves until the finger does or its force changes."""
    key, finger = press.key, press.finger
    if key.slip != 0 or finger.kind == ix.SERVO or (finger.kind == ix.IDEAL and not finger.touch):
        return False
    for k in range(len(press.jacks)):
        if not press.jacks[k].stands and press.jacks[k].sign != 0:
            return False
    return True


@expanded
def pass_event(press, end):
    """Let the mode change where it ends, or end soon where events are crowded; return a status."""
    run = press.run
    write_row(press)
    run.crowd += 1
    status = change(press)
    if status == ix.FINE and run.crowd > 24:
        # A short nonsmooth step after many events without a complete one.
        h = min(1e-3 * run.step, end - run.time)
        status = resolve(press, h)
        run.time, run.crowd = run.time + h, 0
        if status == ix.FINE:
            status = change(press)
    return status


@expanded
def advance(press, end):
    """Advance to a time [s] of smooth action of the finger until then; return a status."""
    run, order = press.run, press.run.order
    status = change(press) if run.changed else ix.FINE
    step, repeated, before, run.crowd, run.changed = end - run.time, False, 0.0, 0, 0
    allowed = run.tolerance ** (1.0 - 2.0 / order)
    while status == ix.FINE and run.time < end and not rests(press):
        run.left -= 1
        step = min(step, end - run.time)
        if not repeated:
            before = guard(press)
            for i in range(len(press.x)):
                for c in range(3):
                    press.work[3 + c, i] = press.work[c, i]
        error = try_step(press, step) / allowed
        repeated = not error <= 1.0 and step > SHORTEST
        if repeated:
            step = max(step * max(0.1, 0.8 * error ** (-1.0 / (order - 1))), SHORTEST)
        elif guard(press) >= 0.0:
            run.time = end if step == end - run.time else run.time + step
            hold_tip(press)
            step *= min(2.0, 0.8 * max(error, 1e-3) ** (-1.0 / (order - 1)))
            run.crowd = 0
        else:
            run.time += locate(press, step, before)
            hold_tip(press)
            status = pass_event(press, end)
            step = end - run.time
        if run.left < 0:
            status = ix.STIFF
        elif not (repeated or math.isfinite(press.x.sum() + press.v.sum())):
            status = ix.LOST
    run.time = end
    return status


@expanded
def advance_step(press, end):
    """Advance to the end [s] of an undivided step, within which a push may end; return a status."""
    key, finger, run, status = press.key, press.finger, press.run, ix.FINE
    while status == ix.FINE and run.time < end:
        until = key.push_end if finger.force != 0.0 and key.push_end < end else end
        status = advance(press, until)
        if status == ix.FINE and until < end:
            write_row(press)
            finger.force, run.changed = 0.0, 1
    if status == ix.FINE:
        run.ends -= 1
        write_row(press)
        run.ends -= 1
        if finger.impulse != 0.0 or finger.blow != 0.0:
            finger.blow, finger.impulse = finger.impulse / run.step, 0.0
            write_row(press)
    return status


@expanded
def start_sample(press, sample, cubics, powered):
    """Start a controller sample; return a status. For the arguments see `play`."""
    key, finger, run, status = press.key, press.finger, press.run, ix.FINE
    run.start = run.time = sample * run.period
    finger.still = 1
    for j in range(2):
        for k in range(4):
            finger.cubics[j, k] = cubics[j, k]
            if k > 0 and cubics[j, k] != 0.0:
                finger.still = 0
    if sample == 0:
        status = rest(press)
    if finger.kind == ix.SERVO and powered:
        for j in range(2):
            p0, p2, p3 = finger.cubics[j, 0], finger.cubics[j, 2], finger.cubics[j, 3]
            at = press.x[len(press.jacks) + 1 + j]
            counts = round((at - finger.start[j]) / finger.radians)
            lag = p0 - finger.start[j] - counts * finger.radians
            close_loop(finger, j, lag, (2 * p2 + 3 * p3) / (run.period * run.period), run.period)
    pushes = finger.kind == ix.PUSH and powered and run.start < key.push_end
    force = key.force if pushes else 0.0
    run.changed = sample == 0 or finger.kind != ix.PUSH or force != finger.force
    finger.force = force
    return status


@entry
def play(given, sample, cubics, samples, powered):
    """Advance a press by controller samples.

    Args:
        given: The `structures.Press` as it comes from Python; its state is replaced.
        sample: Number of the first one; 0 starts from rest.
        cubics: rad, joints over each sample; shape (samples, 2, 4).
        samples: Number of them.
        powered: Whether the motors are on, and a push acts.

    Returns:
        Its status, and the numbers of events and of rows.
    """
    press, status = opened(given), ix.FINE
    run = press.run
    run.events = run.rows = 0
    run.left = MOST_STEPS + (MORE_STEPS + 2 * run.steps) * samples
    run.ends = 2 * run.steps * samples
    for j in range(samples):
        if status == ix.FINE:
            status = start_sample(press, sample + j, cubics[j], powered)
        for k in range(run.steps):
            if status == ix.FINE:
                last = k == run.steps - 1
                end = (sample + j + 1) * run.period if last else run.start + (k + 1) * run.step
                status = advance_step(press, end)
    return status, run.events, run.rows
