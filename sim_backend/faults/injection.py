"""Fault injection: the faults of a scene occur in the press and at the time that it gives."""

from collections.abc import Callable
from typing import Protocol

from sautereau.sim_backend.devices.daqmx.card import DaqmxError, ServerGone
from sautereau.sim_backend.devices.daqmx.runs import RunFault
from sautereau.sim_backend.fault_tables import Faults


class Joints(Protocol):
    """An arm whose motors can stall and whose encoders can slip."""

    def stall(self, joint: int) -> None:
        """Block the motor of a joint (1 or 2) from now on."""
        ...

    def slip(self, joint: int, counts: int) -> None:
        """Offset the readings of a joint's (1 or 2) encoder by ``counts`` from now on."""
        ...


class FaultInjection:
    """Counts presses by their trigger edges, and injects the faults that are due.

    Args:
        faults: Of the scene, if any.
        joints: The arm.
        now: Returns the simulated time [s].
    """

    def __init__(self, faults: Faults | None, joints: Joints, now: Callable[[], float]):
        self.unplugged = False
        """Whether the card is disconnected."""
        self._faults, self._joints, self._now = faults or Faults.model_construct(), joints, now
        self._edges: list[float] = []
        self._due: list[tuple[float, Callable[[], None]]] = []

    @property
    def presses(self) -> int:
        """Trigger edges so far."""
        return len(self._edges)

    def past(self, press: int, at: float) -> bool:
        """Return whether ``at`` s have passed since the trigger edge of a press, from 1."""
        return self.presses >= press and self._now() >= self._edges[press - 1] + at

    def begin_press(self) -> bool:
        """Count the trigger edge of a press; return whether the card receives it."""
        now, faults, joints = self._now(), self._faults, self._joints
        self._edges.append(now)
        if (stall := faults.stall) and stall.press == self.presses:
            self._due.append((now + stall.at, lambda: joints.stall(stall.joint)))
        if (slip := faults.slip) and slip.press == self.presses:
            self._due.append((now + slip.at, lambda: joints.slip(slip.joint, slip.counts)))
        missing = faults.trigger_missing
        return missing is None or missing.press != self.presses

    def of_run(self) -> RunFault | None:
        """Return the fault that ends the acquisition of the present press, if any."""
        faults, press = self._faults, self.presses
        if (fault := faults.overrun) and fault.press == press:
            return RunFault(fault.sample, _overrun)
        if (fault := faults.server_gone) and fault.press == press:
            return RunFault(fault.sample, ServerGone)
        if (fault := faults.device_gone) and fault.press == press:
            return RunFault(fault.sample, self._unplug)
        return None

    def inject(self) -> None:
        """Inject what is due at the start of this controller sample."""
        if not self._due:
            return
        now = self._now()
        due = [inject for at, inject in self._due if at <= now]
        self._due = [each for each in self._due if each[0] > now]
        for inject in due:
            inject()

    def check_plugged(self) -> None:
        """Refuse a call that needs the card.

        Raises:
            DaqmxError: The card is disconnected.
        """
        if self.unplugged:
            raise _no_device()

    def _unplug(self) -> DaqmxError:
        self.unplugged = True
        return _no_device()


def _overrun() -> DaqmxError:
    return DaqmxError(
        -200279,
        "The application is not able to keep up with the hardware acquisition.\n"
        "Increasing the buffer size, reading the data more frequently, or specifying a fixed"
        " number of samples to read instead of reading all available samples might correct the"
        " problem.",
    )


def _no_device() -> DaqmxError:
    return DaqmxError(
        -201003,
        "Device cannot be accessed. Possible causes: Device is no longer present in the system."
        " Device is not powered. Device is powered, but was temporarily without power.",
    )
