"""The key as the rigid-body engine advances it: one stiff body on a fixed pin."""

import pymunk

from sautereau.rig.instrument import Key
from sautereau.sim_backend.physics.rigid.bodies import (
    add_key,
    angular_velocity_of,
    set_angle,
    set_torque,
)
from sautereau.sim_backend.physics.rigid.coordinate import Coordinate
from sautereau.sim_backend.physics.rigid.key_loads import KeyLoads
from sautereau.sim_backend.physics.rigid.step_event import Event
from sautereau.sim_backend.scene import Scene


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
