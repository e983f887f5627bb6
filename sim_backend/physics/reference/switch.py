"""Transition between modes: plastic impacts, and selection of the next mode."""

import math
from collections.abc import Iterable
from itertools import product

import numpy as np
from scipy.optimize import nnls

from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.reference.conditions import FORCE, conditions
from sautereau.sim_backend.physics.reference.drive_segments import DriveSegment
from sautereau.sim_backend.physics.reference.equations import Instant, ModeEquations
from sautereau.sim_backend.physics.reference.jack import StringMode
from sautereau.sim_backend.physics.reference.linkage import KeyUnderFingertip
from sautereau.sim_backend.physics.reference.mode import Felt, ForceModes, JackMode, Mode
from sautereau.sim_backend.physics.reference.projection import separated
from sautereau.sim_backend.physics.reference.system import State, System

CLOSE = 1e-13
"""rad and m, gap below which surfaces are in contact."""
SLOW = 1e-11
"""rad/s and m/s, speed below which it counts as zero."""
MODE_TOLERANCE = 0.1
"""Dimensionless, fraction of a condition's tolerance allowed at the start of a mode."""
FORCE_CONDITIONS = {
    "the key breaks loose upwards",
    "the key breaks loose downwards",
    "the finger leaves the key",
    "the jack leaves the key",
    "the jack slides up",
    "the jack slides down",
}
"""Conditions on forces; those on positions and speeds do not depend on the choice of mode."""


def resolve_impacts(system: System, segment: DriveSegment, time: float, x: State) -> State:
    """Return the state after all impacts, which are plastic (without rebound).

    The new velocities are the nearest to the old ones, in the norm of kinetic energy, that no
    surface forbids. The impulses are then repulsive and conserve momentum.

    Args:
        system: The bench.
        segment: The present drive segment.
        time: s.
        x: State before the impacts.

    Raises:
        SceneError: Fingertip and key overlap.
    """
    after = separated(system, segment, time, x)
    n = len(system.jacks)
    contact = system.key_under_fingertip(segment, time, after)
    size = 1 + n + (2 if system.arm else 0)
    mass = np.eye(size)
    mass[0, 0] = system.inertia
    mass[range(1, 1 + n), range(1, 1 + n)] = [jack.mass for jack in system.jacks]
    surfaces = [jack.kinematics(after[0]) for jack in system.jacks]
    in_contact = contact is not None and after[0] - contact.angle <= CLOSE
    key, *flights = np.eye(size)[: 1 + n]
    rows = [
        flight - slope * key
        for k, (flight, (rise, slope, _)) in enumerate(zip(flights, surfaces, strict=True))
        if after[2 + 2 * k] - rise <= CLOSE
    ]
    # An ideal finger and the rail both bound the velocity from below: the larger bound counts.
    least_omega = 0.0
    if system.arm:
        own = system.arm.inertia(*after[-4:])
        mass[-2:, -2:] = [[own.m11, own.m12], [own.m12, own.m22]]
        if contact and in_contact:
            held = key.copy()
            held[-2:] = -contact.slope1, -contact.slope2
            rows.append(held)
    elif contact and in_contact:
        least_omega = contact.angular_velocity
        if after[0] <= CLOSE:
            least_omega = max(least_omega, 0.0)
        rows.append(key)
    if after[0] <= CLOSE and least_omega == 0.0:
        rows.append(key)
    if not rows:
        return after
    carried = np.zeros(size)
    carried[: 1 + n] = [least_omega, *(least_omega * slope for _, slope, _ in surfaces)]
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


def force_modes_of(system: System, x: State, strings: Iterable[StringMode]) -> ForceModes:
    """Return the modes of dampers and felt in a state; those of the strings are given."""
    angle, omega = x[0], x[1]
    felt = Felt.OFF
    if angle > system.dip:
        felt = Felt.PRESSED if system.felt(angle, omega) >= 0 else Felt.SLACK
    damped = tuple(x[2 + 2 * k] < jack.lift for k, jack in enumerate(system.jacks))
    return ForceModes(tuple(strings), damped, felt)


