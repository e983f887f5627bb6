"""The bench as rigid bodies: leap-frog steps, split at events.

Each step of pymunk first moves the bodies and then applies the impulses, so the forces can be
set for the new positions: this is the leap-frog scheme, whose velocities are half a step ahead
of the positions. Events inside a step (a contact, a release) are located on the parabola of
that step. The bodies advance to the event only; the forces before it act over half of the time
to the event, those after it over half of the remaining time, and the impulse that was applied
beyond the event is undone. Positions are set directly in such a step, so that pymunk always
takes steps of the same length: when the length changes, pymunk warm-starts its solver with the
impulses of the old step and does not count the difference.
"""

import math

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.base import LARGEST_ANGLE, TURNED_OVER, World
from sautereau.sim_backend.physics.drive import Drive
from sautereau.sim_backend.physics.events import Motions
from sautereau.sim_backend.physics.finger import Reference
from sautereau.sim_backend.physics.rigid.assembly import TICK, assemble, even_steps
from sautereau.sim_backend.physics.rigid.bodies import MM, set_angle, set_torque
from sautereau.sim_backend.physics.rigid.step_event import Event, Kick, earliest
from sautereau.sim_backend.scene import Scene

MOST_EVENTS = 1000
"""Events in one controller sample above which the simulation counts as diverged."""

Row = tuple[float, float, float, float, float, float]
"""Quantities of `Motions`, with the time in ms into the controller sample."""


