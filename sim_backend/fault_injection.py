"""Fault injection: the faults of a scene occur in the press and at the time that it gives.

Those of the serial line are in `BadLine`.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.random import Generator

from sautereau.sim_backend.devices.daqmx.card import DaqmxError, ServerGone
from sautereau.sim_backend.devices.daqmx.runs import RunFault
from sautereau.sim_backend.devices.plant import ArmPlant
from sautereau.sim_backend.devices.ports import PortGone
from sautereau.sim_backend.fault_tables import Faults, LineFault

_ON_ARM: dict[str, Callable[[ArmPlant, Any], None]] = {
    "encoder_sign": lambda arm, fault: arm.reverse(fault.joint),
    "encoders_swapped": lambda arm, fault: arm.swap(),
    "index_missing": lambda arm, fault: arm.unwire_index(fault.joint),
    "switch_polarity": lambda arm, fault: arm.invert(fault.switch),
    "switch_cut": lambda arm, fault: arm.cut(fault.switch, fault.joint),
    "switches_swapped": lambda arm, fault: arm.cross(fault.switch),
    "encoder_loss": lambda arm, fault: arm.lose_encoder(fault.joint),
    "switch_closed": lambda arm, fault: arm.close(fault.switch, fault.joint),
    "amplifier_fault": lambda arm, fault: arm.break_amplifier(fault.joint),
    "stall": lambda arm, fault: arm.stall(fault.joint),
    "slip": lambda arm, fault: arm.slip(fault.joint, fault.counts),
}
"""What each fault of the arm does; one without a press is there from power-up."""


class FaultInjection:
    """Counts presses by their trigger edges, and injects the faults that are due.

    Args:
        faults: Of the scene, if any.
        now: Returns the simulated time [s].
    """

    def __init__(self, faults: Faults | None, arm: ArmPlant, now: Callable[[], float]):
        self.unplugged = False
        """Whether the card is disconnected."""
        self._faults, self._arm, self._now = faults or Faults.model_construct(), arm, now
        self._edges: list[float] = []
        self._due: list[tuple[float, Callable[[], None]]] = []
        self._schedule(0, now())
        self.inject()

    def _schedule(self, press: int, now: float) -> None:
        """Make the arm's faults of a press due, or with press 0 those from power-up."""
        for name, act in _ON_ARM.items():
            fault = getattr(self._faults, name)
            if fault is not None and getattr(fault, "press", 0) == press:
                at = now + getattr(fault, "at", 0.0)
                self._due.append((at, partial(act, self._arm, fault)))

    @property
    def presses(self) -> int:
        """Trigger edges so far."""
        return len(self._edges)

    def past(self, press: int, at: float) -> bool:
        """Return whether ``at`` s have passed since the trigger edge of a press, from 1."""
        return self.presses >= press and self._now() >= self._edges[press - 1] + at

    def begin_press(self) -> bool:
        """Count the trigger edge of a press; return whether the card receives it."""
        now = self._now()
        self._edges.append(now)
        self._schedule(self.presses, now)
        missing = self._faults.trigger_missing
        return missing is None or missing.press != self.presses

    def of_run(self) -> RunFault | None:
        """Return the fault that ends the acquisition of the present press, if any."""
        faults = self._faults
        ends = (
            (faults.overrun, _overrun),
            (faults.server_gone, ServerGone),
            (faults.device_gone, self._unplug),
        )
        for fault, error in ends:
            if fault is not None and fault.press == self.presses:
                return RunFault(fault.sample, error)
        return None

    def inject(self) -> None:
        """Inject what is due at the start of this controller sample."""
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


Past = Callable[[int, float], bool]
"""Whether ``at`` s (second argument) have passed since the trigger edge of a press, from 1."""


class BadLine:
    """A serial line with the faults of a scene.

    Args:
        faults: Of the scene, if any.
        seed: Of all random numbers.
        past: Compares the time with that of a press.
    """

    def __init__(self, faults: Faults | None, seed: int, past: Past):
        faults = faults or Faults.model_construct()
        self._noise = faults.line or LineFault.model_construct(dropped=0.0, flipped=0.0, delay=0.0)
        self._cable = faults.cable_out
        self._past = past
        self._received = 0
        # Each direction has a generator of its own, for the host decides how they interleave.
        self._random = {
            towards: np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1, i)))
            for i, towards in enumerate(("controller", "host"))
        }

    @property
    def delay(self) -> float:
        """s of real time, by which an answer is late now."""
        return self._noise.delay if self._noisy else 0.0

    def carry(self, data: bytes, receive: Callable[[bytes], bytes]) -> bytes:
        """Carry bytes to the controller and its answer back.

        Raises:
            PortGone: The port has disappeared with the cable.
        """
        data = self._disturbed(data, "controller")
        allowed = self._allowed(len(data))
        self._received += len(data)
        answer = receive(data[:allowed])
        if allowed < len(data) or self.gone:
            if self._cable is not None and self._cable.port_closes:
                raise PortGone
            return b""
        return self._disturbed(answer, "host")

    @property
    def gone(self) -> bool:
        """Whether the cable is disconnected."""
        cable = self._cable
        if cable is None:
            return False
        if cable.after_bytes is not None:
            return self._received >= cable.after_bytes
        return cable.press is not None and self._past(cable.press, cable.at)

    def towards_host(self, data: bytes) -> bytes:
        """Carry bytes that the controller sends by itself."""
        return b"" if self.gone else self._disturbed(data, "host")

    @property
    def _noisy(self) -> bool:
        press = self._noise.press
        return press == 0 or self._past(press, 0.0)

    def _allowed(self, n: int) -> int:
        """Return how many of n bytes the controller still receives."""
        cable = self._cable
        if cable is None:
            return n
        if cable.after_bytes is not None:
            return min(n, max(0, cable.after_bytes - self._received))
        return 0 if self.gone else n

    def _disturbed(self, data: bytes, towards: str) -> bytes:
        noise = self._noise
        if (
            not (noise.dropped or noise.flipped)
            or not self._noisy
            or noise.towards not in ("both", towards)
        ):
            return data
        return disturbed(data, noise.dropped, noise.flipped, self._random[towards])


def disturbed(data: bytes, dropped: float, flipped: float, random: Generator) -> bytes:
    """Return the bytes with some lost and some with one bit inverted.

    Args:
        data: Any bytes; each takes three random numbers.
        dropped: Probability that a byte is lost.
        flipped: Probability that a byte is changed if it is not lost.
        random: Source of the random numbers.
    """
    numbers = random.random((len(data), 3))
    values = np.frombuffer(data, np.uint8)
    bits = np.left_shift(1, (numbers[:, 2] * 8).astype(np.uint8)).astype(np.uint8)
    values = np.where(numbers[:, 1] < flipped, values ^ bits, values)
    return values[numbers[:, 0] >= dropped].tobytes()
