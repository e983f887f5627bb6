"""The conditions (guards) of a mode, and the time at which the first of them fails."""

import math
from collections.abc import Callable
from typing import NamedTuple

from scipy.optimize import brentq

from sautereau.rig.section import GRAVITY
from sautereau.sim_backend.physics.reference.equations import Instant, ModeEquations
from sautereau.sim_backend.physics.reference.jack import StringMode
from sautereau.sim_backend.physics.reference.mode import Felt, JackMode
from sautereau.sim_backend.physics.reference.system import State

ANGLE = 1e-15
"""rad, tolerance of a condition on the key's angle."""
HEIGHT = 1e-15
"""m, tolerance of a condition on a height."""
ANGULAR_VELOCITY = 1e-13
"""rad/s, tolerance of a condition on the key's angular velocity."""
SPEED = 1e-14
"""m/s, tolerance of a condition on a jack's speed."""
FORCE = 1e-11
"""Dimensionless, fraction of the bench's weights: tolerance of a condition on a force."""
LARGEST_ANGLE = 1.2
"""rad, of the key, above which the simulation is stopped; the closed form ends at pi / 2."""
TIME = 1e-15
"""s, tolerance of an event's time."""


class Condition(NamedTuple):
    """A quantity that is positive as long as a mode lasts."""

    name: str
    jack: int
    """Index of the jack; 0 for a condition on the key."""
    value: float
    tolerance: float


def conditions(equations: ModeEquations, now: Instant) -> list[Condition]:
    """Return all conditions of the mode."""
    system, mode, force_modes = equations.system, equations.mode, equations.force_modes
    force = FORCE * system.moment_scale
    found = [Condition("the key turns over", 0, LARGEST_ANGLE - now.angle, ANGLE)]

    def add(name: str, value: float, tolerance: float, jack: int = 0) -> None:
        found.append(Condition(name, jack, value, tolerance))

    if mode.slip:
        add("the key stops", mode.slip * now.angular_velocity, ANGULAR_VELOCITY)
        if mode.slip < 0:
            add("contact of key and rail", now.angle, ANGLE)
    elif not equations.prescribed:
        add("the key breaks loose upwards", now.dry - now.balance, force)
        if not mode.rail:
            add("the key breaks loose downwards", now.dry_down + now.balance, force)
    if mode.touching:
        add("the finger leaves the key", now.finger, force)
    elif now.contact:
        add("contact of finger and key", now.angle - now.contact.angle, ANGLE)
    if force_modes.felt is Felt.OFF:
        add("contact of key and felt", system.dip - now.angle, ANGLE)
    else:
        push = system.felt(now.angle, now.angular_velocity)
        sign = 1 if force_modes.felt is Felt.PRESSED else -1
        add("the key leaves the felt", now.angle - system.dip, ANGLE)
        add("the felt pushes or not", sign * push, force)
    for k, (jack, law) in enumerate(zip(now.jacks, system.jacks, strict=True)):
        own = FORCE * (law.mass * GRAVITY + law.friction)
        if jack.mode is JackMode.STANDS:
            add("the jack leaves the key", jack.load, own, k)
        else:
            add("the jack lands", jack.rise - jack.key_rise, HEIGHT, k)
            if jack.mode is JackMode.HANGS:
                add("the jack slides up", law.friction + jack.static_load, own, k)
                add("the jack slides down", law.friction - jack.static_load, own, k)
            else:
                add("the jack stops", jack.mode * jack.speed, SPEED, k)
        if law.lift > -math.inf:
            sign = 1 if force_modes.damped[k] else -1
            add("the damper", sign * (law.lift - jack.rise), HEIGHT, k)
        if law.pluck:
            height = jack.rise - law.clearance
            state = force_modes.strings[k]
            if state is StringMode.BELOW:
                add("contact", -height, HEIGHT, k)
            elif state is StringMode.HELD:
                add("contact lost", height, HEIGHT, k)
                add("release", law.pluck.release_height - height, HEIGHT, k)
            elif state is StringMode.ABOVE:
                add("the plectrum falls on the string", height, HEIGHT, k)
            else:
                add("above again", -height, HEIGHT, k)
                add("return", law.travel + height, HEIGHT, k)
    return found


def first_violated(found: list[Condition]) -> Condition | None:
    """Return the first condition that is violated or not a number."""
    return next((c for c in found if not c.value >= -c.tolerance), None)


def locate(
    equations: ModeEquations, dense: Callable[[float], State], before: float, after: float
) -> tuple[Condition, float]:
    """Return the first condition that fails between two times, and when [s]."""
    violated = [
        i
        for i, c in enumerate(conditions(equations, equations.at(after, dense(after))))
        if not c.value >= -c.tolerance
    ]

    def margin(time: float, i: int) -> float:
        condition = conditions(equations, equations.at(time, dense(time)))[i]
        return condition.value + condition.tolerance

    when, first = min((_failing(lambda t, i=i: margin(t, i), before, after), i) for i in violated)
    return conditions(equations, equations.at(when, dense(when)))[first], when


def _failing(margin: Callable[[float], float], low: float, high: float) -> float:
    """Return the first time [s] at which a margin is negative, to rounding."""
    found = float(brentq(margin, low, high, xtol=TIME))  # pyright: ignore[reportArgumentType]
    step = math.ulp(found)
    while found < high and not margin(found) < 0:
        found, step = min(found + step, high), 2 * step
    return found
