"""The bench as rigid bodies in pymunk, in millimetres, grams and milliseconds.

In these units force is in newtons and speed in metres a second, and the engine's
tolerances, meant for lengths of order one, are small compared with the bench.

Contacts are unilateral joints instead of colliding shapes: they take a third of the time, report
their force, and need no penetration. A plane is a joint to a point so far behind it (`FAR`)
that the sphere about that point is flat on the scale of the bench.
"""

import math
from collections.abc import Callable, Sequence
from typing import cast

import pymunk
from pymunk import constraints
from pymunk.constraints import Constraint

from sautereau.rig.instrument import Jack, Key
from sautereau.rig.schema import Arm
from sautereau.sim_backend.parts import Play

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
angular_velocity_of = cast(Callable[[pymunk.Body], float], pymunk.Body.angular_velocity.fget)
impulse_of = cast(Callable[[Constraint], float], Constraint.impulse.fget)

_HEAVY = 1e9  # g, of the key: the pin carries it, so only the moment of inertia matters
_STILL = 1e-300
"""Speed at which a unilateral joint corrects an overlap: none, which would be a rebound."""


def add_key(space: pymunk.Space, key: Key, angle: float, play: Play | None) -> pymunk.Body:
    """Add the key on its pin and its back rail, at an angle [rad]; with play it may sink.

    The centre of mass is at the pin: weight acts as a moment that the engine applies.
    """
    body = pymunk.Body(_HEAVY if play is None else play.mass * MM, key.inertia * INERTIA)
    body.angle = angle
    ground = space.static_body
    pin = constraints.PivotJoint(ground, body, (0, 0), (0, 0))
    if play is not None:
        pin = constraints.GrooveJoint(ground, body, (0, -FAR), (0, FAR), (0, 0))
        lowest = FAR + play.clearance * MM - RAIL_SLACK
        stop = constraints.SlideJoint(ground, body, (0, FAR), (0, 0), 0, lowest)
        space.add(_unilateral(stop))
    rail = constraints.RotaryLimitJoint(space.static_body, body, RAIL_REACH, 2 * math.pi)
    space.add(body, _hard(pin), _unilateral(rail))
    return body


def add_front(space: pymunk.Space, inertia: float) -> pymunk.Body:
    """Add the front of a bending key [g mm^2] on the pin."""
    body = pymunk.Body(_HEAVY, inertia)
    space.add(body, _hard(constraints.PivotJoint(space.static_body, body, (0, 0), (0, 0))))
    return body


def add_pivot_friction(space: pymunk.Space, body: pymunk.Body, moment: float) -> Constraint:
    """Add the dry friction [N mm] at the pin."""
    dry = constraints.SimpleMotor(space.static_body, body, 0)
    dry.max_force = moment
    space.add(dry)
    return dry


def add_jack(
    space: pymunk.Space, lever: pymunk.Body, key: Key, jack: Jack, rise: float
) -> tuple[pymunk.Body, Constraint]:
    """Add a jack, upright in its register, at a rise [mm]; returns it and its contact with the key.

    Args:
        key: The key as the lever under this jack.
        rise: mm, above its rest.
    """
    x, z = key.jack_arm * MM, key.jack_surface_height * MM
    body = pymunk.Body(jack.mass * MM, math.inf)
    body.position = (x, z + rise)
    register = constraints.GrooveJoint(space.static_body, body, (x, z - FAR), (x, z + FAR), (0, 0))
    foot_contact = constraints.SlideJoint(lever, body, (x, z - FAR), (0, 0), FAR + REACH, 2 * FAR)
    _unilateral(foot_contact)
    space.add(body, _hard(register), foot_contact)
    return body, foot_contact


def add_register_friction(space: pymunk.Space, body: pymunk.Body, force: float) -> Constraint:
    """Add the dry friction [N] of a jack in its register."""
    x, z = body.position
    dry = constraints.PinJoint(space.static_body, body, (x, z + FAR), (0, 0))
    dry.max_bias = 0
    dry.max_force = force
    space.add(dry)
    return dry


def add_driver(space: pymunk.Space, lever: pymunk.Body) -> tuple[pymunk.Body, Constraint]:
    """Add a kinematic body, the lower bound of the key's angle; returns it and its contact."""
    body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
    contact = constraints.RotaryLimitJoint(body, lever, math.inf, math.inf)
    space.add(body, _unilateral(contact))
    return body, contact


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
    space.add(upper, lower, _hard(shoulder), _hard(hinge))
    return upper, lower


def add_fingertip(
    space: pymunk.Space, lever: pymunk.Body, lower: pymunk.Body, key: Key, arm: Arm
) -> Constraint:
    """Add the contact of the fingertip, at the end of the lower link, with the key."""
    height = (key.surface_height + arm.fingertip_radius) * MM
    behind = (-key.press_arm * MM, height + FAR)
    end = (arm.lower_length * MM / 2, 0)
    tip = constraints.SlideJoint(lever, lower, behind, end, 0, FAR - REACH)
    _unilateral(tip)
    space.add(tip)
    return tip


def brakes(
    space: pymunk.Space, upper: pymunk.Body, lower: pymunk.Body
) -> tuple[constraints.SimpleMotor, constraints.SimpleMotor]:
    """Return the brakes that hold both joints while they are added to the space."""
    first = constraints.SimpleMotor(space.static_body, upper, 0)
    return first, constraints.SimpleMotor(upper, lower, 0)


def _hard(joint: Constraint) -> Constraint:
    """Let a joint correct all of its drift in one step."""
    joint.error_bias = 0.0
    return joint


def _unilateral(joint: Constraint) -> Constraint:
    """Make a joint unilateral in velocity only; its contact is located inside the step."""
    joint.max_bias = _STILL
    return joint
