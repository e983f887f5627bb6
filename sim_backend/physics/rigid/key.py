"""The key as the rigid-body engine advances it: one stiff body on a fixed pin, and its loads."""

import math
from collections.abc import Callable

import pymunk

from sautereau.rig.instrument import Key
from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.physics.base import LARGEST_ANGLE
from sautereau.sim_backend.physics.rigid.bodies import (
    MM,
    RAIL_REACH,
    add_key,
    angular_velocity_of,
    set_angle,
    set_torque,
)
from sautereau.sim_backend.physics.rigid.step_event import Event
from sautereau.sim_backend.scene import Scene


class Coordinate:
    """A coordinate whose speed is that half a step ahead of it; at rest at 0 unless it is advanced.

    Angles are in rad, lengths in mm, times in ms.
    """

    fixed = True
    """Whether no body moves in it."""

    def __init__(self):
        self.value = self.next = self.node = 0.0
        """At the start and at the end of a step; and its rate at the end."""
        self.speed = self.acceleration = 0.0

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


class KeyLoads:
    """Moments [N mm] on the key over its angle [rad] and angular velocity [rad/ms].

    Args:
        scene: Which of them are enabled.
        front: Whether they include those before the pin, felt and push.
        back: Whether they include the others.
    """

    def __init__(self, key: Key, scene: Scene, *, front: bool = True, back: bool = True):
        felt, friction = scene.felt and front, scene.friction and back
        self._on_rail = back
        self.weight = back * key.gravity_moment * MM * scene.gravity / GRAVITY
        self.steady = self.weight
        """N mm, of weight and of a push without contact."""
        self.friction = key.pivot_coulomb_friction * MM if friction else 0.0
        """N mm, dry, at the pin."""
        self.viscous = key.pivot_viscous_friction * MM**2 if friction else 0.0
        """N mm ms/rad."""
        arm = key.press_arm * MM
        self.bottom = key.dip * MM / arm if felt else LARGEST_ANGLE
        """rad, at first contact with the felt."""
        self.felt_stiffness = key.felt_stiffness / MM * arm**2 if felt else 0.0
        """N mm/rad."""
        self.felt_damping = key.felt_damping * arm**2 if felt else 0.0
        """N mm ms/rad."""
        self.pressed = False
        """Whether the key is in contact with its felt."""
        self.moment: Callable[[float, float], float] = self._slowed if self.viscous else self._free
        """N mm, at an angle [rad] and an angular velocity [rad/ms]."""

    def bounds(self, angle: float) -> tuple[float, float]:
        """Return the angles [rad] between which a key at an angle has no event."""
        if self.pressed:
            return self.bottom, LARGEST_ANGLE
        if not self._on_rail:
            return -math.inf, self.bottom
        if angle <= RAIL_REACH:
            return -math.inf, RAIL_REACH
        return 0.0, self.bottom

    def possible_events(self, angle: float, turned: Callable[[float], float]) -> list[Event]:
        """Return the events possible for a key at an angle [rad]; `turned` gives later angles."""
        if self.pressed:
            return [Event(lambda t: turned(t) - self.bottom, self._cross)]
        possible = []
        if self._on_rail and angle > RAIL_REACH:
            possible = [Event(turned, stop_at_rail, impact=True)]
        if self.felt_stiffness:
            possible.append(Event(lambda t: self.bottom - turned(t), self._cross))
        return possible

    def _cross(self, time: float) -> None:
        self.pressed = not self.pressed
        if self.pressed:
            self.moment = self._on_felt
        else:
            self.moment = self._slowed if self.viscous else self._free

    def _free(self, angle: float, omega: float) -> float:
        return self.steady

    def _slowed(self, angle: float, omega: float) -> float:
        return self.steady - self.viscous * omega

    def _on_felt(self, angle: float, omega: float) -> float:
        felt = self.felt_stiffness * (angle - self.bottom) + self.felt_damping * omega
        return self.steady - self.viscous * omega - max(0.0, felt)


