"""Projection of a state onto the constraints, which integration and rounding violate."""

from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.reference.drive_segments import DriveSegment
from sautereau.sim_backend.physics.reference.equations import ModeEquations
from sautereau.sim_backend.physics.reference.linkage import Linkage
from sautereau.sim_backend.physics.reference.system import State, System

DEPTH_TOLERANCE = 1e-6
"""rad, largest overlap of fingertip and key between two modes."""


def separated(system: System, segment: DriveSegment, time: float, x: State) -> State:
    """Return the state without the overlaps that rounding causes.

    Raises:
        SceneError: Fingertip and key overlap by more than `DEPTH_TOLERANCE`.
    """
    after = list(x)
    contact = system.key_under_fingertip(segment, time, x)
    least = max(0.0, contact.angle) if contact else 0.0
    if least - after[0] > DEPTH_TOLERANCE:
        raise SceneError(
            f"rig {system.name}: at {time:.6g} s the fingertip is suddenly {least - after[0]:.3g}"
            f" rad within the key, more than {DEPTH_TOLERANCE:.3g} rad; its reference jumps; use"
            " a continuous one"
        )
    after[0] = max(after[0], least)
    for k, jack in enumerate(system.jacks):
        after[2 + 2 * k] = max(after[2 + 2 * k], jack.kinematics(after[0])[0])
    return after


def projected(equations: ModeEquations, time: float, x: State) -> State:
    """Return the state projected onto the constraints of its mode."""
    x = equations.complete(time, x)
    if equations.mode.rail:
        x = equations.complete(time, [0.0, *x[1:]])
    if equations.system.arm and equations.mode.touching and not equations.mode.slip:
        return with_fingertip_on_key(equations.system.arm, x)
    return x


def with_fingertip_on_key(arm: Linkage, x: State) -> State:
    """Return the state with the fingertip moved onto the key, whose angle stays."""
    for _ in range(2):
        contact, own = arm.key_under_fingertip(*x[-4:]), arm.inertia(*x[-4:])
        by1, by2 = own.solve(contact.slope1, contact.slope2)
        size = contact.slope1 * by1 + contact.slope2 * by2
        place, speed = (contact.angle - x[0]) / size, contact.angular_velocity / size
        q1, q2, d1, d2 = x[-4:]
        joints = [q1 - by1 * place, q2 - by2 * place, d1 - by1 * speed, d2 - by2 * speed]
        x = [*x[:-4], *joints]
    return x
