"""The bench as rigid bodies in pymunk, in millimetres, grams and milliseconds.

In these units force is in newtons and speed in metres a second, and the engine's
tolerances, meant for lengths of order one, are small compared with the bench.

Contacts are unilateral joints instead of colliding shapes: they take a third of the time, report
their force, and need no penetration. A plane is a joint to a point so far behind it (`FAR`)
that the sphere about that point is flat on the scale of the bench.
"""

from collections.abc import Callable, Sequence
from typing import cast

import pymunk
from pymunk import constraints
from pymunk.constraints import Constraint

from sautereau.rig.schema import Arm

MM = 1e3  # Millimetres per metre; also N mm per N m, grams per kilogram, milliseconds per second
INERTIA = 1e9  # g mm^2 per kg m^2
FAR = 1e6  # mm, from a plane to the centre of its sphere, which departs by 5e-7 mm over 1 mm
REACH = 1e-3  # mm, numerical drift between surfaces in contact up to which their joint acts
RAIL_REACH = 1e-9  # rad, angle of the key below which it counts as on its back rail
RAIL_SLACK = 1e-6  # mm, height above the balance rail below which a key that sinks counts as on it

# Properties of bodies and joints, called directly: as properties they take longer.
set_torque = cast(Callable[[pymunk.Body, float], None], pymunk.Body.torque.fset)
set_force = cast(Callable[[pymunk.Body, tuple[float, float]], None], pymunk.Body.force.fset)
set_angle = cast(Callable[[pymunk.Body, float], None], pymunk.Body.angle.fset)
set_position = cast(Callable[[pymunk.Body, tuple[float, float]], None], pymunk.Body.position.fset)
angle_of = cast(Callable[[pymunk.Body], float], pymunk.Body.angle.fget)
angular_velocity_of = cast(Callable[[pymunk.Body], float], pymunk.Body.angular_velocity.fget)
impulse_of = cast(Callable[[Constraint], float], Constraint.impulse.fget)

HEAVY = 1e9  # g, of the key: the pin carries it, so only the moment of inertia matters

Dry = list[tuple[Constraint, float]]
"""Joints with dry friction, each with its limit [N mm or N]."""


def hard(joint: Constraint) -> Constraint:
    """Let a joint correct all of its drift in one step."""
    joint.error_bias = 0.0
    return joint


def unilateral(joint: Constraint) -> Constraint:
    """Make a joint unilateral in velocity only; its contact is located inside the step."""
    # The speed at which it corrects an overlap: none, which would be a rebound.
    joint.max_bias = 1e-300
    return joint


def add_friction(space: pymunk.Space, joint: Constraint, limit: float) -> tuple[Constraint, float]:
    """Add a joint as dry friction with a limit [N mm or N]; returns both."""
    joint.max_force = limit
    space.add(joint)
    return joint, limit


def add_arm(
    space: pymunk.Space, arm: Arm, joints: Sequence[float]
) -> tuple[pymunk.Body, pymunk.Body]:
    """Add the two links at joint angles [rad], as slender rods; returns upper and lower."""
    l1, l2 = arm.upper_length * MM, arm.lower_length * MM
    base = pymunk.Vec2d(arm.base_x * MM, arm.base_z * MM)
    first, total = joints[0], joints[0] + joints[1]
    upper = pymunk.Body(arm.upper_mass * MM, arm.upper_mass * MM * l1**2 / 12)
    lower = pymunk.Body(arm.lower_mass * MM, arm.lower_mass * MM * l2**2 / 12)
    upper.angle, lower.angle = first, total
    elbow = base + pymunk.Vec2d(l1, 0).rotated(first)
    upper.position = base + pymunk.Vec2d(l1 / 2, 0).rotated(first)
    lower.position = elbow + pymunk.Vec2d(l2 / 2, 0).rotated(total)
    shoulder = constraints.PivotJoint(space.static_body, upper, base, (-l1 / 2, 0))
    hinge = constraints.PivotJoint(upper, lower, (l1 / 2, 0), (-l2 / 2, 0))
    space.add(upper, lower, hard(shoulder), hard(hinge))
    return upper, lower


def brakes(
    space: pymunk.Space, upper: pymunk.Body, lower: pymunk.Body
) -> tuple[constraints.SimpleMotor, constraints.SimpleMotor]:
    """Return the brakes that hold both joints while they are added to the space."""
    first = constraints.SimpleMotor(space.static_body, upper, 0)
    return first, constraints.SimpleMotor(upper, lower, 0)
