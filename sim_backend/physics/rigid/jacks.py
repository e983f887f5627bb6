"""A jack in the world: it stands on its key or flies, and carries plectrum and damper."""

import math
from collections.abc import Callable
from functools import partial

import pymunk

from sautereau.analysis.model.choirs import key_of
from sautereau.rig.instrument import Choir, Damper
from sautereau.rig.schema import Rig
from sautereau.sim_backend.physics.rigid.bodies import (
    FAR,
    MM,
    REACH,
    add_jack,
    add_register_friction,
    set_force,
    set_position,
)
from sautereau.sim_backend.physics.rigid.pluck import Plucked
from sautereau.sim_backend.physics.rigid.step_event import Happening
from sautereau.sim_backend.scene import Scene


class CarriedJack:
    """One jack; mm and mm/ms. Its speed is that half a step ahead of its place.

    While it stands on the key its place follows from the key's, in closed form; the body is
    put there at the end of each controller sample.

    Args:
        space: The world.
        lever: The key's body.
        rig: The bench.
        choir: Of the jack.
        scene: What it shows of it.
        string: What its plectrum meets; None leaves it mute.
    """

    def __init__(
        self,
        space: pymunk.Space,
        lever: pymunk.Body,
        rig: Rig,
        choir: Choir,
        scene: Scene,
        string: Plucked | None,
    ):
        key = key_of(rig, choir)
        self.arm, self.top = key.jack_arm * MM, key.jack_surface_height * MM
        self.mass = choir.jack.mass * MM
        self.string = string
        tangent = math.tan(lever.angle)
        self.rise = self.next = self.surface(tangent, math.sqrt(1 + tangent * tangent))
        self.speed = self.growth = 0.0
        self.standing = True
        self.pull = 0.0
        """N, of the string, downwards."""
        self.body, self.foot = add_jack(space, lever, key, choir.jack, self.rise)
        self.dry = None
        self.dry_force = choir.jack.register_friction
        if scene.friction and self.dry_force > 0:
            self.dry = add_register_friction(space, self.body, self.dry_force)
        self._damper = choir.jack.damper if scene.damper else None
        self.loaded = string is not None or self._damper is not None
        self._x, self._z = self.arm, self.top
        self.low, self.high = -math.inf, math.inf
        self._state = self if string is None else string

    def surface(self, tangent: float, secant: float) -> float:
        """Return the rise [mm] of a jack that stands on the key, at tan and 1/cos of its angle."""
        return self.arm * tangent + self.top * (secant - 1)

    def slope(self, angle: float) -> float:
        """Return d(rise)/da [mm/rad] of a jack that stands."""
        return (self.arm + self.top * math.sin(angle)) / math.cos(angle) ** 2

    def stays(self, tangent: float, secant: float, step: float) -> bool:
        """Go to the end of a step [ms]; return whether nothing changes on the way."""
        rise = self.arm * tangent + self.top * (secant - 1)
        if not self.standing:
            surface = rise
            rise = self.rise + self.speed * step
            if rise < surface:
                self.next = rise
                return False
        self.next = rise
        state = self._state
        return state.low <= rise <= state.high

    def glide(self, angle: float, spin: float, back: float) -> None:
        """Take back what the last kick gave too much.

        Args:
            angle: rad, of the key, on which it may stand.
            spin: rad/ms, of the key, which has taken its own back.
            back: ms, by which the last forces acted too long.
        """
        if self.standing:
            self.speed = self.slope(angle) * spin
        else:
            self.speed -= self.growth * back

    def place(self, step: float, force: float) -> None:
        """Put the body so that a step [ms] of the engine leads to its place; push it down [N]."""
        self.body.position = self._x, self._z + self.next - self.speed * step
        self.body.velocity = 0.0, self.speed
        set_force(self.body, (0.0, -force))

    def load(self, time: float, step: float) -> None:
        """Let string and damper act at the end of a step [s] that began at a time [s]."""
        if self.string is not None:
            self.pull = force = self.string.force(self.next, self.rise, time, step)
        else:
            force = 0.0
        if self._damper is not None:
            force -= _carried(self._damper, self.next)
        if force:
            set_force(self.body, (0.0, -force))

    def forces(self, time: float, step: float) -> float:
        """Return what string and damper push the jack down with [N], see `load`.

        Without a step it is what they push with now.
        """
        if self.string is not None:
            self.pull = self.string.force(self.next, self.rise, time, step)
        if self._damper is None:
            return self.pull
        return self.pull - _carried(self._damper, self.next)

    def watched(self, turned: Callable[[float], float], ahead: float) -> list[Happening]:
        """Return what may happen to it.

        Args:
            turned: The key's angle [rad] after a time [ms].
            ahead: ms, for half of which the last kick brought the speed forward.
        """
        speed, growth, begun = self.speed - self.growth * ahead / 2, self.growth, self.rise

        def surface(time: float) -> float:
            tangent = math.tan(turned(time))
            return self.surface(tangent, math.sqrt(1 + tangent * tangent))

        def flown(time: float) -> float:
            return begun + (speed + growth * time / 2) * time

        rise, watched = surface, []
        if not self.standing:
            rise = flown
            watched = [Happening(lambda t: flown(t) - surface(t), self._land, strikes=True)]
        string = self.string
        if string is not None and math.isfinite(string.high):
            watched.append(Happening(lambda t: string.high - rise(t), partial(string.cross, True)))
        if string is not None and math.isfinite(string.low):
            watched.append(Happening(lambda t: rise(t) - string.low, partial(string.cross, False)))
        return watched

    def settle(self, weight: float) -> None:
        """See after a step where the jack is, and whether it stands.

        Args:
            weight: ms, for which the forces acted in it.
        """
        self.rise = self.next
        if not self.standing:
            before, self.speed = self.speed, self.body.velocity[1]
            self.growth = (self.speed - before) / weight
        elif not self.foot.impulse > 0:
            self.standing = False
            self.speed, self.growth = self.body.velocity[1], 0.0
            self.foot.min = 0.0

    def _land(self, time: float) -> None:
        self.standing = True
        self.foot.min = FAR + REACH

    def rest(self, tangent: float, secant: float) -> float:
        """Put the body where the jack is; return by how much [mm] it was not."""
        x, z = self.body.position
        if self.standing:
            self.rise = self.surface(tangent, secant)
        set_position(self.body, (self._x, self._z + self.rise))
        return max(abs(x - self._x), abs(z - self._z - self.rise))


def _carried(damper: Damper, rise: float) -> float:
    """Return the force [N] with which the damper's felt carries a jack at a rise [mm]."""
    return max(0.0, damper.stiffness * (damper.lift - rise / MM))
