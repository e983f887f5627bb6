"""The bench as rigid bodies: leap-frog steps, split where something is met or let go.

The engine moves first and kicks then, so a place is known before the forces that belong to
it are set: this is the leap-frog scheme, whose speeds are half a step ahead of the places.
What is met or let go inside a step is found on the parabola of that step. The bodies then
go there and no further; the forces before act for half of the way there, those after for
half of the way that is left, and what the kick before gave too much is taken back. Places
are moved by hand in such a step, so that the engine itself never sees but one length of
step: where that changes it begins with its old impulses, takes them for the new ones, and
forgets to count the difference.
"""

import math

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.events import Motions, PluckEvents
from sautereau.sim_backend.physics.finger import Finger, Reference
from sautereau.sim_backend.physics.rigid.assembly import assemble
from sautereau.sim_backend.physics.rigid.bodies import MM, set_angle, set_torque
from sautereau.sim_backend.physics.rigid.division import TICK, even_steps
from sautereau.sim_backend.physics.rigid.key_loads import TURNED
from sautereau.sim_backend.physics.rigid.step_event import Happening, earliest
from sautereau.sim_backend.scene import Scene

ITERATIONS = {"push": 30, "ideal": 30, "servo": 100}
"""Least iterations where something happens, and once after: impulses are all new there."""
CROWD = 1000
"""Happenings in one controller sample after which the bench counts as lost."""


