"""From event to event through controller samples and complete presses; compiled.

A step at whose end a guard of the mode is violated is repeated, and ends where the first one is.
Impacts and the next mode then follow from the state alone. Where events accumulate, as when
landings alternate between two jacks, a nonsmooth step of first order passes them.
"""

import math

from sautereau.sim_backend.physics.base import LARGEST_ANGLE
from sautereau.sim_backend.physics.exact import structures as ix
from sautereau.sim_backend.physics.exact.compile import compiled, entry, expanded, inlined
from sautereau.sim_backend.physics.exact.fingertip import close_loops, locate_tip
from sautereau.sim_backend.physics.exact.forces import surface
from sautereau.sim_backend.physics.exact.inclusion import resolve, select
from sautereau.sim_backend.physics.exact.step import guard, hold_tip, locate, try_step
from sautereau.sim_backend.physics.exact.strings import update_strings, write_row

SHORTEST = 1e-8
"""s, shortest divided step."""
CROWDED = 24
"""Events without a complete step between them, after which a nonsmooth step is taken."""
NONSMOOTH = 1e-3
"""Dimensionless, fraction of a step: length of a nonsmooth step."""
MOST_STEPS, MORE_STEPS = 200_000, 1000
"""Divided steps of one call, and more of them per sample, above which a scene is too stiff."""

one_press = expanded(ix.one_press)


@compiled
def rest(press, time):
    """Set a press to rest: the key on its rail, or on a fingertip above that; return a status."""
    press.x[:] = 0.0
    press.v[:] = 0.0
    press.a[:] = 0.0
    finger, mode, n = press.finger, press.mode, len(press.jacks)
    if finger.kind == ix.SERVO:
        press.x[n + 1], press.x[n + 2] = press.arm.start[0], press.arm.start[1]
    locate_tip(press, time)
    if math.isnan(finger.angle):
        return ix.AT_PIN
    press.x[0] = max(0.0, finger.angle)
    for k in range(n):
        press.x[k + 1], _, _ = surface(press.jacks[k].arm, press.key.height, press.x[0])
        choir = press.choirs[k]
        choir.string = choir.piece = choir.cell = 0
    mode.slip, mode.touch = 0.0, 0
    return ix.FINE


@compiled
def change(press, time):
    """Let the strings, the impacts and the mode follow the state; return a status."""
    if press.x[0] >= LARGEST_ANGLE:
        return ix.TURNED_OVER
    update_strings(press, time)
    status = resolve(press, time, 0.0)
    if status == ix.FINE:
        select(press, time)
    return status


@inlined
def advance(press, time, end, size, order, tolerance):
    """Advance within an interval of smooth action of the finger; return a status.

    Args:
        press: Its mode is selected.
        time: s.
        end: s.
        size: s, of an undivided step, which need not be the interval's.
        order: Of the steps.
        tolerance: Dimensionless, relative error of a step.
    """
    mode, finger, start = press.mode, press.finger, press.work[0:3]
    step, crowd, repeated, before = end - time, 0, False, 0.0
    allowed = tolerance ** (1.0 - 2.0 / order)
    while time < end:
        if mode.slip == 0 and (finger.kind == ix.PUSH or (finger.kind == ix.IDEAL and mode.touch)):
            moving = False
            for k in range(len(press.choirs)):
                moving = moving or (press.choirs[k].stands == 0 and press.choirs[k].sign != 0)
            if not moving:
                return ix.FINE
        mode.steps -= 1
        if mode.steps < 0:
            return ix.LOST
        step = min(step, end - time)
        if not repeated:
            before = guard(press)
            for i in range(len(press.x)):
                start[0, i], start[1, i], start[2, i] = press.x[i], press.v[i], press.a[i]
        error = try_step(press, start, time, step, order) / allowed
        repeated = not error <= 1.0 and step > SHORTEST
        if repeated:
            step = max(step * max(0.1, 0.8 * error ** (-1.0 / (order - 1))), SHORTEST)
            continue
        if guard(press) >= 0.0:
            time = end if step == end - time else time + step
            hold_tip(press, time)
            if not math.isfinite(press.x.sum() + press.v.sum()):
                return ix.LOST
            step *= min(2.0, 0.8 * max(error, 1e-3) ** (-1.0 / (order - 1)))
            crowd = 0
            continue
        time += locate(press, start, time, step, order, before)
        hold_tip(press, time)
        write_row(press, time)
        status = change(press, time)
        crowd += 1
        if status == ix.FINE and crowd > CROWDED:
            h = min(NONSMOOTH * size, end - time)
            status = resolve(press, time, h)
            time, crowd = time + h, 0
            if status == ix.FINE:
                status = change(press, time)
        if status != ix.FINE:
            return status
        write_row(press, time)
        step = end - time
    return ix.FINE


