"""From one mode to the next: impacts without rebound, and the mode that can last."""

import math
from collections.abc import Iterable
from itertools import product

import numpy as np
from scipy.optimize import nnls

from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.reference.conditions import SHARE, conditions
from sautereau.sim_backend.physics.reference.drive_segments import Leg
from sautereau.sim_backend.physics.reference.equations import Instant, Stretch
from sautereau.sim_backend.physics.reference.jack import StringState
from sautereau.sim_backend.physics.reference.linkage import Touch
from sautereau.sim_backend.physics.reference.mode import Felt, JackMode, Meeting, Mode
from sautereau.sim_backend.physics.reference.projection import apart
from sautereau.sim_backend.physics.reference.system import State, System

CLOSE = 1e-13
"""rad and m, gap that is none."""
SLOW = 1e-11
"""rad/s and m/s, speed that is none."""
SURE = 0.1
"""1, of a condition's tolerance, by which it may be overstepped in a mode that begins."""
OF_MODE = {
    "the key breaks loose upwards",
    "the key breaks loose downwards",
    "the finger leaves the key",
    "the jack leaves the key",
    "the jack slides up",
    "the jack slides down",
}
"""Conditions on forces: those on places and speeds follow the motion, whatever the mode."""


def strike(system: System, leg: Leg, time: float, x: State) -> State:
    """Return the state after all that is met has been met, without rebound.

    The speeds become those nearest to the ones before, by kinetic energy, that no surface
    forbids: so impulses push only and conserve momentum.

    Args:
        system: The bench.
        leg: That begins or goes on.
        time: s.
        x: State before.

    Raises:
        SceneError: The fingertip is in the midst of the key.
    """
    after = apart(system, leg, time, x)
    n = len(system.jacks)
    touch = system.touch(leg, time, after)
    size = 1 + n + (2 if system.arm else 0)
    mass = np.eye(size)
    mass[0, 0] = system.inertia
    mass[range(1, 1 + n), range(1, 1 + n)] = [jack.mass for jack in system.jacks]
    feet = [jack.foot(after[0]) for jack in system.jacks]
    touched = touch is not None and after[0] - touch.angle <= CLOSE
    key, *flights = np.eye(size)[: 1 + n]
    rows = [
        flight - slope * key
        for k, (flight, (rise, slope, _)) in enumerate(zip(flights, feet, strict=True))
        if after[2 + 2 * k] - rise <= CLOSE
    ]
    # An ideal finger and the rail both hold the key up: the faster of the two counts.
    lead = 0.0
    if system.arm:
        own = system.arm.inertia(*after[-4:])
        mass[-2:, -2:] = [[own.m11, own.m12], [own.m12, own.m22]]
        if touch and touched:
            held = key.copy()
            held[-2:] = -touch.slope1, -touch.slope2
            rows.append(held)
    elif touch and touched:
        lead = touch.spin if after[0] > CLOSE else max(touch.spin, 0.0)
        rows.append(key)
    if after[0] <= CLOSE and lead == 0.0:
        rows.append(key)
    if not rows:
        return after
    carried = np.zeros(size)
    carried[: 1 + n] = [lead, *(lead * slope for _, slope, _ in feet)]
    constraints = np.array(rows)
    moving = np.array([*after[1 : 2 + 2 * n : 2], *(after[-2:] if system.arm else ())]) - carried
    if (constraints @ moving >= -SLOW * 1e-2).all():
        return after
    # min |L^-1 G' p + L' u| over p >= 0 is the dual of the nearest speeds.
    scale = np.linalg.cholesky(mass)
    pull = np.linalg.solve(scale, constraints.T)
    impulses, _ = nnls(pull, -scale.T @ moving)
    speeds = moving + np.linalg.solve(scale.T, pull @ impulses) + carried
    after[1] = float(speeds[0])
    after[3 : 2 + 2 * n : 2] = speeds[1 : 1 + n].tolist()
    if system.arm:
        after[-2:] = speeds[-2:].tolist()
    return after


def meeting_of(system: System, x: State, strings: Iterable[StringState]) -> Meeting:
    """Return what dampers and felt do in a state; the strings remember."""
    angle, spin = x[0], x[1]
    felt = Felt.OFF
    if angle > system.dip:
        felt = Felt.PRESSED if system.felt(angle, spin) >= 0 else Felt.SLACK
    damped = tuple(x[2 + 2 * k] < jack.lift for k, jack in enumerate(system.jacks))
    return Meeting(tuple(strings), damped, felt)