class RigidWorld:
    """The physics of a scene; the same `Scene`, rig and references give the same bits.

    Args:
        rig: The nominal bench; the scene may make the true one differ.
        scene: With its step settled.
        start: rad, joints when power comes on; None for home and the scene's offset.

    Raises:
        SceneError: A part of the scene is too stiff, or has no solution.
    """

    def __init__(self, rig: Rig, scene: Scene, start: tuple[float, float] | None = None):
        self.rig = rig = scene.true_rig(rig)
        (first, second), (more, most) = rig.arm.home_angles, scene.start_offset
        self.start = start or (first + more, second + most)
        self.radians_per_count = rig.arm.radians_per_count
        self.samples = 0
        self.events = PluckEvents()
        self._parts = parts = assemble(rig, scene, self.start, self.events)
        self._space, self._key, self._loads = parts.space, parts.key, parts.loads
        self._jacks, self._finger, self._division = parts.jacks, parts.finger, parts.division
        self._loaded = [jack for jack in self._jacks if jack.loaded]
        self._iterations = scene.iterations
        self._thorough = max(scene.iterations, ITERATIONS[scene.finger])
        self._period = rig.controller.sample_period * MM
        self._step = self._ahead = self._engine_step = self._division.step()
        self._angle, self._spin, self._growth = self._key.angle, 0.0, 0.0
        self._fresh = False
        self._elapsed = 0.0
        self._rows: list[tuple[float, float, float, float, float, float]] = []
        self.worst_gap = 0.0
        """m, largest error of a joint or a contact at the end of a controller sample so far."""

    @property
    def time(self) -> float:
        """World's clock [s]: only motion and acquisition make it go."""
        return self.samples * self.rig.controller.sample_period

    @property
    def finger(self) -> Finger:
        """What presses the key."""
        return self._finger

    def advance(self, reference: Reference, powered: bool) -> Motions:
        """Advance by one controller sample; see `sautereau.sim_backend.physics.world.World`."""
        finger, loads, time = self._finger, self._loads, self.time
        self._rows = []
        self._elapsed = 0.0
        if finger.begin(reference, powered, time) or not self.samples:
            loads.steady = loads.weight + finger.moment
            self._split(0.0, None, self._period)
        if finger.stops < self._period:
            self._run(finger.stops)
            finger.moment, loads.steady = 0.0, loads.weight
            self._split(0.0, None, self._period)
        self._run(self._period)
        self._rest()
        self.samples += 1
        table = np.array(self._rows).T
        if not math.isfinite(sum(self._rows[-1])):
            raise self._lost()
        table[0] = time + table[0] / MM
        table[0, -1] = self.time
        return Motions(*table)

    def _run(self, end: float) -> None:
        """Go on until some time [ms] into the controller sample."""
        crowd = 0
        while end - self._elapsed > TICK:
            count, drift = even_steps(end - self._elapsed, self._step)
            if drift == self._ahead == self._step:
                if self._cruise(count) == count:
                    self._elapsed = end
                    return
                count, drift = even_steps(end - self._elapsed, self._step)
            time, happening = earliest(self._watched(drift), drift)
            self._split(time, happening, end)
            crowd += 1
            if crowd > CROWD:
                raise self._lost()

    def _cruise(self, count: int) -> int:
        """Take even steps; return how many were done before one in which something happens."""
        space_step, key, finger, rows = self._space.step, self._key, self._finger, self._rows
        jacks, loaded, moment = self._jacks, self._loaded, self._loads.moment
        first, step, seconds = jacks[0], self._step, self._step / MM
        act, push, closes = finger.act, finger.push, finger.closes
        angle, spin, growth = self._angle, self._spin, self._growth
        low, high = self._loads.bounds(angle)
        begun, clock, elapsed, done = self._elapsed, self.time, self._elapsed, 0
        sqrt, tan, fresh = math.sqrt, math.tan, self._fresh
        while done < count:
            ahead = angle + spin * step
            if not low < ahead < high or closes(ahead, step):
                break
            tangent = tan(ahead)
            secant = sqrt(1 + tangent * tangent)
            changes = False
            for jack in jacks:
                if not jack.stays(tangent, secant, step):
                    changes = True
            if changes:
                break
            pull = 0.0
            for jack in loaded:
                jack.load(clock + elapsed / MM, seconds)
                pull += jack.pull
            set_torque(key, moment(ahead, spin + growth * step / 2))
            done += 1
            elapsed = begun + done * step
            act(elapsed, ahead, step, step, 1.0)
            space_step(step)
            if fresh:
                self._space.iterations, self._fresh, fresh = self._iterations, False, False
            before, spin = spin, key.angular_velocity
            growth = (spin - before) / step
            for jack in jacks:
                jack.settle(step)
            angle = ahead
            rows.append(
                (elapsed, angle, (before + spin) / 2 * MM, first.rise / MM, push(step), pull)
            )
        self._angle, self._spin, self._growth, self._elapsed = angle, spin, growth, elapsed
        return done

    def _split(self, drift: float, happening: Happening | None, end: float) -> None:
        """Drift for less than a step, or more, and change there what happens.

        Args:
            drift: ms.
            happening: What changes after it.
            end: ms into the controller sample, at which the next steps shall end.
        """
        key, jacks, loads, finger = self._key, self._jacks, self._loads, self._finger
        back = (self._ahead - drift) / 2
        self._spin -= self._growth * back
        angle = self._angle + self._spin * drift
        tangent = math.tan(angle)
        secant = math.sqrt(1 + tangent * tangent)
        for jack in jacks:
            jack.glide(self._angle, self._spin, back)
            jack.stays(tangent, secant, drift)
        start = self.time + self._elapsed / MM
        self._elapsed += drift
        node = self._spin + self._growth * drift / 2
        moment = loads.moment(angle, node)
        now = self.time + self._elapsed / MM
        # A string may give a mean over the drift, of which its present force is a half.
        forces = [
            2 * jack.forces(start, drift / MM) - jack.forces(now, 0.0) if drift else 0.0
            for jack in jacks
        ]
        if happening is not None:
            happening.change(now)
            self._step = self._division.step()
        left = end - self._elapsed
        ahead = even_steps(left, self._step)[1] if left > TICK else self._step
        weight = (drift + ahead) / 2
        means = [
            (force * drift + jack.forces(now, 0.0) * ahead) / (2 * weight)
            for jack, force in zip(jacks, forces, strict=True)
        ]
        mean = (moment * drift + loads.moment(angle, node) * ahead) / (2 * weight)
        finger.glide(back, drift)
        before = self._spin
        for _ in range(2 if self._step != self._engine_step else 1):
            finger.place(self._step)
            key.angle, key.angular_velocity = angle - before * self._step, before
            set_torque(key, mean * weight / self._step)
            for jack, force in zip(jacks, means, strict=True):
                jack.place(self._step, force * weight / self._step)
            finger.act(self._elapsed, angle, ahead, self._step, weight / self._step)
            self._parts.kick(self._step, weight / self._step, self._thorough)
        self._engine_step, self._fresh = self._step, True
        self._angle, self._ahead = angle, ahead
        self._spin = key.angular_velocity
        landed = happening is not None and happening.strikes
        # Half of the kick was by what was before, and went on growing as it did.
        grown = 2 * (self._spin - before) - self._growth * drift
        self._growth = 0.0 if landed else grown / ahead
        for jack in jacks:
            jack.settle(weight)
        push = finger.push(weight)
        if drift:
            pull = sum(jack.pull for jack in self._loaded)
            speed = (self._spin if landed else node) * MM
            self._rows.append((self._elapsed, angle, speed, jacks[0].rise / MM, push, pull))

    def _watched(self, drift: float) -> list[Happening]:
        """Return what may happen in a drift [ms]."""
        loads, finger = self._loads, self._finger
        spin = self._spin - self._growth * self._ahead / 2
        angle, growth = self._angle, self._growth

        def turned(time: float) -> float:
            return angle + (spin + growth * time / 2) * time

        if not turned(drift) < TURNED:
            raise self._lost()
        watched = [
            Happening(lambda t: finger.gap(turned(t), t, self._ahead), finger.land, strikes=True),
            *loads.watched(angle, turned),
        ]
        for jack in self._jacks:
            watched += jack.watched(turned, self._ahead)
        return watched

    def _rest(self) -> None:
        """End a controller sample: put back what has drifted, and note by how much."""
        angle, worst = self._finger.rest(self._key.angle)
        self._angle = angle
        set_angle(self._key, angle)
        tangent = math.tan(angle)
        secant = math.sqrt(1 + tangent * tangent)
        x, z = self._key.position
        worst = max(worst, abs(x), abs(z), *[jack.rest(tangent, secant) for jack in self._jacks])
        self.worst_gap = max(self.worst_gap, worst / MM)

    def _lost(self) -> SceneError:
        return SceneError(
            f"the simulated bench lost its numbers at {self.time:.6g} s with steps of"
            f" {self._step * 1e3:.4g} us; lower the scene's step or the stiffness in it, or stop"
            " the key with felt = true"
        )
