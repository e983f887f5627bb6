"""The key as the rigid-body engine advances it: stiff on a fixed pin, bending, or sinking."""

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import pymunk
from pymunk import constraints

from sautereau.rig.instrument import Key
from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.parts import Bending, Play
from sautereau.sim_backend.physics.rigid.bodies import (
    FAR,
    HEAVY,
    INERTIA,
    MM,
    RAIL_REACH,
    RAIL_SLACK,
    Dry,
    add_friction,
    angular_velocity_of,
    hard,
    set_angle,
    set_force,
    set_position,
    set_torque,
    unilateral,
)
from sautereau.sim_backend.physics.structures import LARGEST_ANGLE
from sautereau.sim_backend.scene import Scene


class Kick(NamedTuple):
    """How the forces at the end of a step act, for half of it and half of the next one."""

    ahead: float
    """ms, the next step."""
    step: float
    """ms, of the engine, which applies them."""
    fraction: float
    """Dimensionless, of the forces to apply in it."""


class Event(NamedTuple):
    """A possible change of mode within a step."""

    margin: Callable[[float], float]
    """Guard function of the time [ms]; negative once the event has occurred."""
    change: Callable[[float], None]
    """Applies the change, at a simulated time [s]."""
    impact: bool = False
    """Whether velocities jump in it."""


class Coordinate:
    """A coordinate whose speed is that half a step ahead of it; at rest unless it is advanced.

    Angles are in rad, lengths in mm, times in ms.
    """

    def __init__(self, value: float = 0.0):
        self.value = self.next = value
        """At the start and at the end of a step."""
        self.speed = self.acceleration = self.node = 0.0
        """Speed, and its rate in the last step; and the speed at the end of the step."""

    def drift(self, step: float) -> None:
        """Compute the end of a step."""
        self.next = self.value + self.speed * step
        self.node = self.speed + self.acceleration * step / 2

    def correct(self, back: float) -> None:
        """Undo the part of the last impulse that acted for a time too long."""
        self.speed -= self.acceleration * back

    def at(self, time: float, ahead: float) -> float:
        """Return it after a time; `ahead` is that by half of which the speed is advanced."""
        speed = self.speed - self.acceleration * ahead / 2
        return self.value + (speed + self.acceleration * time / 2) * time

    def advance(self, speed: float, step: float) -> float:
        """End a step with a new speed; return the mean of the old and the new speed."""
        before, self.speed = self.speed, speed
        self.value, self.acceleration = self.next, (speed - before) / step
        return (before + speed) / 2

    def advance_to_event(self, speed: float, drift: float, ahead: float, impact: bool) -> None:
        """End a drift to an event, with the speed of the step after it.

        Half of the impulse is by the forces before the event, extrapolated to it.

        Args:
            speed: Half of the next step ahead.
            drift: Time to the event.
            ahead: Length of the next step.
            impact: Whether the speed jumps at the event.
        """
        grown = 2 * (speed - self.speed) - self.acceleration * drift
        self.value, self.speed = self.next, speed
        self.acceleration = 0.0 if impact else grown / ahead


