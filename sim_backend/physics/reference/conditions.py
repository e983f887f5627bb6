"""The conditions under which a mode lasts, and when the first of them fails."""

import math
from collections.abc import Callable
from typing import NamedTuple

from scipy.optimize import brentq

from sautereau.rig.section import GRAVITY
from sautereau.sim_backend.physics.reference.equations import Instant, Stretch
from sautereau.sim_backend.physics.reference.jack import StringState
from sautereau.sim_backend.physics.reference.mode import Felt, JackMode
from sautereau.sim_backend.physics.reference.system import State

ANGLE = 1e-15
"""rad, by which a condition on the key's angle is overstepped before it counts."""
HEIGHT = 1e-15
"""m, of one on a height."""
SPIN = 1e-13
"""rad/s, of one on the key's speed."""
SPEED = 1e-14
"""m/s, of one on a jack's speed."""
SHARE = 1e-11
"""1, of the bench's weights, of one on a force."""
TURNED = 1.2
"""rad, at which a key has left its place; its closed form ends at pi / 2."""
TIME = 1e-15
"""s, to which an event is looked for."""


class Condition(NamedTuple):
    """What is positive as long as a mode lasts."""

    name: str
    jack: int
    """Of which jack, where it is of one."""
    value: float
    tolerance: float


def conditions(stretch: Stretch, now: Instant) -> list[Condition]:
    """Return all that must stay positive for the mode to last."""
    system, mode, meeting = stretch.system, stretch.mode, stretch.meeting
    force = SHARE * system.moment_scale
    found = [Condition("the key turns over", 0, TURNED - now.angle, ANGLE)]

    def add(name: str, value: float, tolerance: float, jack: int = 0) -> None:
        found.append(Condition(name, jack, value, tolerance))

    if mode.slip:
        add("the key stops", mode.slip * now.spin, SPIN)
        if mode.slip < 0:
            add("the key meets the rail", now.angle, ANGLE)
    elif not stretch.led:
        add("the key breaks loose upwards", now.dry - now.balance, force)
        if not mode.rail:
            add("the key breaks loose downwards", now.dry_down + now.balance, force)
    if mode.touch:
        add("the finger leaves the key", now.finger, force)
    elif now.touch:
        add("the finger meets the key", now.angle - now.touch.angle, ANGLE)
    if meeting.felt is Felt.OFF:
        add("the key meets the felt", system.dip - now.angle, ANGLE)
    else:
        push = system.felt(now.angle, now.spin)
        sign = 1 if meeting.felt is Felt.PRESSED else -1
        add("the key leaves the felt", now.angle - system.dip, ANGLE)
        add("the felt pushes or not", sign * push, force)
    for k, (jack, law) in enumerate(zip(now.jacks, system.jacks, strict=True)):
        own = SHARE * (law.mass * GRAVITY + law.friction)
        if jack.mode is JackMode.STANDS:
            add("the jack leaves the key", jack.load, own, k)
        else:
            add("the jack lands", jack.rise - jack.foot, HEIGHT, k)
            if jack.mode is JackMode.HANGS:
                add("the jack slides up", law.friction + jack.burden, own, k)
                add("the jack slides down", law.friction - jack.burden, own, k)
            else:
                add("the jack stops", jack.mode * jack.speed, SPEED, k)
        if law.lift > -math.inf:
            sign = 1 if meeting.damped[k] else -1
            add("the damper", sign * (law.lift - jack.rise), HEIGHT, k)
        if law.pluck:
            height = jack.rise - law.clearance
            state = meeting.strings[k]
            if state is StringState.BELOW:
                add("contact", -height, HEIGHT, k)
            elif state is StringState.HELD:
                add("held no more", height, HEIGHT, k)
                add("release", law.pluck.release_height - height, HEIGHT, k)
            elif state is StringState.ABOVE:
                add("the plectrum falls on the string", height, HEIGHT, k)
            else:
                add("above again", -height, HEIGHT, k)
                add("return", law.travel + height, HEIGHT, k)
    return found


def first_broken(found: list[Condition]) -> Condition | None:
    """Return the first condition that is overstepped, or that is no number."""
    return next((c for c in found if not c.value >= -c.tolerance), None)


def locate(
    stretch: Stretch, dense: Callable[[float], State], before: float, after: float
) -> tuple[Condition, float]:
    """Return the first condition that fails between two times, and when [s]."""
    broken = [
        i
        for i, c in enumerate(conditions(stretch, stretch.at(after, dense(after))))
        if not c.value >= -c.tolerance
    ]

    def margin(time: float, i: int) -> float:
        condition = conditions(stretch, stretch.at(time, dense(time)))[i]
        return condition.value + condition.tolerance

    when, first = min((_failing(lambda t, i=i: margin(t, i), before, after), i) for i in broken)
    return conditions(stretch, stretch.at(when, dense(when)))[first], when


def _failing(margin: Callable[[float], float], low: float, high: float) -> float:
    """Return the first time [s] at which a margin is negative, to rounding."""
    found = float(brentq(margin, low, high, xtol=TIME))  # pyright: ignore[reportArgumentType]
    step = math.ulp(found)
    while found < high and not margin(found) < 0:
        found, step = min(found + step, high), 2 * step
    return found
