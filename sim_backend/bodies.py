"""The bench as rigid bodies in pymunk, in millimetres, grams and milliseconds.

In these units force is in newtons and speed in metres a second, and the engine's
tolerances, made for worlds of order one, are small against the bench.
"""

import math
from collections.abc import Sequence

import pymunk
from pymunk.constraints import (
    Constraint,
    GrooveJoint,
    PivotJoint,
    RotaryLimitJoint,
    SimpleMotor,
)

from rig.schema import GRAVITY, Arm, Jack, Key

MM = 1e3
"""Millimetres a metre; also N mm a N m, grams a kilogram, milliseconds a second."""
INERTIA = 1e9
"""g mm^2 a kg m^2."""
SLOP = 1e-3
"""mm, overlap of touching surfaces that the engine leaves alone; they start at half of it."""
FOOT = 0.1
"""mm, radius of the jack's foot."""
RAIL = 1e-5
"""rad/ms, speed at which the back rail lifts a key that sank into it; more would be a bounce."""

_KEY, _FINGER, _JACK = 0b001, 0b010, 0b100


def new_space(iterations: int) -> pymunk.Space:
    """Return an empty world with gravity."""
    space = pymunk.Space()
    space.gravity = (0, -GRAVITY / MM)
    space.iterations = iterations
    space.collision_slop = SLOP
    return space


def add_key(space: pymunk.Space, key: Key, *, friction: bool) -> pymunk.Body:
    """Add the key on its pin, resting on its back rail.

    The centre of mass is at the pin: weight acts as the moment that the world applies.
    """
    body = pymunk.Body(mass=100, moment=key.inertia * INERTIA)
    top = key.surface_height * MM
    front = pymunk.Segment(body, (-key.front_arm * MM, top), (0, top), 0)
    front.filter = pymunk.ShapeFilter(categories=_KEY, mask=_FINGER)
    arm, under = key.jack_arm * MM, key.jack_surface_height * MM - FOOT
    back = pymunk.Segment(body, (arm - 20, under), (arm + 20, under), 0)
    back.filter = pymunk.ShapeFilter(categories=_KEY, mask=_JACK)
    pin = PivotJoint(space.static_body, body, (0, 0), (0, 0))
    rail = RotaryLimitJoint(space.static_body, body, 0, math.pi / 2)
    rail.max_bias = RAIL
    space.add(body, front, back, _hard(pin), _hard(rail))
    if friction and key.pivot_coulomb_friction > 0:
        dry = SimpleMotor(space.static_body, body, 0)
        dry.max_force = key.pivot_coulomb_friction * MM
        space.add(dry)
    return body


def add_jack(space: pymunk.Space, key: Key, jack: Jack, *, friction: bool) -> pymunk.Body:
    """Add the jack, upright in its register, standing on the key."""
    x, z = key.jack_arm * MM, key.jack_surface_height * MM
    body = pymunk.Body(mass=jack.mass * MM, moment=math.inf)
    body.position = (x, z)
    foot = pymunk.Circle(body, FOOT + SLOP / 2)
    foot.filter = pymunk.ShapeFilter(categories=_JACK, mask=_KEY)
    register = GrooveJoint(space.static_body, body, (x, z - 50), (x, z + 50), (0, 0))
    space.add(body, foot, _hard(register))
    if friction and jack.register_friction > 0:
        dry = PivotJoint(space.static_body, body, (x, z), (0, 0))
        dry.max_bias = 0
        dry.max_force = jack.register_friction
        space.add(dry)
    return body


def add_ideal_finger(space: pymunk.Space, arm: Arm) -> pymunk.Body:
    """Add a fingertip that goes where it is told, whatever meets it."""
    body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
    space.add(body, _fingertip(body, arm, (0, 0)))
    return body


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
    shoulder = PivotJoint(space.static_body, upper, base, (-l1 / 2, 0))
    hinge = PivotJoint(upper, lower, (l1 / 2, 0), (-l2 / 2, 0))
    hinge.collide_bodies = False
    tip = _fingertip(lower, arm, (l2 / 2, 0))
    space.add(upper, lower, tip, _hard(shoulder), _hard(hinge))
    return upper, lower


def add_brakes(
    space: pymunk.Space, upper: pymunk.Body, lower: pymunk.Body
) -> tuple[SimpleMotor, SimpleMotor]:
    """Add the brakes that hold both joints while the motors are off."""
    brakes = (
        SimpleMotor(space.static_body, upper, 0),
        SimpleMotor(upper, lower, 0),
    )
    space.add(*brakes)
    return brakes


def _hard(joint: Constraint) -> Constraint:
    """Let a joint take back all of its drift in one step."""
    joint.error_bias = 0.0
    return joint


def _fingertip(body: pymunk.Body, arm: Arm, offset: tuple[float, float]) -> pymunk.Circle:
    tip = pymunk.Circle(body, arm.fingertip_radius * MM + SLOP / 2, offset)
    tip.filter = pymunk.ShapeFilter(categories=_FINGER, mask=_KEY)
    return tip