class StiffKey(Coordinate):
    """The angle of the key, in rad, ms, mm and g, with its body and the loads on it.

    Subclasses add a second coordinate, by which the key yields; felt and push act on the part
    before the pin.

    Args:
        scene: Which loads are enabled, and the play at the pin.
        angle: rad, at rest.
    """

    what = keys = ""
    """Names of the second coordinate and of its values in the scene."""
    rate = 0.0
    """1/ms, fastest rate of the second coordinate, which a step must resolve."""
    yields = False
    """Whether the second coordinate moves."""
    sinks = False
    """Whether a force on it moves its pin."""
    under_finger = under_laser = 1.0, 0.0
    """What the angle under the finger, and that which the laser sees, have of both coordinates."""

    def __init__(self, space: pymunk.Space, key: Key, scene: Scene, angle: float):
        super().__init__(angle)
        # The centre of mass is at the pin: weight acts as a moment.
        mass, ground = HEAVY if scene.play is None else scene.play.mass * MM, space.static_body
        self.body = self.lever = body = pymunk.Body(mass, key.inertia * INERTIA)
        """The body, and that under the finger."""
        body.angle = angle
        pin = constraints.PivotJoint(ground, body, (0, 0), (0, 0))
        if scene.play is not None:
            pin = constraints.GrooveJoint(ground, body, (0, -FAR), (0, FAR), (0, 0))
            lowest = FAR + scene.play.clearance * MM - RAIL_SLACK
            stop = constraints.SlideJoint(ground, body, (0, FAR), (0, 0), 0, lowest)
            space.add(unilateral(stop))
        rail = constraints.RotaryLimitJoint(ground, body, RAIL_REACH, 2 * math.pi)
        space.add(body, hard(pin), unilateral(rail))
        self.inertia, self.mass = self.body.moment, self.body.mass
        """g mm^2, of the body, and g; large where the pin carries it."""
        self.pressed: Coordinate = self
        """Angle under the finger."""
        self.second, self.pin = Coordinate(), Coordinate()
        """The second coordinate, and the height of the pin; at rest here."""
        self.pushed = 0.0
        """N mm, of a push without contact."""
        self.dry: Dry = []
        """Dry friction at the pin."""
        if scene.friction and key.pivot_coulomb_friction:
            turning = constraints.SimpleMotor(ground, body, 0)
            self.dry = [add_friction(space, turning, key.pivot_coulomb_friction * MM)]
        self.viscous = key.pivot_viscous_friction * MM**2 if scene.friction else 0.0
        """N mm ms/rad."""
        self._weight = key.gravity_moment * MM * scene.gravity / GRAVITY
        arm, felt = key.press_arm * MM, scene.felt
        self.bottom = key.dip * MM / arm if felt else LARGEST_ANGLE
        """rad, at first contact with the felt."""
        self.felt_stiffness = key.felt_stiffness / MM * arm**2 if felt else 0.0
        """N mm/rad."""
        self.felt_damping = key.felt_damping * arm**2 if felt else 0.0
        """N mm ms/rad."""
        self.on_felt = False
        """Whether the key is in contact with its felt."""
        self._bounds = (-math.inf, math.inf) * 2

    def depth(self, angle: float, second: float) -> float:
        """Return the angle [rad] or rate [rad/ms] under the finger.

        Args:
            angle: Angle or rate of this coordinate.
            second: The same of the second coordinate.
        """
        return self.under_finger[0] * angle + self.under_finger[1] * second

    def seen(self, angle: float, second: float) -> float:
        """Return the angle [rad] or rate [rad/ms] that the laser sees; see `depth`."""
        return self.under_laser[0] * angle + self.under_laser[1] * second

    @property
    def seen_angle(self) -> float:
        """Present angle [rad] that the laser sees."""
        return self.seen(self.value, self.second.value)

    def second_speed(self) -> float:
        """Return the speed of the second coordinate's body."""
        return 0.0

    def begin_steps(self) -> None:
        """Find the bounds of the present mode, in which `stays` keeps the key."""
        on_rail = self.value <= RAIL_REACH
        back = (-math.inf, RAIL_REACH) if on_rail else (0.0, LARGEST_ANGLE)
        front = (self.bottom, math.inf) if self.on_felt else (-math.inf, self.bottom)
        self._bounds = *back, *front

    def correct(self, back: float) -> None:
        super().correct(back)
        self.second.correct(back)

    def stays(self, step: float) -> bool:
        """Advance to the end of a step [ms]; return whether no mode changes on the way."""
        self.drift(step)
        depth, (low, high, least, most) = self.next, self._bounds
        if self.yields:
            self.second.drift(step)
            depth = self.depth(depth, self.second.next)
        return low < self.next < high and least < depth < most

    def moments(self) -> tuple[float, float]:
        """Return the moments [N mm] behind and before the pin at the end of the step."""
        front, second = self.pushed, self.second
        if self.on_felt:
            felt = self.felt_stiffness * (self.depth(self.next, second.next) - self.bottom)
            front -= max(0.0, felt + self.felt_damping * self.depth(self.node, second.node))
        return self._weight - self.viscous * self.node, front

    def apply(self, back: float, front: float, fraction: float = 1.0) -> None:
        """Apply moments [N mm] as of `moments`, and a fraction of all forces, in the next step."""
        set_torque(self.body, (back + front) * fraction)

    def set_bodies(self, step: float) -> None:
        """Set the bodies so that a step [ms] of the engine ends in their target state."""
        self.body.angle, self.body.angular_velocity = self.next - self.speed * step, self.speed

    def update(self, step: float) -> tuple[float, float]:
        """Update the state after a step [ms]; return the angle and the rate that the laser sees."""
        rate = self.advance(angular_velocity_of(self.body), step)
        if not self.yields:
            return self.value, rate
        rate = self.seen(rate, self.second.advance(self.second_speed(), step))
        return self.seen_angle, rate

    def update_at_event(self, drift: float, ahead: float, impact: bool) -> None:
        """Update the state after an event; see `Coordinate.advance_to_event`."""
        self.advance_to_event(self.body.angular_velocity, drift, ahead, impact)
        self.second.advance_to_event(self.second_speed(), drift, ahead, impact)

    def possible_events(self, ahead: float) -> list[Event]:
        """Return the events that may occur to it; `ahead` as of `Coordinate.at`."""
        side, possible = 1 if self.on_felt else -1, []

        def over_felt(time: float) -> float:
            depth = self.depth(self.at(time, ahead), self.second.at(time, ahead))
            return side * (depth - self.bottom)

        if self.felt_stiffness:
            possible.append(Event(over_felt, self._cross_felt))
        if self.value > RAIL_REACH:
            possible.append(Event(lambda t: self.at(t, ahead), stop_at_rail, impact=True))
        return possible

    def end_sample(self, angle: float) -> float:
        """End a controller sample with the key under the finger at an angle [rad].

        Returns:
            The error [mm] of the pin's joint.
        """
        set_angle(self.lever, angle)
        self.value = self.body.angle
        x, z = self.body.position
        return max(abs(x), abs(z - self._settle()))

    def state(self) -> tuple[float, ...]:
        """Return what the next step starts from."""
        second = self.second
        own = self.value, self.speed, self.acceleration
        return (*own, second.value, second.speed, second.acceleration)

    def _settle(self) -> float:
        """Take the second coordinate from its body; return the height [mm] of the pin before."""
        return 0.0

    def _cross_felt(self, time: float) -> None:
        self.on_felt = not self.on_felt


