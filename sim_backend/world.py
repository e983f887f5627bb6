"""The simulated bench: key, jack, string and finger, advanced by controller samples."""

import math
from dataclasses import dataclass

import numpy as np
import pymunk.batch

from rig.schema import Rig
from sim_backend.bodies import MM, add_jack, add_key, new_space
from sim_backend.errors import SceneError
from sim_backend.finger import Finger, IdealFinger, Reference, ServoFinger
from sim_backend.pluck import PluckEvents, Plucking
from sim_backend.scene import Scene
from trajectory.motion import Floats

STABILISATION = 0.2
"""1, share of a contact's gap that is taken back in each step."""

_ARBITER = pymunk.batch.ArbiterFields


@dataclass(frozen=True)
class Motions:
    """What happened in the steps of one controller sample; arrays of shape (n,)."""

    time: Floats
    """s, end of each step on the world's clock."""
    angle: Floats
    """rad, of the key."""
    spin: Floats
    """rad/s, of the key."""
    rise: Floats
    """m, of the jack."""
    finger_force: Floats
    """N, of the finger on the key, normal to it."""


class World:
    """The physics of a scene; the same `Scene`, rig and references give the same bits."""

    def __init__(self, rig: Rig, scene: Scene):
        self.rig = rig = scene.true_rig(rig)
        if rig.more_choirs and scene.plectrum != "none":
            raise SceneError(
                f"rig {rig.name}: it has {1 + len(rig.more_choirs)} choirs, and the stand-in plucks"
                ' one; leave out more_choirs, or set plectrum = "none" and string = "none"'
            )
        self.scene = scene
        period = rig.controller.sample_period
        self.steps = int(np.ceil(period / scene.step - 1e-9))
        """Steps in a controller sample."""
        self.step = period / self.steps
        """s."""
        self.samples = 0
        """Controller samples done."""
        start = self.start = (
            rig.arm.home_angles[0] + scene.start_offset[0],
            rig.arm.home_angles[1] + scene.start_offset[1],
        )
        """rad, joints when power came on."""
        self.radians_per_count = 2 * np.pi / rig.arm.counts_per_revolution
        space = self.space = new_space(scene.iterations)
        self.key = add_key(space, rig.key, friction=scene.friction)
        self.jack = add_jack(space, rig.key, rig.jack, friction=scene.friction)
        self.finger: Finger = (
            ServoFinger(space, rig, start, scene.servo)
            if scene.servo
            else IdealFinger(space, rig, start)
        )
        self.plucking = None if scene.plectrum == "none" else Plucking(rig, scene.plectrum)
        self._heaviness = rig.key.front_heaviness * MM
        self._viscous = rig.key.pivot_viscous_friction * MM**2 if scene.friction else 0.0
        self._felt = self._felt_law() if scene.felt else None
        self._tip_height = (rig.key.surface_height + rig.arm.fingertip_radius) * MM
        self._rest_z = self.jack.position.y
        self._state = (0.0, 0.0, 0.0, 0.0)
        self._arbiters = pymunk.batch.Buffer()

    @property
    def time(self) -> float:
        """World's clock [s]: only motion and acquisition make it go."""
        return self.samples * self.rig.controller.sample_period

    @property
    def events(self) -> PluckEvents:
        """When the string was met and let go, the truth that no recording holds."""
        return self.plucking.events if self.plucking else PluckEvents()

    def advance(self, reference: Reference, powered: bool) -> Motions:
        """Advance by one controller sample.

        Args:
            reference: Of the arm over this sample, in raw encoder counts.
            powered: Whether the motors are on.

        Raises:
            SceneError: The engine lost its numbers.
        """
        steps, start = self.steps, self.time
        self.finger.begin(reference, powered, steps)
        rows = [self._step(start + i * self.step, i) for i in range(steps)]
        self.samples += 1
        table = np.array(rows)
        if not np.isfinite(table).all():
            raise SceneError(
                f"the simulated bench lost its numbers at {self.time:.6g} s with steps of"
                f" {self.step * 1e6:.4g} us; lower the scene's step or the stiffness in it"
            )
        time = start + np.arange(1.0, steps + 1.0) * self.step
        return Motions(time, *table.T)

    def _step(self, time: float, index: int) -> tuple[float, float, float, float]:
        """Take one step; forces are those of the place that the step leads to.

        The engine moves first and kicks then, so this is the leap-frog scheme.
        """
        step = self.step * MM
        angle, spin, rise, speed = self._state
        torque = self._heaviness - self._viscous * spin
        next_angle, next_rise = angle + spin * step, rise + speed * step
        if self._felt:
            torque += self._felt(next_angle, spin)
        self.key.torque += torque
        if self.plucking:
            force = self.plucking.force(next_rise, rise, time, self.step)
            self.jack.apply_force_at_world_point((0, -force), self.jack.position)
        self.finger.drive(index)
        self.space.step(step)
        new_angle, new_spin, new_rise, new_speed, push = self._read(step)
        self._state = (new_angle, new_spin, new_rise, new_speed)
        return new_angle, (spin + new_spin) / 2 * MM, new_rise / MM, push

    def _keep_touching(self, foot: bool, tip: bool) -> None:
        """Bring surfaces that press on each other back to the overlap they started with.

        The engine pushes apart what overlaps too much and leaves alone what overlaps too
        little, so a lasting contact would drift open by some 1e-8 mm a step, and rattle.
        """
        key, angle = self.key, self.key.angle
        sine, cosine = math.sin(angle), math.cos(angle)
        if tip:
            x, z = self.finger.centre()
            gap = z * cosine - x * sine - self._tip_height
            angle += STABILISATION * gap / (x * cosine + z * sine)
            key.angle = angle
        if foot:
            gap = self.jack.position.y - self._rest_z - self._rise(angle)
            self.jack.position -= (0, STABILISATION * gap)

    def _rise(self, angle: float) -> float:
        key = self.rig.key
        versine = 2 * math.sin(angle / 2) ** 2 / math.cos(angle)
        return (key.jack_arm * math.tan(angle) + key.jack_surface_height * versine) * MM

    def _read(self, step: float) -> tuple[float, float, float, float, float]:
        key, jack = self.key, self.jack
        push, foot = 0.0, False
        self._arbiters.clear()
        fields = _ARBITER.BODY_A_ID | _ARBITER.BODY_B_ID | _ARBITER.TOTAL_IMPULSE
        pymunk.batch.get_space_arbiters(self.space, fields, self._arbiters)
        ids = memoryview(self._arbiters.int_buf()).cast("N")  # pyright: ignore
        impulses = memoryview(self._arbiters.float_buf()).cast("d")
        for i in range(0, len(ids), 2):
            impulse = math.hypot(impulses[i], impulses[i + 1])
            if jack.id in (ids[i], ids[i + 1]):
                foot = impulse > 0
            else:
                push += impulse / step
        self._keep_touching(foot, push > 0)
        return (
            key.angle,
            key.angular_velocity,
            jack.position.y - self._rest_z,
            jack.velocity.y,
            push,
        )

    def _felt_law(self):
        """Return the felt's moment [N mm] on the key, a spring and damper under the front."""
        key = self.rig.key
        arm = key.press_arm * MM
        bottom = key.dip * MM / arm
        stiffness, damping = key.felt_stiffness / MM * arm**2, key.felt_damping * arm**2

        def moment(angle: float, spin: float) -> float:
            depth = angle - bottom
            return -max(0.0, stiffness * depth + damping * spin) if depth > 0 else 0.0

        return moment
