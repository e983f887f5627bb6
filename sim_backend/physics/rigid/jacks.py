"""A jack: it stands on its key or flies, and carries plectrum and damper."""

import math
from functools import partial

import pymunk

from sautereau.analysis.model.choirs import key_of
from sautereau.rig.instrument import Choir
from sautereau.rig.schema import Rig
from sautereau.sim_backend.physics.rigid import bodies
from sautereau.sim_backend.physics.rigid.bodies import MM
from sautereau.sim_backend.physics.rigid.key import StiffKey
from sautereau.sim_backend.physics.rigid.pluck import StringForce
from sautereau.sim_backend.physics.rigid.step_event import Event
from sautereau.sim_backend.scene import Scene


class CarriedJack:
    """One jack, in mm and mm/ms; its speed is that half a step ahead of its position.

    While it stands on the key its rise follows from the key's angle in closed form; the body is
    moved there at the end of each controller sample.

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
        string: StringForce | None,
    ):
        lever = key_of(rig, choir)
        self.arm, self.top = lever.jack_arm * MM, lever.jack_surface_height * MM
        self.mass = choir.jack.mass * MM
        self.string, self._pin = string, key.pin
        self.rise = self.next = self.surface(key.value)
        self.speed = self.acceleration = 0.0
        self.standing, self._landed = True, False
        self.pull = 0.0
        """N, of the string, downwards."""
        self.body, self.foot_contact = bodies.add_jack(
            space, key.body, lever, choir.jack, self.rise
        )
        self.dry = None
        self.dry_force = choir.jack.register_friction
        if scene.friction and self.dry_force > 0:
            self.dry = bodies.add_register_friction(space, self.body, self.dry_force)
        self._damper = choir.jack.damper if scene.damper else None
        self.loaded = string is not None or self._damper is not None
        self.low, self.high = -math.inf, math.inf
        self._state = self if string is None else string

    @property
    def unloaded(self) -> bool:
        """Whether its string neither pulls it nor will while the jack stays where it is."""
        return self.string is None or (self.string.steady and self.pull == 0.0)

    def surface(self, angle: float) -> float:
        """Return the rise [mm] of a jack that stands on the key, at its angle [rad]."""
        tangent = math.tan(angle)
        return self.arm * tangent + self.top * (math.sqrt(1 + tangent * tangent) - 1)

    def slope(self, angle: float) -> float:
        """Return d(rise)/da [mm/rad] of a jack that stands."""
        return (self.arm + self.top * math.sin(angle)) / math.cos(angle) ** 2

    def stays(self, tangent: float, secant: float, step: float) -> bool:
        """Advance to the end of a step [ms]; return whether no mode changes on the way."""
        rise = self.arm * tangent + self.top * (secant - 1) + self._pin.next
        if not self.standing:
            surface = rise
            rise = self.rise + self.speed * step
            if rise < surface:
                self.next = rise
                return False
        self.next = rise
        state = self._state
        return state.low <= rise <= state.high

    def correct(self, angle: float, omega: float, back: float) -> None:
        """Undo the part of the last impulse that lies beyond the event.

        Args:
            angle: rad, of the key, on which it may stand.
            omega: rad/ms, of the key, already corrected.
            back: ms, by which the last forces acted too long.
        """
        if self.standing:
            self.speed = self.slope(angle) * omega + self._pin.speed
        else:
            self.speed -= self.acceleration * back

    def set_bodies(self, step: float, force: float) -> None:
        """Set the body so that a step [ms] of the engine ends at its position; push it down [N]."""
        self.body.position = self.arm, self.top + self.next - self.speed * step
        self.body.velocity = 0.0, self.speed
        bodies.set_force(self.body, (0.0, -force))

    def load(self, time: float, step: float) -> None:
        """Apply string and damper at the end of a step [s] that started at a time [s]."""
        if force := self.forces(time, step):
            bodies.set_force(self.body, (0.0, -force))

    def forces(self, time: float, step: float) -> float:
        """Return the force of string and damper on the jack [N], downwards; see `load`.

        With a step of 0 it is the present force.
        """
        if self.string is not None:
            self.pull = self.string.force(self.next, self.rise, time, step)
        if self._damper is None:
            return self.pull
        # The damper's felt carries the jack.
        return self.pull - max(0.0, self._damper.stiffness * (self._damper.lift - self.next / MM))

    def possible_events(self, key: StiffKey, ahead: float) -> list[Event]:
        """Return the events that may occur to it.

        Args:
            ahead: ms, by half of which the last impulse advanced the speed.
        """
        speed, acceleration = self.speed - self.acceleration * ahead / 2, self.acceleration

        def surface(time: float) -> float:
            return self.surface(key.at(time, ahead)) + self._pin.at(time, ahead)

        def flown(time: float) -> float:
            return self.rise + (speed + acceleration * time / 2) * time

        rise, possible = surface, []
        if not self.standing:
            rise = flown
            possible = [Event(lambda t: flown(t) - surface(t), self._make_contact, impact=True)]
        string = self.string
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
        self.rise = self.next
        if not self.standing:
            before, self.speed = self.speed, self.body.velocity[1]
            self.acceleration = (self.speed - before) / weight
        elif self._landed:  # without an impulse, too, where the surface only accelerates towards it
            self._landed = False
        elif not bodies.impulse_of(self.foot_contact) > 0:
            self.standing = False
            self.speed, self.acceleration = self.body.velocity[1], 0.0
            self.foot_contact.min = 0.0

    def _make_contact(self, time: float) -> None:
        self.standing = self._landed = True
        self.foot_contact.min = bodies.FAR + bodies.REACH

    def end_sample(self, angle: float) -> float:
        """Move the body to the jack's position; return its error before [mm]."""
        x, z = self.body.position
        if self.standing:
            self.rise = self.surface(angle) + self._pin.value
        bodies.set_position(self.body, (self.arm, self.top + self.rise))
        return max(abs(x - self.arm), abs(z - self.top - self.rise))