def stop_at_rail(time: float) -> None:
    """Do nothing: the joint of the rail acts by itself."""


class BendingKey(StiffKey):
    """A key in two parts; the second coordinate is the angle of the part before the pin.

    A rotational spring and damper join it to the part behind the pin.

    Args:
        scene: See `StiffKey`.
        angle: rad, at rest.
        bending: Frequency, damping and the front's part of the inertia.
    """

    what, keys = "the key's bending", "bending.frequency or bending.damping"
    yields = True
    under_finger = under_laser = 0.0, 1.0

    def __init__(self, space: pymunk.Space, key: Key, scene: Scene, angle: float, bending: Bending):
        super().__init__(space, key, scene, angle)
        inertia, omega = self.inertia, 2 * math.pi * bending.frequency / MM
        reduced = inertia * bending.front * (1 - bending.front)
        self.lever = pymunk.Body(HEAVY, inertia * bending.front)
        pin = constraints.PivotJoint(space.static_body, self.lever, (0, 0), (0, 0))
        space.add(self.lever, hard(pin))
        self.lever.angle = self.second.value = angle
        self.pressed = self.second
        self.rate = omega * max(1.0, 2 * bending.damping)
        self.inertia = self.body.moment = inertia * (1 - bending.front)
        self._stiffness, self._damping = reduced * omega**2, 2 * bending.damping * omega * reduced

    def second_speed(self) -> float:
        """Return the angular velocity [rad/ms] of the front."""
        return self.lever.angular_velocity

    def apply(self, back: float, front: float, fraction: float = 1.0) -> None:
        """Apply the loads, and the moment of the spring on both parts; see `StiffKey`."""
        bent, rate = self.second.next - self.next, self.second.node - self.node
        spring = (self._stiffness * bent + self._damping * rate) * fraction
        set_torque(self.lever, front * fraction - spring)
        set_torque(self.body, back * fraction + spring)

    def set_bodies(self, step: float) -> None:
        super().set_bodies(step)
        lever, front = self.lever, self.second
        lever.angle, lever.angular_velocity = front.next - front.speed * step, front.speed

    def _settle(self) -> float:
        self.second.value = self.lever.angle
        return 0.0


