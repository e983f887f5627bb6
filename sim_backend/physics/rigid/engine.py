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
from itertools import chain

import numpy as np
from scipy.optimize import brentq

from sautereau.analysis.model.string.string import ModalState
from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.base import TURNED_OVER, World
from sautereau.sim_backend.physics.drive import Drive
from sautereau.sim_backend.physics.events import Motions
from sautereau.sim_backend.physics.finger import Reference
from sautereau.sim_backend.physics.rigid.assembly import TICK, assemble, even_steps
from sautereau.sim_backend.physics.rigid.bodies import MM, set_force
from sautereau.sim_backend.physics.rigid.key import Event, Kick
from sautereau.sim_backend.physics.structures import LARGEST_ANGLE
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.motion import Floats

MOST_EVENTS = 1000  # Changes of contact in one controller sample above which a step is too long

Row = tuple[float, float, float, float, float, float, float]
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
        self._space, self._key = parts.space, parts.key
        self._jacks, self._division = parts.jacks, parts.division
        self.finger = self._finger = parts.finger
        self._loaded = [jack for jack in self._jacks if jack.loaded]
        self._iterations = scene.iterations
        self._period = rig.controller.sample_period * MM
        self._step = self._ahead = self._engine_step = self._division.step()
        self._fresh = False
        self._state: tuple[float, ...] = ()
        self._still = False
        self._elapsed = 0.0
        self._rows: list[Row] = []
        self._before = [(-2 * self._period, *[0.0] * 6), (-self._period, *[0.0] * 6)]
        self.worst_gap = 0.0
        """m, largest error of a joint or a contact at the end of a controller sample so far."""

    def advance(self, reference: Reference, powered: bool) -> Motions:
        start = self.time
        table = np.array(self._sample(reference, powered)).T
        table[0] = start + table[0] / MM
        table[0, -1] = self.time
        return Motions(*table)

    def play(self, drive: Drive) -> Motions:
        first, period = self.samples, self.rig.controller.sample_period
        samples = [self._sample(drive.reference(i), True) for i in range(drive.samples)]
        counts, numbers = [len(rows) for rows in samples], np.arange(first, self.samples)
        numbers_in_rows = chain.from_iterable(chain.from_iterable(samples))  # faster than np.array
        table = np.fromiter(numbers_in_rows, float).reshape(-1, 7).T
        table[0] = np.repeat(numbers * period, counts) + table[0] / MM
        table[0, np.cumsum(counts) - 1] = (numbers + 1) * period
        return Motions(*table)

    def string_modes(self, number: int, times: Floats) -> ModalState:
        from sautereau.sim_backend.physics.rigid.modal import ModalPlucking

        string = self._jacks[number - 1].string
        if not isinstance(string, ModalPlucking):
            return super().string_modes(number, times)
        return string.modes_at(times)

    def _sample(self, reference: Reference, powered: bool) -> list[Row]:
        """Advance by one controller sample; return its rows, from its start on."""
        finger, key = self._finger, self._key
        kept = [*self._before, *self._rows][-2:]
        self._before = [(row[0] - self._period, *row[1:]) for row in kept]
        self._rows = []
        self._elapsed = 0.0
        if finger.begin_sample(reference, powered, self.time) or not self.samples:
            key.pushed = finger.moment
            self._split(0.0, None, self._period)
        if finger.push_end < self._period:
            self._run(finger.push_end)
            finger.moment = 0.0
            key.pushed = 0.0
            self._split(0.0, None, self._period)
        if self._still and finger.stays_clear(key.seen_angle):
            self._rows.append(
                (self._period, key.seen_angle, 0.0, self._jacks[0].value / MM, 0.0, 0.0, 0.0)
            )
        else:
            self._run(self._period)
            # The drift of the constraints is corrected.
            pressed, worst = finger.end_sample(key.lever.angle)
            worst = max(worst, key.end_sample(pressed))
            worst = max(worst, *[jack.end_sample(key.value) for jack in self._jacks])
            self.worst_gap = max(self.worst_gap, worst / MM)
            state, self._state = self._state, key.state()
            unloaded = (jack.standing and jack.unloaded for jack in self._jacks)
            # A key at rest that a sample has not changed is not changed by the next one either.
            self._still = self._state == state and all(unloaded)
        self.samples += 1
        if not math.isfinite(sum(self._rows[-1])):
            raise self._diverged()
        return self._rows

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
                raise SceneError(
                    f"contacts changed more than {MOST_EVENTS} times within the controller's sample"
                    f" at {self.time:.6g} s, with steps of {self._step * 1e3:.4g} us; lower the"
                    ' step of the scene, or let it take engine = "exact"'
                )

    def _cruise(self, count: int) -> int:
        """Take equal steps; return how many were done before the first one with an event."""
        key, finger, jacks, rows = self._key, self._finger, self._jacks, self._rows
        pressed, step, space = key.pressed, self._step, self._space
        start = elapsed = self._elapsed
        kick, seconds, clock = Kick(step, step, 1.0), step / MM, self.time
        key.begin_steps()
        done = 0
        while done < count:
            if not key.stays(step) or finger.gap(pressed.next, step, step) < 0:
                break
            stays = [jack.stays(step) for jack in jacks]
            if not all(stays):
                break
            pull = 0.0
            for jack in self._loaded:
                set_force(jack.body, (0.0, -jack.forces(clock + elapsed / MM, seconds)))
                pull += jack.pull
            key.apply(*key.moments())
            done += 1
            elapsed = start + done * step
            finger.drift(step)
            finger.apply_forces(elapsed, pressed.next, pressed.node, kick)
            space.step(step)
            if self._fresh:
                space.iterations, self._fresh = self._iterations, False
            angle, rate = key.update(step)
            for jack in jacks:
                jack.update(step)
            force = finger.contact_force(step)
            rows.append((elapsed, angle, rate * MM, jacks[0].value / MM, force, pull, 0.0))
        self._elapsed = elapsed
        return done

    def _split(self, drift: float, event: Event | None, end: float) -> None:
        """Advance by a time that need not be a step, and apply the event at its end.

        Args:
            drift: ms.
            event: At the end of the drift; None for no change of mode.
            end: ms into the controller sample, end of the next steps.
        """
        key, jacks, finger = self._key, self._jacks, self._finger
        back = (self._ahead - drift) / 2  # by which the last forces acted too long
        for part in (key, *jacks, finger):
            part.correct(back)
        finger.drift(drift)
        for part in (key, *jacks):
            part.stays(drift)
        start, self._elapsed = self.time + self._elapsed / MM, self._elapsed + drift
        now = self.time + self._elapsed / MM
        rate = key.seen(key.node, key.second.node)
        # A string may return a mean force over the drift; its present force counts for half of it.
        before = [
            2 * jack.forces(start, drift / MM) - jack.forces(now, 0.0) if drift else 0.0
            for jack in jacks
        ]
        before += key.moments()
        pulled = sum(jack.pull for jack in self._loaded)
        if event is not None:
            event.change(now)
            self._step = self._division.step()
        left = end - self._elapsed
        self._ahead = ahead = even_steps(left, self._step)[1] if left > TICK else self._step
        after = [*(jack.forces(now, 0.0) for jack in jacks), *key.moments()]
        both = drift + ahead
        means = [(b * drift + a * ahead) / both for b, a in zip(before, after, strict=True)]
        self._kick(Kick(ahead, self._step, both / 2 / self._step), means)
        impact = event is not None and event.impact
        key.update_at_event(drift, ahead, impact)
        for jack in jacks:
            jack.update(both / 2)
        self._append_rows(rate, pulled, finger.contact_force(both / 2), drift, ahead, impact)

    def _kick(self, kick: Kick, forces: list[float]) -> None:
        """Let the engine take the step about an event.

        Args:
            forces: N, on each jack, downwards; then N mm, as of `StiffKey.moments`.
        """
        *pulls, back, front = forces
        key, pressed, step = self._key, self._key.pressed, self._step
        for trial in range(20):  # the force that friction itself changes converges before
            self._finger.set_bodies(step)
            key.set_bodies(step)
            key.apply(back, front, kick.fraction)
            for jack, force in zip(self._jacks, pulls, strict=True):
                jack.set_bodies(step, force * kick.fraction)
            self._finger.apply_forces(self._elapsed, pressed.next, pressed.node, kick)
            self._parts.kick(step, kick.fraction)
            again = self._finger.retries(kick.fraction * step)
            if not again and (trial or step == self._engine_step):
                break
        self._engine_step, self._fresh = step, True

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
        last = (self._rows or self._before)[-1][4]
        blow = mean - last if impact and self._finger.pad is None else 0.0
        rise, before, after = self._jacks[0].value / MM, mean - blow, mean - blow
        if self._finger.pad is not None:
            before = self._finger.before
        elif drift and pull != pulled and not impact:
            # Extrapolated from the last two rows.
            (t0, *_, f0, _, _), (t1, *_, before, _, _) = [*self._before, *self._rows][-2:]
            if t1 > t0:
                before += (before - f0) / (t1 - t0) * (self._elapsed - t1)
            after = (mean * (drift + ahead) - before * drift) / ahead
        self._finger.foresee(after)
        if drift:
            row = self._elapsed, self._key.seen_angle, omega * MM, rise, before, pulled, blow
            self._rows.append(row)
        if not drift or impact or pull != pulled or before != after:
            if impact:
                omega = self._key.seen(self._key.speed, self._key.second.speed)
            row = self._elapsed, self._key.seen_angle, omega * MM, rise, after, pull, blow
            self._rows.append(row)

    def _possible_events(self, drift: float) -> list[Event]:
        """Return the events that may occur within a drift [ms]."""
        key, finger, ahead = self._key, self._finger, self._ahead
        if not math.isfinite(key.at(drift, ahead)):
            raise self._diverged()
        if key.at(drift, ahead) >= LARGEST_ANGLE:
            raise SceneError(f"rig {self.rig.name}: after {self.time:.6g} s {TURNED_OVER}")
        possible = [
            Event(
                lambda t: finger.gap(key.pressed.at(t, ahead), t, ahead),
                finger.make_contact,
                impact=finger.pad is None,
            ),
            *key.possible_events(ahead),
        ]
        for jack in self._jacks:
            possible += jack.possible_events(ahead)
        return possible

    def _diverged(self) -> SceneError:
        return SceneError(
            f"the simulation diverged at {self.time:.6g} s with steps of"
            f" {self._step * 1e3:.4g} us; lower the scene's step or a stiffness, or stop"
            " the key with felt = true"
        )


def earliest(possible: list[Event], drift: float) -> tuple[float, Event | None]:
    """Return the time [ms] of the first event within a drift [ms], and the event.

    Returns:
        The drift itself and None if there is no event.
    """
    time, first = drift, None
    for event in possible:
        if event.margin(time) >= 0:
            continue
        if event.margin(0.0) <= 0:
            return 0.0, event
        # To 1e-12 ms.
        found: float = brentq(event.margin, 0.0, time, xtol=1e-12)  # pyright: ignore
        time, first = found, event
    return time, first