def begin(system: System, leg: Leg, time: float, x: State, meeting: Meeting) -> Stretch:
    """Return the bench in the mode whose conditions hold and go on to hold.

    The accelerations are those of least constraint (Gauss), which are unique: of several
    modes that have them the first is taken, of none that has them to rounding the best.

    Args:
        system: The bench.
        leg: That begins or goes on.
        time: s.
        x: State, in which all impacts are over.
        meeting: Strings, dampers and felt.

    Raises:
        SceneError: The forces are no numbers.
    """
    touch = system.touch(leg, time, x)
    best, least = None, math.inf
    for mode in _modes(system, leg, time, x, touch):
        stretch = Stretch(system, leg, mode, meeting)
        now = stretch.at(time, x)
        lasting = (c for c in conditions(stretch, now) if c.name in OF_MODE)
        worst = max(
            [
                0.0,
                *(-c.value / c.tolerance for c in lasting),
                *_starts(system, mode, now, x, leg, time),
            ]
        )
        if worst <= SURE:
            return stretch
        if worst < least:  # never where it is no number
            best, least = stretch, worst
    if best is None:
        raise SceneError(
            f"rig {system.name}: at {time:.9g} s the reference lost its numbers; the scene's forces"
            " are out of its range"
        )
    return best


def _modes(system: System, leg: Leg, time: float, x: State, touch: Touch | None):
    """Yield the modes that a state's places and speeds allow, the most restful first."""
    angle, spin = x[0], x[1]
    still = abs(spin) <= SLOW
    rail = angle <= CLOSE and still
    near = touch is not None and _meet(x, touch)
    holds = system.dry > 0 or any(jack.friction > 0 for jack in system.jacks)
    slips = [_sign(spin)]
    if still:
        slips = ([0] if rail or holds else []) + [1] + ([] if rail else [-1])
    kinds = []
    for k, jack in enumerate(system.jacks):
        rise, slope, _ = jack.foot(angle)
        y, v = x[2 + 2 * k], x[3 + 2 * k]
        stands = y - rise <= CLOSE and abs(v - slope * spin) <= SLOW
        air = [JackMode(_sign(v))]
        if abs(v) <= SLOW:
            air = [JackMode.RISES, JackMode.FALLS]
            air = [JackMode.HANGS, *air] if jack.friction > 0 else air
        kinds.append(([JackMode.STANDS] if stands else []) + air)
    for touches in (True, False) if near else (False,):
        ways = slips
        if touches and leg.path:
            ways = [0] if leg.path.still else [_led_sign(leg, time)]
        for slip, jacks in product(ways, product(*kinds)):
            yield Mode(slip, rail and not slip, touches, jacks)


def _led_sign(leg: Leg, time: float) -> int:
    """Return which way an ideal finger is about to turn the key."""
    if leg.path is None:
        return 0
    spin = leg.path.lead(time).touch.spin
    if abs(spin) <= SLOW:
        spin = leg.path.lead(time + 1e-6 * (leg.end - leg.start)).touch.spin
    return _sign(spin)


def _starts(
    system: System, mode: Mode, now: Instant, x: State, leg: Leg, time: float
) -> list[float]:
    """Return by how much what begins to move begins the wrong way, over what is allowed."""
    wrong = []
    allowed = SHARE * system.moment_scale
    led = mode.touch and leg.path is not None
    if mode.slip and not led and abs(x[1]) <= SLOW:
        wrong.append(-mode.slip * now.acceleration * system.inertia / allowed)
    touch = now.touch
    if touch and not mode.touch and _meet(x, touch):
        if leg.path:
            under = leg.path.lead(time).acceleration
        else:
            under = touch.slope1 * now.joints[0] + touch.slope2 * now.joints[1] + touch.bend
        wrong.append((under - now.acceleration) * system.inertia / allowed)
    for k, (jack, law) in enumerate(zip(now.jacks, system.jacks, strict=True)):
        if jack.mode is JackMode.STANDS:
            continue
        own = law.mass / (SHARE * (law.mass * 9.8 + law.friction))
        if jack.mode and abs(x[3 + 2 * k]) <= SLOW:
            wrong.append(-jack.mode * jack.acceleration * own)
        gap, speed = jack.rise - jack.foot, x[3 + 2 * k] - jack.slope * now.spin
        if gap <= CLOSE and abs(speed) <= SLOW:
            foot = jack.slope * now.acceleration + jack.bend
            wrong.append((foot - jack.acceleration) * own)
    return wrong


def _meet(x: State, touch: Touch) -> bool:
    """Return whether the fingertip is at the key, and as fast."""
    return x[0] - touch.angle <= CLOSE and abs(x[1] - touch.spin) <= SLOW


def _sign(value: float) -> int:
    return 1 if value >= 0 else -1
