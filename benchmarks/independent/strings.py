"""The strings' modes, and the contact of plectrum and string with its events."""

import numpy as np

from .compiled import compiled, inlined
from .elastica import solve_place

BELOW, HELD, ABOVE, PASSING = 0, 1, 2, 3
"""The plectrum stands below the string, holds it, stands above it, or passes it downwards."""
CONTACT, RELEASE, LOST = 0, 1, 2
"""Kinds of events; a contact is lost where the plectrum leaves a string without a release."""


@compiled
def drift_strings(dt, heights, choirs, s):
    """Kick the strings by half a step of their loads and propagate their modes exactly by ``dt``.

    The dampers of jacks at ``heights`` may lie on them. A string never touched does not move.
    """
    for c in range(len(heights)):
        if choirs.string[c, 1] == 1.0 or not s.touched[c]:
            continue
        felt = 1 if choirs.damper[c, 0] > 0 and heights[c] < choirs.damper[c, 1] else 0
        for d in range(2):
            for k in range(choirs.modes.shape[1]):
                kick = dt / 2 * s.load[c, d] * choirs.modes[c, k, 0] * choirs.modes[c, k, 1]
                old, fast = s.position[c, d, k], s.velocity[c, d, k] + kick
                row = choirs.propagators[c, felt, k]
                s.position[c, d, k] = row[0] * old + row[1] * fast
                s.velocity[c, d, k] = row[2] * old + row[3] * fast


@compiled
def kick_strings(dt, choirs, s):
    """Kick the strings by half a step of their loads."""
    for c in range(len(s.load)):
        for d in range(2):
            if s.load[c, d] != 0.0:
                for k in range(choirs.modes.shape[1]):
                    kick = dt / 2 * s.load[c, d] * choirs.modes[c, k, 0] * choirs.modes[c, k, 1]
                    s.velocity[c, d, k] += kick


@inlined
def _note(events, found, c, kind, time, load):
    if found < events.shape[0]:
        events[found, 0], events[found, 1] = c, kind
        events[found, 2], events[found, 3] = time, load
    return found + 1


@compiled
def _passing(c, height, choirs, s):
    """Return the tongue's upward force [N] on a jack whose plectrum has plucked string ``c``."""
    if height >= 0:
        s.state[c] = ABOVE
        return 0.0
    s.state[c] = PASSING
    if -height > choirs.tongue[c, 1]:
        s.state[c] = BELOW
        s.gap[c] = max(s.gap[c], 1e-12)
    return choirs.tongue[c, 0] * min(-height / 20e-6, 1.0)


@compiled
def _string_place(c, height, choirs, s):
    """Return the place (m) of string ``c`` along and above the plectrum of a jack."""
    x0, offset = choirs.plectrum[c, 2], choirs.plectrum[c, 3]
    if choirs.string[c, 1] == 1.0:
        return x0, offset - height
    x = x0 + choirs.string[c, 0] * s.load[c, 0]
    z = offset - height + choirs.string[c, 0] * s.load[c, 1]
    if s.touched[c]:
        for k in range(choirs.modes.shape[1]):
            x += s.position[c, 0, k] * choirs.modes[c, k, 0]
            z += s.position[c, 1, k] * choirs.modes[c, k, 0]
    return x, z


@compiled
def _between(x, places, values):
    """Return what `numpy.interp` does, which takes a second longer to compile."""
    low, high = 0, len(places) - 1
    if x <= places[low]:
        return values[low]
    if x >= places[high]:
        return values[high]
    while high - low > 1:
        middle = (low + high) // 2
        if places[middle] <= x:
            low = middle
        else:
            high = middle
    slope = (values[high] - values[low]) / (places[high] - places[low])
    return slope * (x - places[low]) + values[low]


@compiled
def _hold(c, x, z, load, choirs, s):
    """Find place, load and friction of a string ``c`` that the plectrum holds.

    A string that sticks stays at its place by the friction that the compliance of the omitted modes
    then needs. That is solved within the step: with the friction of the step before, the modes
    would gain energy.

    Args:
        x, z: m, of the string, with the residual displacement by its previous ``load`` along x, N.
    """
    stiff, length, _, offset, friction, inner = choirs.plectrum[c]
    residual = choirs.string[c, 0]
    free = x - residual * load
    first = s.place[c] == 0
    place = x if first else s.place[c]
    if first:
        s.drag[c] = 0.0
    for _ in range(40):
        s.bend[c], place, theta = solve_place(
            choirs.tables[c],
            inner,
            length,
            s.shapes[c],
            x,
            z,
            offset,
            s.bend[c],
            place,
            s.drag[c],
        )
        normal = stiff * s.bend[c] / place**2
        sine, cosine = np.sin(theta), np.cos(theta)
        if friction == 0.0:
            break
        if first:
            s.stuck[c], first = place, False
        give = residual * normal * friction * cosine
        needed = s.drag[c] + (place - s.stuck[c]) / give if give > 0 else 0.0
        s.drag[c] = min(max(needed, -1.0), 1.0)
        before, x = x, free + residual * normal * (sine - friction * s.drag[c] * cosine)
        if abs(x - before) < 1e-13:
            break
    if abs(s.drag[c]) == 1.0:
        s.stuck[c] = place
    s.place[c] = place
    s.load[c, 0] = normal * (sine - friction * s.drag[c] * cosine)
    s.load[c, 1] = normal * (cosine + friction * s.drag[c] * sine)
    s.push[c] = s.load[c, 1]


@compiled
def pluck(i, dt, c, height, choirs, s, events, found):
    """Update contact and loads of string ``c`` for a jack at ``height`` above contact.

    Events are located between the steps i - 1 and i by the linear course of the gap, and of the
    string's place on the plectrum.

    Returns:
        Number of events found so far; N, upward force of the passing tongue on the jack.
    """
    length, offset = choirs.plectrum[c, 1], choirs.plectrum[c, 3]
    static = choirs.string[c, 1] == 1.0
    old_push, old_gap, old_load = s.push[c], s.gap[c], s.load[c, 0]
    x, z = _string_place(c, height, choirs, s)
    s.gap[c] = z - offset
    s.push[c] = s.load[c, 0] = s.load[c, 1] = 0.0
    if s.state[c] == ABOVE or s.state[c] == PASSING:
        return found, _passing(c, height, choirs, s)
    if s.gap[c] > 0:
        if s.state[c] == HELD:
            s.state[c] = BELOW
            s.bend[c] = 0.0
            found = _note(events, found, c, LOST, i * dt, 0.0)
        return found, 0.0
    if s.state[c] == BELOW:
        s.state[c] = HELD
        s.touched[c] = True
        s.place[c] = 0.0
        at = old_gap / (old_gap - s.gap[c]) if old_gap > 0 else 1.0
        found = _note(events, found, c, CONTACT, (i - 1 + at) * dt, 0.0)
    if static:
        top = choirs.static_height[c, -1]
        beyond, before = height - top, -old_gap - top
        s.push[c] = _between(height, choirs.static_height[c], choirs.static_load[c])
    else:
        before = s.place[c] - length
        _hold(c, x, z, old_load, choirs, s)
        beyond = s.place[c] - length
    if beyond >= 0:
        at = before / (before - beyond) if before < 0 else 0.0
        load = old_push + at * (s.push[c] - old_push)
        found = _note(events, found, c, RELEASE, (i - 1 + at) * dt, load)
        s.state[c] = ABOVE
        s.push[c] = s.load[c, 0] = s.load[c, 1] = s.bend[c] = 0.0
    return found, 0.0