class SinkingKey(StiffKey):
    """A key on a balance felt, with a rail under it.

    The second coordinate is the height [mm] of the pin above that at rest.

    Args:
        scene: See `StiffKey`.
        angle: rad, at rest.
        play: Stiffness and damping of the felt, and its travel.
    """

    what, keys = "the balance felt", "play.stiffness or play.damping, or raise play.mass"
    yields = True
    sinks = True

    def __init__(self, space: pymunk.Space, key: Key, scene: Scene, angle: float, play: Play):
        super().__init__(space, key, scene, angle)
        self.pin = self.second
        self._stiffness, self._damping = play.stiffness / MM, play.damping
        self.rate = max(math.sqrt(self._stiffness / self.mass), self._damping / self.mass)
        self._arm = key.press_arm * MM
        self.under_finger, self.under_laser = (1, -1 / self._arm), (1, -1 / (key.laser_arm * MM))
        self._lowest = -play.clearance * MM
        self._load = -self.mass * space.gravity[1]

    def carry(self, forces: Iterable[float]) -> None:
        """Add the jacks' forces [N] on the key at rest to what the felt carries there."""
        self._load += sum(forces)

    def second_speed(self) -> float:
        """Return the vertical speed [mm/ms] of the key."""
        return self.body.velocity[1]

    def stays(self, step: float) -> bool:
        stays, height = super().stays(step), self.pin.next
        if self._rests(self.pin.value):
            return stays and self._rests(height)
        return stays and height > self._lowest

    def apply(self, back: float, front: float, fraction: float = 1.0) -> None:
        """Apply the loads, and the balance felt's force, which can only push; see `StiffKey`."""
        pin, push = self.pin, front * fraction
        felt = max(0.0, self._load - self._stiffness * pin.next - self._damping * pin.node)
        set_force(self.body, (0.0, felt * fraction - push / self._arm))
        set_torque(self.body, back * fraction + push)

    def set_bodies(self, step: float) -> None:
        super().set_bodies(step)
        pin = self.pin
        self.body.position, self.body.velocity = (0.0, pin.next - pin.speed * step), (0, pin.speed)

    def possible_events(self, ahead: float) -> list[Event]:
        """Return the events of both felts and of both rails; see `StiffKey`."""
        events = super().possible_events(ahead)
        if not self._rests(self.pin.value):
            margin = lambda time: self.pin.at(time, ahead) - self._lowest  # noqa: E731
            events.append(Event(margin, stop_at_rail, impact=True))
        return events

    def _settle(self) -> float:
        set_position(self.body, (0.0, self.pin.value))
        return self.pin.value

    def _rests(self, height: float) -> bool:
        return height <= self._lowest + RAIL_SLACK