class RigidWorld(World):
    """The physics of a scene; the same `Scene`, rig and references give the same bits.

    Args:
        rig: The nominal bench; the true one may differ by the scene's `truth`.
        scene: With a chosen step.
        start: rad, joints when power comes on; None for home and the scene's offset.

    Raises:
        SceneError: A part of the scene is too stiff, or a choir has no pluck.
    """

    def __init__(self, rig: Rig, scene: Scene, start: tuple[float, float] | None = None):
        super().__init__(rig, scene, start)
        rig = self.rig
        self._parts = parts = assemble(rig, scene, self.start, self.events)
        self._space, self._key, self._loads = parts.space, parts.key, parts.loads
        self._jacks, self._division = parts.jacks, parts.division
        self._front = parts.front
        self._pushed = self._loads if self._front is None else self._front.loads
        self.finger = self._finger = parts.finger
        self._loaded = [jack for jack in self._jacks if jack.loaded]
        self._iterations = scene.iterations
        self._period = rig.controller.sample_period * MM
        self._step = self._ahead = self._engine_step = self._division.step()
        self._angle, self._omega, self._acceleration = self._key.angle, 0.0, 0.0
        self._fresh = False
        self._state: tuple[float, ...] = ()
        self._still = False
        self._elapsed = 0.0
        self._rows: list[Row] = []
        self._before = [(-2 * self._period, *[0.0] * 5), (-self._period, *[0.0] * 5)]
        self.worst_gap = 0.0
        """m, largest error of a joint or a contact at the end of a controller sample so far."""

    def advance(self, reference: Reference, powered: bool) -> Motions:
        """Advance by one controller sample; see `World.advance`."""
        return self._motions([self._sample(reference, powered)])

    def play(self, drive: Drive) -> Motions:
        """Advance through a complete drive; see `World.play`."""
        return self._motions([self._sample(drive.reference(i), True) for i in range(drive.samples)])

    def _motions(self, samples: list[list[Row]]) -> Motions:
        """Return the motion over the last controller samples, by the rows of each."""
        counts = [len(rows) for rows in samples]
        first, period = self.samples - len(samples), self.rig.controller.sample_period
        numbers = np.arange(first, self.samples)
        table = np.array([row for rows in samples for row in rows]).T
        table[0] = np.repeat(numbers * period, counts) + table[0] / MM
        table[0, np.cumsum(counts) - 1] = (numbers + 1) * period
        return Motions(*table)

    def _sample(self, reference: Reference, powered: bool) -> list[Row]:
        """Advance by one controller sample; return its rows, from its start on."""
        finger, loads = self._finger, self._pushed
        kept = [*self._before, *self._rows][-2:]
        self._before = [(row[0] - self._period, *row[1:]) for row in kept]
        self._rows = []
        self._elapsed = 0.0
        if finger.begin_sample(reference, powered, self.time) or not self.samples:
            loads.steady = loads.weight + finger.moment
            self._split(0.0, None, self._period)
        if finger.push_end < self._period:
            self._run(finger.push_end)
            finger.moment, loads.steady = 0.0, loads.weight
            self._split(0.0, None, self._period)
        if self._still and finger.stays_clear(self._seen_angle):
            self._rows.append(
                (self._period, self._seen_angle, 0.0, self._jacks[0].rise / MM, 0.0, 0.0)
            )
        else:
            self._run(self._period)
            self._end_sample()
        self.samples += 1
        if not math.isfinite(sum(self._rows[-1])):
            raise self._diverged()
        return self._rows

    @property
    def _seen_angle(self) -> float:
        """Angle [rad] of the key that the laser sees."""
        front = self._front
        return self._angle if front is None else front.seen(self._angle, front.value)

    def _run(self, end: float) -> None:
        """Advance to a time [ms] within the controller sample."""
        event_count = 0
        while end - self._elapsed > TICK:
            count, drift = even_steps(end - self._elapsed, self._step)
            if drift == self._ahead == self._step:
                if self._cruise(count) == count:
                    self._elapsed = end
                    return
                count, drift = even_steps(end - self._elapsed, self._step)
            time, event = earliest(self._possible_events(drift), drift)
            self._split(time, event, end)
            event_count += 1
            if event_count > MOST_EVENTS:
                raise self._diverged()

    def _cruise(self, count: int) -> int:
        """Take equal steps; return how many were done before the first one with an event."""
        space_step, key, finger, rows = self._space.step, self._key, self._finger, self._rows
        jacks, loaded, moment = self._jacks, self._loaded, self._loads.moment
        first, step, seconds = jacks[0], self._step, self._step / MM
        apply_forces, reaches_key = finger.apply_forces, finger.reaches_key
        contact_force = finger.contact_force
        angle, omega, acceleration = self._angle, self._omega, self._acceleration
        low, high = self._loads.bounds(angle)
        clock, start, elapsed, done = self.time, self._elapsed, self._elapsed, 0
        kick = Kick(step, step, 1.0)
        sqrt, tan, fresh, front = math.sqrt, math.tan, self._fresh, self._front
        pressed = rate = 0.0
        while done < count:
            ahead, node = angle + omega * step, omega + acceleration * step / 2
            if front is None:
                pressed = ahead
            elif front.stays(ahead, node, step):
                pressed = front.angle
            else:
                break
            if not low < ahead < high or reaches_key(pressed, step):
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
            torque = moment(ahead, node)
            if front is not None:
                torque += front.apply(front.moment(), front.reaction(ahead, node))
                node = front.omega
            set_torque(key, torque)
            done += 1
            elapsed = start + done * step
            apply_forces(elapsed, pressed, node, kick)
            if finger.strikes:
                self._parts.converge()
                self._fresh = fresh = True
            space_step(step)
            if fresh:
                self._space.iterations, self._fresh, fresh = self._iterations, False, False
            before, omega = omega, key.angular_velocity
            acceleration = (omega - before) / step
            for jack in jacks:
                jack.update(step)
            angle = ahead
            rate = (before + omega) / 2
            if front is not None:
                rate = front.seen(rate, front.update(lambda grown: grown / step))
                pressed = front.seen(angle, front.value)
            speed = rate * MM
            rows.append((elapsed, pressed, speed, first.rise / MM, contact_force(step), pull))
        self._angle, self._omega = angle, omega
        self._acceleration, self._elapsed = acceleration, elapsed
        return done

    def _split(self, drift: float, event: Event | None, end: float) -> None:
        """Advance by a time that need not be a step, and apply the event at its end.

        Args:
            drift: ms.
            event: At the end of the drift; None for no change of mode.
            end: ms into the controller sample, end of the next steps.
        """
        key, jacks, loads, finger = self._key, self._jacks, self._loads, self._finger
        front, reaction, push = self._front, 0.0, 0.0
        back = (self._ahead - drift) / 2
        self._omega -= self._acceleration * back
        angle = self._angle + self._omega * drift
        tangent = math.tan(angle)
        secant = math.sqrt(1 + tangent * tangent)
        if front is not None:
            front.correct_and_drift(back, drift)
        for jack in jacks:
            jack.correct_and_drift(self._angle, self._omega, back)
            jack.stays(tangent, secant, drift)
        start = self.time + self._elapsed / MM
        self._elapsed += drift
        node = self._omega + self._acceleration * drift / 2
        moment = loads.moment(angle, node)
        pressed, rate, seen = angle, node, node
        if front is not None:
            front.stays(angle, node, drift)
            pressed, rate, seen = front.angle, front.omega, front.seen(node, front.node)
            push, reaction = front.moment(), front.reaction(angle, node)
        now = self.time + self._elapsed / MM
        # A string may return a mean force over the drift; its present force counts for half of it.
        forces = [
            2 * jack.forces(start, drift / MM) - jack.forces(now, 0.0) if drift else 0.0
            for jack in jacks
        ]
        pulled = sum(jack.pull for jack in self._loaded)
        if event is not None:
            event.change(now)
            self._step = self._division.step()
        left = end - self._elapsed
        ahead = even_steps(left, self._step)[1] if left > TICK else self._step
        weight = (drift + ahead) / 2
        means = [
            (force * drift + jack.forces(now, 0.0) * ahead) / (2 * weight)
            for jack, force in zip(jacks, forces, strict=True)
        ]
        mean = (moment * drift + loads.moment(angle, node) * ahead) / (2 * weight)
        if front is not None:
            push = (push * drift + front.moment() * ahead) / (2 * weight)
        finger.correct_and_drift(back, drift)
        before, part = self._omega, weight / self._step
        for _ in range(2 if self._step != self._engine_step else 1):
            finger.set_bodies(self._step)
            key.angle, key.angular_velocity = angle - before * self._step, before
            torque = mean * part
            if front is not None:
                front.set_bodies(self._step)
                torque += front.apply(push * part, reaction * part)
            set_torque(key, torque)
            for jack, force in zip(jacks, means, strict=True):
                jack.set_bodies(self._step, force * part)
            finger.apply_forces(self._elapsed, pressed, rate, Kick(ahead, self._step, part))
            self._parts.kick(self._step, part)
        self._engine_step, self._fresh = self._step, True
        self._angle, self._ahead = angle, ahead
        self._omega = key.angular_velocity
        impact = event is not None and event.impact
        # Half of the impulse is by the forces before the event, extrapolated to it.
        grown = 2 * (self._omega - before) - self._acceleration * drift
        self._acceleration = 0.0 if impact else grown / ahead
        if front is not None:
            old = front.acceleration
            front.update(lambda grown: 0.0 if impact else (2 * grown - old * drift) / ahead)
        for jack in jacks:
            jack.update(weight)
        self._append_rows(seen, pulled, finger.contact_force(weight), drift, ahead, impact)

    def _append_rows(
        self, omega: float, pulled: float, mean: float, drift: float, ahead: float, impact: bool
    ) -> None:
        """Append the left and the right limit at the end of a drift, or one row if they agree.

        Args:
            omega: rad/ms, that the laser sees, before an impact.
            pulled: N, of the strings, before the event.
            mean: N, of the finger: half of both forces, weighted by the times before and after.
            drift: ms, before the event; with 0 there is no left limit.
            ahead: ms, of the next step.
            impact: Whether velocities jump; then the mean force contains the impulse.
        """
        pull = sum(jack.pull for jack in self._loaded)
        rise, before, after = self._jacks[0].rise / MM, mean, mean
        if self._finger.pad is not None:
            before = self._finger.pad.before
        elif drift and pull != pulled and not impact:
            before = self._force_before()
            after = (mean * (drift + ahead) - before * drift) / ahead
        if drift:
            row = self._elapsed, self._seen_angle, omega * MM, rise, before, pulled
            self._rows.append(row)
        if not drift or impact or pull != pulled or before != after:
            if impact:
                front, omega = self._front, self._omega
                omega = omega if front is None else front.seen(omega, front.speed)
            self._rows.append((self._elapsed, self._seen_angle, omega * MM, rise, after, pull))

    def _force_before(self) -> float:
        """Return the finger's force [N] now, extrapolated from the last two rows."""
        (t0, *_, f0, _), (t1, *_, f1, _) = [*self._before, *self._rows][-2:]
        return f1 + (f1 - f0) / (t1 - t0) * (self._elapsed - t1) if t1 > t0 else f1

    def _possible_events(self, drift: float) -> list[Event]:
        """Return the events that may occur within a drift [ms]."""
        loads, finger = self._loads, self._finger
        omega = self._omega - self._acceleration * self._ahead / 2
        angle, acceleration = self._angle, self._acceleration

        def turned(time: float) -> float:
            return angle + (omega + acceleration * time / 2) * time

        if not math.isfinite(turned(drift)):
            raise self._diverged()
        if turned(drift) >= LARGEST_ANGLE:
            raise SceneError(f"rig {self.rig.name}: after {self.time:.6g} s {TURNED_OVER}")
        pressed, felt = turned, []
        if self._front is not None:
            pressed = self._front.turned(turned, self._ahead)
            felt = self._front.possible_events(turned, self._ahead)
        possible = [
            *felt,
            Event(
                lambda t: finger.gap(pressed(t), t, self._ahead),
                finger.make_contact,
                impact=finger.pad is None,
            ),
            *loads.possible_events(angle, turned),
        ]
        for jack in self._jacks:
            possible += jack.possible_events(turned, self._ahead)
        return possible

    def _end_sample(self) -> None:
        """End a controller sample: correct the drift of the constraints and record its size."""
        front, lever = self._front, self._parts.lever
        pressed, worst = self._finger.end_sample(lever.angle)
        set_angle(lever, pressed)
        self._angle = angle = self._key.angle
        x, z = self._key.position
        height = 0.0 if front is None else front.end_sample(pressed)
        worst = max(
            worst, abs(x), abs(z - height), *[jack.end_sample(angle) for jack in self._jacks]
        )
        self.worst_gap = max(self.worst_gap, worst / MM)
        before, self._state = self._state, (angle, self._omega, self._acceleration)
        if front is not None:
            self._state += front.value, front.speed, front.acceleration
        unloaded = (jack.standing and jack.unloaded for jack in self._jacks)
        # A key at rest that a sample has not changed is not changed by the next one either.
        self._still = self._state == before and all(unloaded)

    def _diverged(self) -> SceneError:
        return SceneError(
            f"the simulation diverged at {self.time:.6g} s with steps of"
            f" {self._step * 1e3:.4g} us; lower the scene's step or a stiffness, or stop"
            " the key with felt = true"
        )
