"""A modal string under its plectrum, which continues to vibrate after its release.

Where the plectrum may touch the string, both are solved together in steps that resolve the
modes; elsewhere the state of the free string is computed in closed form, only when needed. A
vibrating string may touch a rising plectrum below the string's rest position, intermittently;
a contact is nevertheless reported where the jack passes that rest position. A falling plectrum
passes the string there too, wherever the string is, and the tongue's force does not move the
string.
"""

import math
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.modal_pluck import MODES
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.surface import string_map
from sautereau.analysis.model.string.contact import STEP_FRACTION, ModalContact
from sautereau.analysis.model.string.string import FreeString, ModalState, ModalString
from sautereau.rig.instrument import Choir
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics import structures as ix
from sautereau.sim_backend.physics.events import PluckEvents
from sautereau.sim_backend.physics.rigid.pluck import MM, Plucking
from sautereau.sim_backend.scene import Scene


@dataclass
class Swing:
    """An interval of free vibration with constant decay."""

    start: float
    """s of simulated time, time 0 of `string`."""
    string: FreeString
    end: float = math.inf
    """s of simulated time; infinite until it ends."""


class ModalPlucking(Plucking):
    """The modal string of one choir; it locates its own release.

    Its discrete modes are those of the spring string; only the held mode differs.

    Args:
        scene: Level of the plectrum; whether tongue and damper are enabled.
        number: Of the choir, 0 for the first.
        events: List to which contacts, releases and returns are appended.
        modes: Number of dynamic modes.
        measured: Whether a sensor measures the string; its states on the plectrum are then kept.

    Raises:
        SceneError: The level has no pluck for this choir, or its damper is too strong.
    """

    steady = False

    def __init__(
        self,
        choir: Choir,
        scene: Scene,
        number: int,
        events: PluckEvents,
        modes: int = MODES,
        *,
        measured: bool = False,
    ):
        super().__init__(choir, scene, number, events)
        damper = choir.jack.damper if scene.damper else None
        self._at = f"more_choirs[{number - 1}]." if number else ""
        self._lift = damper.lift * MM if damper else -math.inf
        self._felt = damper is not None
        try:
            self._free = ModalString(choir.string, modes)
            self._damped = ModalString(choir.string, modes, damper.decay if damper else 0.0)
            plectrum = string_map(choir.plectrum, choir.string, scene.plectrum)
        except ModelError as error:
            raise SceneError(f"{self._at}{error}") from error
        string = self._damped if self._felt else self._free
        self._contact = contact = ModalContact(plectrum, choir.plectrum.overlap, string)
        self._longest = STEP_FRACTION / (
            choir.string.frequency * modes * float(self._free.stretch[-1])
        )
        self._stiff = -1 / contact.bend.at(contact.rest, 0.0)[9] / MM
        self._pull = 0.0
        self._reach = 0.0  # m, below the rest position
        self._over = True  # the string is above the plectrum, or on it
        self._swung: float | None = (
            0.0  # s, time of its state; None where the plectrum may touch it
        )
        self.swings: list[Swing] = []
        """Intervals of free vibration, in order of time."""
        self._kept: list[tuple[float, Floats]] | None = [] if measured else None
        self.stiffest = max(self.stiffest, self._stiff)
        self._holding, self._carries = False, True  # it may also push from below

    def force(self, rise: float, previous: float, time: float, step: float) -> float:
        """Return the force [N] on the jack at the end of a step, downwards; see `Plucking`.

        Where the string is released or hit within the step, the returned force gives a leap-frog
        scheme the exact momentum of the step. With a step of 0 it is the present force.

        Raises:
            SceneError: No point of the plectrum balances the string.
        """
        down = rise < self._lift
        if not self._carries and (down == self._felt or step == 0):
            return super().force(rise, previous, time, step)
        if step == 0:
            return self._pull
        before, momentum, began, left = self._pull, 0.0, previous, step
        if down != self._felt:
            if down != (previous < self._lift):
                began, left = self._lift, step * (rise - self._lift) / (rise - previous)
                momentum = self._go(began, previous, time, step - left)
            time += step - left
            if self._swung is not None:
                self._end_swing(time)
            self._felt, self._contact.string = down, self._damped if down else self._free
            if self._swung is not None:
                self._start_swing(time)
        momentum += self._go(rise, began, time, left)
        if not self._carries and momentum == 0.0:
            return super().force(rise, previous, time, step)
        return momentum / step + (self._pull - before) / 2

    def cross(self, upwards: bool, time: float) -> None:
        """Enter the next mode; see `Plucking`."""
        self._holding = False
        super().cross(upwards, time)
        if self._state != ix.STUCK or not self._carries or not upwards:
            return
        if not self._over:  # it slid off before and has not been above the plectrum since
            self._rise_above(time)
            return
        super()._report(ix.CONTACT, time, self._pull)
        self._holding = True
        self.high, self.stiffness = math.inf, self._stiff

    def _report(self, event: int, time: float, force: float) -> None:
        """Take a return; contact and release are those of the string itself."""
        if event == ix.RETURN:
            super()._report(event, time, force)
            self._over, self._carries = False, True  # unless found otherwise below

    def _rise_above(self, time: float) -> None:
        super().cross(True, time)
        if self._swung is None:
            self._start_swing(time)
        self._holding = self._carries = False

    def _go(self, rise: float, previous: float, time: float, step: float) -> float:
        """Advance the string by a step; return the momentum [N s] that it took from the jack."""
        self._pull = 0.0
        if step <= 0 or self._out_of_reach((max(rise, previous) - self.clearance) / MM, time):
            return 0.0
        if self._swung is not None:
            self._end_swing(time)
            self._swung = None
        contact = self._contact
        count = max(1, math.ceil(step / self._longest - 1e-9))
        part, increment = step / count, (rise - previous) / MM / count
        height, momentum = (previous - self.clearance) / MM, 0.0
        for i in range(count):
            low, high = height + increment * i, height + increment * (i + 1)
            if not self._over:
                contact.swing(part)
                self._over = contact.lift >= high
                self._keep(time + part * (i + 1))
                continue
            before = contact.found.up
            try:
                taken = contact.advance(part, low, high)
            except ModelError as error:
                raise SceneError(f"{self._at}{error}") from error
            momentum += taken * (before + contact.found.up) / 2
            self._keep(time + i * part + taken)
            if taken < part:
                self._slip(time + i * part + taken)
                if not self._carries:
                    return momentum
                contact.swing(part - taken)
                self._keep(time + part * (i + 1))
        self._pull = contact.found.up
        return momentum

    def _keep(self, time: float) -> None:
        """Keep the state on the plectrum at a time [s], if a sensor measures the string."""
        if self._kept is not None:
            state = self._contact.state
            self._kept.append((time, np.stack([state.q[1], state.v[1]])))

    def modes_at(self, times: Floats) -> ModalState:
        """Return the upward motion of the modes at past times [s], each of shape (n, modes)."""
        found = np.zeros((2, len(times), len(self._free.order)))
        if self._kept:
            known = np.array([time for time, _ in self._kept])
            states = np.array([state for _, state in self._kept])
            after = np.searchsorted(known, times).clip(1, len(known) - 1)
            part = (times - known[after - 1]) / np.diff(known)[after - 1]
            steps = states[after] - states[after - 1]
            found[:] = (states[after - 1] + part.clip(0, 1)[:, None, None] * steps).swapaxes(0, 1)
            found[:, times < known[0]] = 0.0
        for swing in self.swings:
            free = (times >= swing.start) & (times < swing.end)
            if free.any():
                state = swing.string.string.free(swing.string.state, times[free] - swing.start)
                found[:, free] = state.q[1], state.v[1]
        return ModalState(*found)

    def _out_of_reach(self, height: float, time: float) -> bool:
        """Return whether the plectrum cannot touch the string up to a height [m]."""
        if self._holding:
            return False
        if self._carries:
            if height > -self._reach:
                self._swing_to(time)
                self._reach = self._contact.reach
            if height > -self._reach:
                return False
            self._over = True
        if self._swung is None:
            self._start_swing(time)
        return True

    def _slip(self, time: float) -> None:
        """Let the string slide off the tip; report a release if it was held."""
        force = self._contact.found.up
        self._over = False
        self._contact.leave()
        if self._holding:
            super()._report(ix.RELEASE, time, force)
            self._rise_above(time)

    def _start_swing(self, time: float) -> None:
        contact = self._contact
        contact.leave()
        self._swung, self._reach = time, contact.reach
        if self._reach > 0:
            self.swings.append(Swing(time, FreeString(contact.string, contact.state)))

    def _end_swing(self, time: float) -> None:
        self._swing_to(time)
        if self._reach > 0:
            self.swings[-1].end = time

    def _swing_to(self, time: float) -> None:
        if self._swung is not None and time > self._swung:
            if self._reach > 0:
                self._contact.swing(time - self._swung)
            self._swung = time