def stop_at_rail(time: float) -> None:
    """Do nothing: the joint of the rail acts by itself."""


class StiffKey(Coordinate):
    """The angle of the key, in rad, ms, mm and g, with its body and the loads on it.

    Subclasses add a second coordinate, by which the key yields.

    Args:
        scene: Which loads are enabled, and the play at the pin.
        angle: rad, at rest.
    """

    what = keys = ""
    """Names of the second coordinate and of its values in the scene."""
    rate = 0.0
    """1/ms, fastest rate of the second coordinate, which a step must resolve."""

    def __init__(self, space: pymunk.Space, key: Key, scene: Scene, angle: float):
        super().__init__()
        self.body = self.lever = add_key(space, key, angle, scene.play)
        """The body, and that under the finger."""
        self.inertia, self.mass = self.body.moment, self.body.mass
        """g mm^2, of the body, and g; large where the pin carries it."""
        self.value = self.next = angle
        self.loads = self.pressed_loads = KeyLoads(key, scene)
        """All loads, and those before the pin: felt and push."""
        self.pressed: Coordinate = self
        """Angle under the finger."""
        self.second = Coordinate()
        """The second coordinate; at rest here."""
        self.pin = Coordinate()
        """Height of the pin."""
        self._low, self._high = self.loads.bounds(angle)

    def push(self, moment: float) -> None:
        """Apply a moment [N mm] without a contact from now on."""
        self.pressed_loads.steady = self.pressed_loads.weight + moment

    def begin_steps(self) -> None:
        """Find the bounds of the present mode, in which `stays` keeps the key."""
        self._low, self._high = self.loads.bounds(self.value)

    def stays(self, step: float) -> bool:
        """Advance to the end of a step [ms]; return whether no mode changes on the way."""
        # As `Coordinate.drift`, whose call would take longer than it does.
        self.next = angle = self.value + self.speed * step
        self.node = self.speed + self.acceleration * step / 2
        return self._low < angle < self._high

    def load(self) -> None:
        """Apply all forces at the end of the step in the engine's next step."""
        set_torque(self.body, self.loads.moment(self.next, self.node))

    def moments(self) -> tuple[float, float]:
        """Return the moments [N mm] behind and before the pin at the end of the step.

        Of a stiff key the first one holds all.
        """
        return self.loads.moment(self.next, self.node), 0.0

    def apply(self, back: float, front: float, fraction: float = 1.0) -> None:
        """Apply other moments than `load` does, and a fraction of all forces.

        Args:
            back: N mm, see `moments`.
            front: N mm.
            fraction: Dimensionless, of the forces to apply.
        """
        set_torque(self.body, back * fraction)

    def set_bodies(self, step: float) -> None:
        """Set the bodies so that a step [ms] of the engine ends in their target state."""
        self.body.angle, self.body.angular_velocity = self.next - self.speed * step, self.speed

    def update(self, step: float) -> tuple[float, float]:
        """Update the state after a step [ms]; return the angle and the rate that the laser sees."""
        # As `Coordinate.advance`, whose call would take longer than it does.
        before, self.value = self.speed, self.next
        self.speed = speed = angular_velocity_of(self.body)
        self.acceleration = (speed - before) / step
        return self.value, (before + speed) / 2

    def update_at_event(self, drift: float, ahead: float, impact: bool) -> None:
        """Update the state after an event; see `Coordinate.advance_to_event`."""
        self.advance_to_event(self.body.angular_velocity, drift, ahead, impact)

    def seen(self, angle: float, second: float) -> float:
        """Return the angle [rad] or rate [rad/ms] that the laser sees.

        Args:
            angle: Angle or rate of this coordinate.
            second: The same of the second coordinate.
        """
        return angle

    def possible_events(self, ahead: float) -> list[Event]:
        """Return the events that may occur to it; `ahead` as of `Coordinate.at`."""
        return self.loads.possible_events(self.value, lambda time: self.at(time, ahead))

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