def select_mode(
    system: System, segment: DriveSegment, time: float, x: State, force_modes: ForceModes
) -> ModeEquations:
    """Return the equations of the mode whose conditions hold and continue to hold.

    The accelerations are those of least constraint (Gauss), which are unique. If several modes
    have them, the first is taken; if none has them to rounding, the best.

    Args:
        system: The bench.
        segment: The present drive segment.
        time: s.
        x: State after all impacts.
        force_modes: Of strings, dampers and felt.

    Raises:
        SceneError: The forces are not finite.
    """
    contact = system.key_under_fingertip(segment, time, x)
    best, least = None, math.inf
    for mode in _modes(system, segment, time, x, contact):
        equations = ModeEquations(system, segment, mode, force_modes)
        now = equations.at(time, x)
        lasting = (c for c in conditions(equations, now) if c.name in FORCE_CONDITIONS)
        worst = max(
            [
                0.0,
                *(-c.value / c.tolerance for c in lasting),
                *_initial_violations(system, mode, now, x, segment, time),
            ]
        )
        if worst <= MODE_TOLERANCE:
            return equations
        if worst < least:  # never where it is NaN
            best, least = equations, worst
    if best is None:
        raise SceneError(
            f"rig {system.name}: at {time:.9g} s the reference diverged; the scene's forces"
            " are out of its range: lower masses, stiffness or damping"
        )
    return best


def _modes(
    system: System, segment: DriveSegment, time: float, x: State, contact: KeyUnderFingertip | None
):
    """Yield the modes that a state's positions and speeds allow, those at rest first."""
    angle, omega = x[0], x[1]
    still = abs(omega) <= SLOW
    rail = angle <= CLOSE and still
    near = contact is not None and _in_contact(x, contact)
    holds = system.dry > 0 or any(jack.friction > 0 for jack in system.jacks)
    slips = [_sign(omega)]
    if still:
        slips = ([0] if rail or holds else []) + [1] + ([] if rail else [-1])
    jack_modes = []
    for k, jack in enumerate(system.jacks):
        rise, slope, _ = jack.kinematics(angle)
        y, v = x[2 + 2 * k], x[3 + 2 * k]
        stands = y - rise <= CLOSE and abs(v - slope * omega) <= SLOW
        air = [JackMode(_sign(v))]
        if abs(v) <= SLOW:
            air = [JackMode.RISES, JackMode.FALLS]
            air = [JackMode.HANGS, *air] if jack.friction > 0 else air
        jack_modes.append(([JackMode.STANDS] if stands else []) + air)
    for touching in (True, False) if near else (False,):
        directions = slips
        if touching and segment.path:
            directions = [0] if segment.path.still else [_prescribed_sign(segment, time)]
        for slip, jacks in product(directions, product(*jack_modes)):
            yield Mode(slip, rail and not slip, touching, jacks)


def _prescribed_sign(segment: DriveSegment, time: float) -> int:
    """Return the direction in which an ideal finger is about to turn the key."""
    if segment.path is None:
        return 0
    omega = segment.path.key_motion(time).contact.angular_velocity
    if abs(omega) <= SLOW:
        later = time + 1e-6 * (segment.end - segment.start)
        omega = segment.path.key_motion(later).contact.angular_velocity
    return _sign(omega)


def _initial_violations(
    system: System, mode: Mode, now: Instant, x: State, segment: DriveSegment, time: float
) -> list[float]:
    """Return the accelerations of the wrong sign at the start of a motion, over their tolerance."""
    wrong = []
    allowed = FORCE * system.moment_scale
    prescribed = mode.touching and segment.path is not None
    if mode.slip and not prescribed and abs(x[1]) <= SLOW:
        wrong.append(-mode.slip * now.acceleration * system.inertia / allowed)
    contact = now.contact
    if contact and not mode.touching and _in_contact(x, contact):
        if segment.path:
            under = segment.path.key_motion(time).acceleration
        else:
            under = contact.slope1 * now.joints[0] + contact.slope2 * now.joints[1] + contact.bias
        wrong.append((under - now.acceleration) * system.inertia / allowed)
    for k, (jack, law) in enumerate(zip(now.jacks, system.jacks, strict=True)):
        if jack.mode is JackMode.STANDS:
            continue
        own = law.mass / (FORCE * (law.mass * 9.8 + law.friction))
        if jack.mode and abs(x[3 + 2 * k]) <= SLOW:
            wrong.append(-jack.mode * jack.acceleration * own)
        gap, speed = jack.rise - jack.key_rise, x[3 + 2 * k] - jack.slope * now.angular_velocity
        if gap <= CLOSE and abs(speed) <= SLOW:
            surface = jack.slope * now.acceleration + jack.bias
            wrong.append((surface - jack.acceleration) * own)
    return wrong


def _in_contact(x: State, contact: KeyUnderFingertip) -> bool:
    """Return whether fingertip and key are in contact with equal velocities."""
    return x[0] - contact.angle <= CLOSE and abs(x[1] - contact.angular_velocity) <= SLOW


def _sign(value: float) -> int:
    return 1 if value >= 0 else -1
