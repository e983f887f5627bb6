"""Setpoints sent one by one from a thread of their own, and the timing that was achieved."""

import threading
from dataclasses import dataclass

import numpy as np

from sautereau.robot.controller import Capture
from sautereau.robot.drivers.odrive.axes import Axes
from sautereau.robot.drivers.odrive.setpoints import INTERVAL, LEAD, Setpoints
from sautereau.robot.errors import MotionFault
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Counts

LARGEST_GAP = 3.0
"""Intervals that may pass between two setpoints."""


@dataclass(frozen=True)
class Punctuality:
    """Timing of the setpoints of one motion."""

    largest_gap: float
    """s, longest time between two setpoints."""
    jitter: float
    """s RMS, of the setpoints about their due times."""
    skipped: int
    """Setpoints that were not sent because the next one was due."""


class Stream:
    """The setpoints of one motion.

    Where it fails, the command to switch off is sent at once, before anybody waits.

    Args:
        axes: Follow setpoints already.
        setpoints: Of the motion.
        error_limit: Counts between a joint and its plan at which the motors go off.
    """

    def __init__(self, axes: Axes, setpoints: Setpoints, error_limit: int):
        self._axes, self._setpoints, self._error_limit = axes, setpoints, error_limit
        self._commands = axes.setpoints(setpoints)
        self._sent: list[int] = []
        self._times: list[float] = []
        self._counts: list[Counts] = []
        self._torques: list[Floats] = []
        self.cancelled = threading.Event()
        """Set by `cancel`."""
        self._fault: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="ODrive setpoints", daemon=True)

    def start(self) -> None:
        """Start, and return at once."""
        self._thread.start()

    def wait(self) -> None:
        """Wait for the end; raise the error of the motion."""
        self._thread.join()
        if self._fault is not None:
            raise self._fault

    def cancel(self) -> None:
        """Send no more setpoints, and ignore an error of the motion."""
        self.cancelled.set()
        if self._thread.is_alive():
            self._thread.join()

    def capture(self, sample_period: float) -> Capture:
        """Return what was recorded so far, at the host's times."""
        counts = np.array(self._counts)
        planned = np.rint(self._setpoints.planned[self._sent]).astype(np.int64)
        return Capture(
            samples=np.rint(np.array(self._times) / sample_period).astype(np.int64)
            - LEAD * INTERVAL,
            counts=counts,
            following_errors=planned - counts,
            torques=np.array(self._torques),
            sample_period=sample_period,
            start_std=self.punctuality.jitter,
        )

    @property
    def punctuality(self) -> Punctuality:
        """The timing so far."""
        times = np.array(self._times)
        late = times - np.array(self._sent) * self._setpoints.interval
        return Punctuality(
            float(np.diff(times).max(initial=0.0)),
            float(np.sqrt(np.mean(late**2))) if len(late) else 0.0,
            len(self._setpoints) - len(self._sent),
        )

    def check_punctuality(self) -> None:
        """Refuse a motion with too large a gap between setpoints."""
        found, limit = self.punctuality, LARGEST_GAP * self._setpoints.interval
        if found.largest_gap > limit * (1 + 1e-9):
            raise MotionFault(
                f"the motion had a gap of {found.largest_gap * 1e3:.3g} ms between two setpoints"
                f" and {limit * 1e3:.3g} ms are allowed ({found.jitter * 1e3:.3g} ms RMS"
                f" jitter, {found.skipped} setpoints skipped), so its speed was not the planned"
                " one; end other programs on this computer, then press again"
            )

    def _run(self) -> None:
        try:
            self._send()
        except BaseException as error:  # noqa: BLE001 - `wait` raises it
            self._fault = error
            self._axes.send_abort()  # `wait` leads to an abort, which reads back

    def _send(self) -> None:
        axes, interval, last = self._axes, self._setpoints.interval, len(self._setpoints) - 1
        start, index = axes.polling.clock(), 0
        while index <= last and not self.cancelled.is_set():
            now = axes.polling.clock() - start
            index = max(index, min(int(now / interval), last))  # what is due, if it is late
            counts, torques = axes.observe(*self._commands[index])
            self._sent.append(index)
            self._times.append(now)
            self._counts.append(counts)
            self._torques.append(torques)
            self._check_followed(index)
            index += 1
            if (ahead := start + index * interval - axes.polling.clock()) > 0:
                axes.polling.sleep(ahead)
        if not self.cancelled.is_set():
            axes.hold()

    def _check_followed(self, index: int) -> None:
        away = np.abs(self._counts[-1] - self._setpoints.planned[index])
        if (away > self._error_limit).any():
            joint = int(away.argmax())
            raise MotionFault(
                f"joint {joint + 1} is {away[joint]:.0f} counts from its plan, more than"
                f" controller.position_error_limit, {self._error_limit} counts; remove what is"
                " in its way, then home() again"
            )
