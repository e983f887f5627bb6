"""Play at the balance pin: a key that sinks into the felt under it."""

import math
from collections.abc import Callable, Iterable

import pymunk

from sautereau.rig.instrument import Key
from sautereau.sim_backend.parts import Play
from sautereau.sim_backend.physics.rigid.bodies import MM, RAIL_SLACK, set_force, set_position
from sautereau.sim_backend.physics.rigid.front import Front, Turned
from sautereau.sim_backend.physics.rigid.key_loads import KeyLoads, stop_at_rail
from sautereau.sim_backend.physics.rigid.step_event import Event


class SinkingPin(Front):
    """The height [mm] of the key above that at rest, on its balance felt, down to the rail.

    Args:
        space: The world.
        body: Of the key, with its mass.
        play: Stiffness and damping of the felt, and its travel.
        key: The key.
        loads: See `Front`.
    """

    fixed = False
    what, keys = "the balance felt", "play.stiffness or play.damping, or raise play.mass"

    def __init__(
        self, space: pymunk.Space, body: pymunk.Body, play: Play, key: Key, loads: KeyLoads
    ):
        self._stiffness, self._damping = play.stiffness / MM, play.damping
        rate = max(math.sqrt(self._stiffness / body.mass), self._damping / body.mass)
        super().__init__(body, loads, rate)
        self._press_arm, self._laser_arm = key.press_arm * MM, key.laser_arm * MM
        self._lowest = -play.clearance * MM
        self._load = -body.mass * space.gravity[1]

    def carry(self, forces: Iterable[float]) -> None:
        """Add the jacks' forces [N] on the key at rest to what the felt carries there."""
        self._load += sum(forces)

    def stays(self, angle: float, omega: float, step: float) -> bool:
        """Advance to the end of a step; see `Front`."""
        self.drift(step)
        self.angle, self.omega = angle, omega
        low, high = self.loads.bounds(angle)
        within = (self.next > self._lowest) if self._above_rail else self._rests(self.next)
        return within and low < self._depth(angle, self.next) < high

    def moment(self) -> float:
        """Return the moment [N mm] of felt and push at the end of the step."""
        rate = self._depth(self.omega, self.node)
        return self.loads.moment(self._depth(self.angle, self.next), rate)

    def reaction(self, angle: float, omega: float) -> float:
        """Return the force [N] of the balance felt, which can only push."""
        return max(0.0, self._load - self._stiffness * self.next - self._damping * self.node)

    def apply(self, moment: float, reaction: float) -> float:
        """Push the key up and down; return the moment of felt and push."""
        set_force(self.lever, (0.0, reaction - moment / self._press_arm))
        return moment

    def turned(self, back: Turned, ahead: float) -> Turned:
        """Return the key's angle; see `Front`."""
        return back

    def possible_events(self, back: Turned, ahead: float) -> list[Event]:
        """Return the events of the front felt and of the rail under the pin."""
        events = self.loads.possible_events(
            self.angle, lambda time: self._depth(back(time), self.at(time, ahead))
        )
        if self._above_rail:
            margin = lambda time: self.at(time, ahead) - self._lowest  # noqa: E731
            events.append(Event(margin, stop_at_rail, impact=True))
        return events

    def set_bodies(self, step: float) -> None:
        """Set its body; see `Front`."""
        self.lever.position = 0.0, self.next - self.speed * step
        self.lever.velocity = 0.0, self.speed

    def update(self, grown: Callable[[float], float]) -> float:
        """Update the state after a step; see `Front`."""
        return self.advance(self.lever.velocity[1], grown)

    def seen(self, angle: float, own: float) -> float:
        """Return the depth of the front under the laser over its arm."""
        return angle - own / self._laser_arm

    def end_sample(self, angle: float) -> float:
        """Move the key to its height, and return that."""
        set_position(self.lever, (0.0, self.value))
        return self.value

    @property
    def _above_rail(self) -> bool:
        return not self._rests(self.value)

    def _rests(self, height: float) -> bool:
        return height <= self._lowest + RAIL_SLACK

    def _depth(self, angle: float, height: float) -> float:
        """Return the depth of the pressing point over its arm [rad]."""
        return angle - height / self._press_arm