@inlined
def play_sample(press, sample, cubics, powered, timing):
    """Advance by one controller sample; return a status. For the arguments see `play`."""
    period, steps, order, tolerance = timing
    key, finger, mode = press.key, press.finger, press.mode
    size, start = period / steps, sample * period
    finger.start, finger.period, finger.still = start, period, 1
    for j in range(2):
        for k in range(4):
            finger.cubics[j, k] = cubics[j, k]
            if k > 0 and cubics[j, k] != 0.0:
                finger.still = 0
    if sample == 0:
        status = rest(press, start)
        if status != ix.FINE:
            return status
    if finger.kind == ix.SERVO and powered:
        close_loops(press)
    pushes = finger.kind == ix.PUSH and powered and start < key.push_end
    force = key.force * key.press_arm if pushes else 0.0
    changed = sample == 0 or finger.kind != ix.PUSH or force != finger.moment
    finger.moment = force
    for j in range(steps):
        time, end = start + j * size, start + (j + 1) * size
        if j == steps - 1:
            end = (sample + 1) * period
        while time < end:
            until = end
            if finger.moment != 0.0 and key.push_end < end:
                until = max(key.push_end, time)
            if changed:
                status = change(press, time)
                if status != ix.FINE:
                    return status
                write_row(press, time)
            status = advance(press, time, until, size, order, tolerance)
            if status != ix.FINE:
                return status
            if until < end:
                write_row(press, until)
                finger.moment = 0.0
            changed = until < end
            time = until
        mode.ends -= 1
        write_row(press, end)
    return ix.FINE


@entry
def play(presses, number, sample, cubics, powered, timing):
    """Advance one of many presses by controller samples.

    Args:
        presses: Their state, events and rows are replaced.
        number: Of the press.
        sample: Number of the first one; 0 starts from rest.
        cubics: rad, joints over each sample; shape (samples, 2, 4).
        powered: Whether the motors are on, and a push acts.
        timing: s, of the controller's period; number of steps in a sample, of equal length; their
            order, and the relative error of a step.

    Returns:
        Its status, and the numbers of events and of rows.
    """
    press = one_press(presses, number)
    mode, status, steps = press.mode, ix.FINE, timing[1]
    mode.events = mode.rows = 0
    mode.steps = MOST_STEPS + (MORE_STEPS + 2 * steps) * len(cubics)
    mode.ends = steps * len(cubics)
    for i in range(len(cubics)):
        if status == ix.FINE:
            status = play_sample(press, sample + i, cubics[i], powered, timing)
    return status, mode.events, mode.rows


@entry
def play_presses(presses, sample, cubics, samples, powered, timing, found, status):
    """Play complete presses; record each string's first contact and release.

    Args:
        presses: As of `play`.
        sample: As of `play`; an argument, because numba compiles functions again for literals.
        cubics: rad, joints of an ideal finger over each sample; shape (samples, 2, 4).
        samples: Controller samples of each press; shape (presses,).
        powered: As of `play`.
        timing: As of `play`.
        found: Contact and release [s], force at release [N], speed of the jack there [m/s];
            shape (presses, choirs, 4); initially infinite, as it stays without the event.
        status: Of each press; shape (presses,).
    """
    for i in range(len(status)):
        if status[i] != ix.FINE:
            continue
        status[i], events, _ = play(presses, i, sample, cubics[: samples[i]], powered, timing)
        for e in range(events - 1, -1, -1):
            event = presses.events[e]
            row = found[i, int(event[2])]
            if event[1] == ix.CONTACT:
                row[0] = event[0]
            elif event[1] == ix.RELEASE:
                row[1], row[2], row[3] = event[0], event[3], event[4]
