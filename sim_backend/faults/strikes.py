"""When the faults of a scene strike: presses are counted by their trigger edges."""

from collections.abc import Callable
from typing import Protocol

from sautereau.sim_backend.devices.daqmx.card import DaqmxError, ServerGone
from sautereau.sim_backend.devices.daqmx.runs import RunFault
from sautereau.sim_backend.faults.tables import Faults


class Joints(Protocol):
    """An arm whose motors stall and whose encoders slip."""

    def stall(self, joint: int) -> None:
        """Let the motor of a joint (1 or 2) stand from now on."""
        ...

    def slip(self, joint: int, counts: int) -> None:
        """Let the encoder of a joint (1 or 2) read so much more from now on."""
        ...


class Strikes:
    """Count presses, and let strike what is due.

    Args:
        faults: Of the scene, if any.
        joints: Of its arm.
        now: Tells the world's clock [s].
    """

    def __init__(self, faults: Faults | None, joints: Joints, now: Callable[[], float]):
        self.unplugged = False
        """Whether the card is gone."""
        self._faults, self._joints, self._now = faults or Faults.model_construct(), joints, now
        self._edges: list[float] = []
        self._due: list[tuple[float, Callable[[], None]]] = []

    def past(self, press: int, at: float) -> bool:
        """Return whether so many s have passed since the trigger edge of a press, from 1."""
        return len(self._edges) >= press and self._now() >= self._edges[press - 1] + at

    def begin_press(self) -> bool:
        """Note the trigger edge of a press; return whether it comes to the card."""
        now, faults, joints = self._now(), self._faults, self._joints
        self._edges.append(now)
        if (stall := faults.stall) and stall.press == len(self._edges):
            self._due.append((now + stall.at, lambda: joints.stall(stall.joint)))
        if (slip := faults.slip) and slip.press == len(self._edges):
            self._due.append((now + slip.at, lambda: joints.slip(slip.joint, slip.counts)))
        missing = faults.trigger_missing
        return missing is None or missing.press != len(self._edges)

    def of_run(self) -> RunFault | None:
        """Return what ends the acquisition of the press that has just begun."""
        faults, press = self._faults, len(self._edges)
        if (fault := faults.overrun) and fault.press == press:
            return RunFault(fault.sample, _overrun)
        if (fault := faults.server_gone) and fault.press == press:
            return RunFault(fault.sample, ServerGone)
        if (fault := faults.device_gone) and fault.press == press:
            return RunFault(fault.sample, self._unplug)
        return None

    def strike(self) -> None:
        """Let strike what is due in the controller sample that begins."""
        if not self._due:
            return
        now = self._now()
        due = [strike for at, strike in self._due if at <= now]
        self._due = [each for each in self._due if each[0] > now]
        for strike in due:
            strike()

    def check_plugged(self) -> None:
        """Refuse a call that needs the card.

        Raises:
            DaqmxError: It is unplugged.
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
