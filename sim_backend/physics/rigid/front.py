"""A key whose front yields against its back: the interface, and a key that bends."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable

import pymunk

from sautereau.sim_backend.parts import Bending
from sautereau.sim_backend.physics.rigid.bodies import MM, add_front, set_torque
from sautereau.sim_backend.physics.rigid.coordinate import Coordinate
from sautereau.sim_backend.physics.rigid.key_loads import KeyLoads
from sautereau.sim_backend.physics.rigid.step_event import Event

Turned = Callable[[float], float]
"""Angle [rad] of the key's back after a time [ms]."""


class Front(Coordinate, ABC):
    """A coordinate by which the loads before the pin move against those behind it.

    Args:
        lever: Body of the key under the finger.
        loads: On the key's front, felt and push.
        rate: 1/ms, fastest that a step must resolve.
    """

    what = keys = ""
    """Names of it and of its values in the scene."""

    def __init__(self, lever: pymunk.Body, loads: KeyLoads, rate: float):
        super().__init__()
        self.lever, self.loads, self.rate = lever, loads, rate
        self.angle = self.omega = 0.0
        """rad and rad/ms, of the key under the finger at the end of the step."""

    @abstractmethod
    def stays(self, angle: float, omega: float, step: float) -> bool:
        """Advance to the end of a step; return whether no mode changes on the way.

        Args:
            angle: rad, of the key's back at the end of the step.
            omega: rad/ms, of the key's back there.
            step: ms.
        """

    @abstractmethod
    def moment(self) -> float:
        """Return the moment [N mm] of felt and push at the end of the step."""

    @abstractmethod
    def reaction(self, angle: float, omega: float) -> float:
        """Return the force or moment between both; arguments as of `stays`."""

    @abstractmethod
    def apply(self, moment: float, reaction: float) -> float:
        """Apply what `moment` and `reaction` return in the engine's next step.

        Returns:
            Moment [N mm] on the key's back.
        """

    @abstractmethod
    def turned(self, back: Turned, ahead: float) -> Turned:
        """Return the angle under the finger; `ahead` as of `Coordinate.at`."""

    @abstractmethod
    def possible_events(self, back: Turned, ahead: float) -> list[Event]:
        """Return the possible events of felt and coordinate; see `turned`."""

    @abstractmethod
    def set_bodies(self, step: float) -> None:
        """Set its body so that a step [ms] of the engine ends in its target state."""

    @abstractmethod
    def update(self, grown: Callable[[float], float]) -> float:
        """Update the state after a step; see `Coordinate.advance`."""

    @abstractmethod
    def seen(self, angle: float, own: float) -> float:
        """Return the angle [rad] or rate [rad/ms] that the laser sees.

        Args:
            angle: Of the key's back.
            own: Of this coordinate.
        """

    @abstractmethod
    def end_sample(self, angle: float) -> float:
        """End a controller sample, with the lever at an angle [rad]; return the pin's height."""


class BentFront(Front):
    """The angle of the part before the pin, on a rotational spring and damper to that behind it.

    Args:
        space: The world.
        key: Body of the complete key, which becomes that of its back.
        bending: Frequency, damping and the front's part of the inertia.
        loads: See `Front`.
    """

    what, keys = "the key's bending", "bending.frequency or bending.damping"

    def __init__(self, space: pymunk.Space, key: pymunk.Body, bending: Bending, loads: KeyLoads):
        inertia, omega = key.moment, 2 * math.pi * bending.frequency / MM
        reduced = inertia * bending.front * (1 - bending.front)
        lever = add_front(space, inertia * bending.front)
        super().__init__(lever, loads, omega * max(1.0, 2 * bending.damping))
        key.moment = inertia * (1 - bending.front)
        self._stiffness, self._damping = reduced * omega**2, 2 * bending.damping * omega * reduced

    def stays(self, angle: float, omega: float, step: float) -> bool:
        """Advance to the end of a step; see `Front`."""
        self.drift(step)
        self.angle, self.omega = self.next, self.node
        low, high = self.loads.bounds(self.value)
        return low < self.next < high

    def moment(self) -> float:
        """Return the moment [N mm] of felt and push at the end of the step."""
        return self.loads.moment(self.next, self.node)

    def reaction(self, angle: float, omega: float) -> float:
        """Return the moment [N mm] of the spring on the back."""
        return self._stiffness * (self.next - angle) + self._damping * (self.node - omega)

    def apply(self, moment: float, reaction: float) -> float:
        """Turn the front; return the spring's moment on the back."""
        set_torque(self.lever, moment - reaction)
        return reaction

    def turned(self, back: Turned, ahead: float) -> Turned:
        """Return its angle; see `Front`."""
        return lambda time: self.at(time, ahead)

    def possible_events(self, back: Turned, ahead: float) -> list[Event]:
        """Return the felt's events."""
        return self.loads.possible_events(self.value, self.turned(back, ahead))

    def set_bodies(self, step: float) -> None:
        """Set its body; see `Front`."""
        self.lever.angle, self.lever.angular_velocity = self.next - self.speed * step, self.speed

    def update(self, grown: Callable[[float], float]) -> float:
        """Update the state after a step; see `Front`."""
        return self.advance(self.lever.angular_velocity, grown)

    def seen(self, angle: float, own: float) -> float:
        """Return its own."""
        return own

    def end_sample(self, angle: float) -> float:
        """Take the angle of its body; the pin is fixed."""
        self.value = angle
        return 0.0
