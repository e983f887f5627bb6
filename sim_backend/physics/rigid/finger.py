"""What presses the key, as the rigid-body engine advances it; and a push without an arm."""

import math
from abc import ABC, abstractmethod

from sautereau.sim_backend.parts import Push
from sautereau.sim_backend.physics.finger import Finger, Reference
from sautereau.sim_backend.physics.rigid.pad import Friction, Pad
from sautereau.sim_backend.physics.rigid.step_event import Kick


class SteppedFinger(Finger, ABC):
    """A finger as the rigid-body engine advances it; mm, g and ms.

    The methods given here are those of a finger without a body in the engine, which no contact can
    involve.
    """

    moment: float = 0.0
    """N mm, on the key without a contact."""
    pad: Pad | None = None
    """The pad between a compliant fingertip and the key; None for a rigid fingertip."""
    friction: Friction | None = None
    """Of the fingertip, without a pad; None for none."""
    push_end: float = math.inf
    """ms into the controller sample, end of that moment; inf if not within this sample."""

    @abstractmethod
    def begin_sample(self, reference: Reference, powered: bool, time: float) -> bool:
        """Start a controller sample at a time [s]; return whether the forces jump there."""

    def apply_forces(self, elapsed: float, angle: float, omega: float, kick: Kick) -> None:
        """Apply the finger's forces to the bodies at the end of a step.

        Args:
            elapsed: ms into the controller sample.
            angle: rad, of the key.
            omega: rad/ms, of the key.
        """

    @abstractmethod
    def contact_force(self, weight: float) -> float:
        """Return the force [N] on the key in the last step.

        Args:
            weight: ms, for which the forces acted in it.
        """

    def retries(self, weight: float) -> bool:
        """Take the friction from the force in a trial of a step; return whether to repeat it."""
        return False

    def foresee(self, force: float) -> None:
        """Take the force [N] of the next step, by which the friction in it is known."""

    def reaches_key(self, angle: float, step: float) -> bool:
        """Return whether a separated finger reaches the key, at an angle [rad] after a step."""
        return False

    def stays_clear(self, angle: float) -> bool:
        """Return whether it stays off a key at an angle [rad] in this controller sample.

        Only a finger without bodies in motion may return True: then no step is taken.
        """
        return False

    def gap(self, angle: float, time: float, ahead: float) -> float:
        """Return the gap [mm] to the key.

        Args:
            angle: rad, of the key then.
            time: ms from the present position.
            ahead: ms, by half of which the last impulse advanced the velocity.
        """
        return math.inf

    def make_contact(self, time: float) -> None:
        """Be in contact with the key from a time [s] on."""

    def correct_and_drift(self, back: float, drift: float) -> None:
        """Undo the surplus of the last impulse and compute the state after a drift.

        Args:
            back: ms, by which the last forces acted too long.
            drift: ms.
        """

    def set_bodies(self, step: float) -> None:
        """Set the bodies so that a step [ms] of the engine ends in their target state."""

    def end_sample(self, angle: float) -> tuple[float, float]:
        """End a controller sample with the key at an angle [rad].

        Returns:
            The contact angle if the finger touches the key, else the angle itself; and the largest
            error [mm] of a joint or a contact.
        """
        return angle, 0.0


class PushFinger(SteppedFinger):
    """A force on the key from the first instant on; the arm is not simulated and stays still."""

    def __init__(self, push: Push, press_arm: float, start: tuple[float, float], period: float):
        super().__init__(start)
        self._push, self._period = push, period
        self._arm = press_arm

    def begin_sample(self, reference: Reference, powered: bool, time: float) -> bool:
        before, left = self.moment, self._push.duration - time
        on = powered and left > 1e-9 * self._period
        self.moment = self._push.force * self._arm * 1e3 if on else 0.0
        within = on and left < self._period * (1 - 1e-9)
        self.push_end = left * 1e3 if within else math.inf
        return self.moment != before

    def apply_forces(self, elapsed: float, angle: float, omega: float, kick: Kick) -> None:
        """Apply the friction; see `SteppedFinger`."""
        if self.friction is not None:
            force = self.contact_force(0.0)
            part = self.friction.part(force, omega, kick.step)
            self.friction.rub(force * part * kick.fraction, angle)

    def contact_force(self, weight: float) -> float:
        return self.moment / self._arm / 1e3
