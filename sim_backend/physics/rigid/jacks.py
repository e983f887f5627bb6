"""A jack: it stands on its key or flies, and carries plectrum and damper."""

import math
from functools import partial

import pymunk
from pymunk import constraints

from sautereau.analysis.model.choirs import key_of
from sautereau.rig.instrument import Choir
from sautereau.rig.schema import Rig
from sautereau.sim_backend.physics import laws
from sautereau.sim_backend.physics.rigid import bodies
from sautereau.sim_backend.physics.rigid.bodies import FAR, MM, REACH
from sautereau.sim_backend.physics.rigid.key import Coordinate, Event, StiffKey
from sautereau.sim_backend.physics.rigid.pluck import Plucking
from sautereau.sim_backend.scene import Scene


class CarriedJack(Coordinate):
    """The rise of one jack, in mm and ms.

    While it stands on the key it follows from the key's angle in closed form; the body is moved
    there at the end of each controller sample.

    Args:
        scene: Which of its parts are enabled.
        string: String of its plectrum; None for a mute jack.
    """

    def __init__(
        self,
        space: pymunk.Space,
        key: StiffKey,
        rig: Rig,
        choir: Choir,
        scene: Scene,
        string: Plucking | None,
    ):
        lever, jack, ground = key_of(rig, choir), choir.jack, space.static_body
        self.arm, self.top = x, z = lever.jack_arm * MM, lever.jack_surface_height * MM
        self.mass = jack.mass * MM
        self.string, self._key = string, key
        super().__init__(self.surface(key.value))
        self.standing, self._landed = True, False
        self.pull = 0.0
        """N, of the string, downwards."""
        self.body = pymunk.Body(self.mass, math.inf)
        self.body.position = (x, z + self.value)
        register = constraints.GrooveJoint(ground, self.body, (x, z - FAR), (x, z + FAR), (0, 0))
        self.foot_contact = bodies.unilateral(
            constraints.SlideJoint(key.body, self.body, (x, z - FAR), (0, 0), FAR + REACH, 2 * FAR)
        )
        space.add(self.body, bodies.hard(register), self.foot_contact)
        self.dry: bodies.Dry = []
        """Dry friction in its register."""
        if scene.friction and jack.register_friction > 0:
            slide = constraints.PinJoint(ground, self.body, (x, z + self.value + FAR), (0, 0))
            slide.max_bias = 0
            self.dry = [bodies.add_friction(space, slide, jack.register_friction)]
        self._damper = jack.damper if scene.damper else None
        self.loaded = string is not None or self._damper is not None
        self.low, self.high = -math.inf, math.inf
        self._state = self if string is None else string

    @property
    def unloaded(self) -> bool:
        """Whether its string neither pulls it nor will while the jack stays where it is."""
        return self.string is None or (self.string.steady and self.pull == 0.0)

    def surface(self, angle: float) -> float:
        """Return the rise [mm] of a jack that stands on the key, at its angle [rad]."""
        return laws.surface(self.arm, self.top, angle)[0]

    def slope(self, angle: float) -> float:
        """Return d(rise)/da [mm/rad] of a jack that stands."""
        return laws.surface(self.arm, self.top, angle)[1]

    def stays(self, step: float) -> bool:
        """Advance to the end of a step [ms] of the key; return whether no mode changes there."""
        surface = self.surface(self._key.next) + self._key.pin.next
        if self.standing:
            self.next = surface
        else:
            self.drift(step)
            if self.next < surface:
                return False
        return self._state.low <= self.next <= self._state.high

    def correct(self, back: float) -> None:
        """Undo the part of the last impulse beyond an event, after that of the key."""
        if self.standing:
            self.speed = self.slope(self._key.value) * self._key.speed + self._key.pin.speed
        else:
            super().correct(back)

    def set_bodies(self, step: float, force: float) -> None:
        """Set the body so that a step [ms] of the engine ends at its position; push it down [N]."""
        self.body.position = self.arm, self.top + self.next - self.speed * step
        self.body.velocity = 0.0, self.speed
        bodies.set_force(self.body, (0.0, -force))

    def forces(self, time: float, step: float) -> float:
        """Return the force of string and damper on the jack [N], downwards.

        Args:
            time: s, start of a step at whose end they act.
            step: s; 0 for the present force.
        """
        if self.string is not None:
            self.pull = self.string.force(self.next, self.value, time, step)
        if self._damper is None:
            return self.pull
        # The damper's felt carries the jack.
        return self.pull - max(0.0, self._damper.stiffness * (self._damper.lift - self.next / MM))

    def possible_events(self, ahead: float) -> list[Event]:
        """Return the events that may occur to it; `ahead` as of `Coordinate.at`."""

        def surface(time: float) -> float:
            key = self._key
            return self.surface(key.at(time, ahead)) + key.pin.at(time, ahead)

        def rise(time: float) -> float:
            return surface(time) if self.standing else self.at(time, ahead)

        possible, string = [], self.string
        if not self.standing:
            possible = [Event(lambda t: rise(t) - surface(t), self._make_contact, impact=True)]
        if string is not None and math.isfinite(string.high):
            possible.append(Event(lambda t: string.high - rise(t), partial(string.cross, True)))
        if string is not None and math.isfinite(string.low):
            possible.append(Event(lambda t: rise(t) - string.low, partial(string.cross, False)))
        return possible

    def update(self, weight: float) -> None:
        """Update position, speed and standing after a step.

        Args:
            weight: ms, for which the forces acted in it.
        """
        if not self.standing:
            self.advance(self.body.velocity[1], weight)
            return
        self.value = self.next
        if self._landed:  # without an impulse, too, where the surface only accelerates towards it
            self._landed = False
        elif not bodies.impulse_of(self.foot_contact) > 0:
            self.standing = False
            self.speed, self.acceleration = self.body.velocity[1], 0.0
            self.foot_contact.min = 0.0

    def _make_contact(self, time: float) -> None:
        self.standing = self._landed = True
        self.foot_contact.min = FAR + REACH

    def end_sample(self, angle: float) -> float:
        """Move the body to the jack's position; return its error before [mm]."""
        x, z = self.body.position
        if self.standing:
            self.value = self.surface(angle) + self._key.pin.value
        bodies.set_position(self.body, (self.arm, self.top + self.value))
        return max(abs(x - self.arm), abs(z - self.top - self.value))
