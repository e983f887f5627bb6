"""Send setpoints one by one from a separate thread, and measure their timing."""

import threading
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sautereau.robot.controller import Capture
from sautereau.robot.drivers.polling import Polling
from sautereau.robot.errors import MotionFault
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Counts

LARGEST_GAP = 3.0  # Largest time between two setpoints, in intervals


@dataclass(frozen=True)
class Punctuality:
    """Timing of the setpoints of one motion."""

    largest_gap: float
    """Longest time between two setpoints, s."""
    jitter: float
    """RMS difference of the setpoints from their due times, s."""
    skipped: int
    """Setpoints that were not sent because the next one was due."""


@dataclass(frozen=True)
class Rows:
    """The setpoints of a motion, one row for each interval; those of the rest before it too."""

    planned: Floats
    """Counts, planned joint positions at the start of the interval; shape (n, 2)."""
    interval: float
    """s, between two setpoints."""


class Stream:
    """The setpoints of one motion.

    If sending fails, the command to switch off is sent immediately, before anything waits.

    Args:
        setpoints: Setpoints of the motion; the axes follow setpoints already.
        send: Sends a row; returns joint positions (counts) and torques (N m), shape (2,) each.
        hold: Ends the motion of both axes; they stay where they are.
        send_abort: Sends the command to switch off, and never fails.
        lead: Number of rows before the motion, in which the arm rests.
        error_limit: Difference of a joint from its plan, in counts, at which the motors go off.
    """

    def __init__(
        self,
        setpoints: Rows,
        send: Callable[[int], tuple[Counts, Floats | None]],
        hold: Callable[[], None],
        send_abort: Callable[[], None],
        polling: Polling,
        lead: int,
        error_limit: int,
    ):
        self._send_row = send
        self._hold, self._send_abort, self._polling = hold, send_abort, polling
        self._setpoints, self._error_limit = setpoints, error_limit
        self._lead = lead * setpoints.interval
        self._sent: list[int] = []
        self._times: list[float] = []
        self._counts: list[Counts] = []
        self._torques: list[Floats | None] = []
        self.cancelled = threading.Event()
        """Set by `cancel`."""
        self._fault: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="setpoints", daemon=True)

    def start(self) -> None:
        """Start, and return immediately."""
        self._thread.start()

    def wait(self) -> None:
        """Wait for the end; raise the error of the motion."""
        self._thread.join()
        if self._fault is not None:
            raise self._fault

    def cancel(self) -> None:
        """Stop sending setpoints, and ignore an error of the motion."""
        self.cancelled.set()
        if self._thread.is_alive():
            self._thread.join()

    def capture(self, sample_period: float) -> Capture:
        """Return the record so far, at the host's times."""
        counts, known = np.array(self._counts), self._torques
        planned = np.rint(self._setpoints.planned[self._sent]).astype(np.int64)
        return Capture(
            samples=np.rint((np.array(self._times) - self._lead) / sample_period).astype(np.int64),
            counts=counts,
            following_errors=planned - counts,
            torques=None if any(each is None for each in known) else np.array(known),
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
            len(self._setpoints.planned) - len(self._sent),
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
            self._send_abort()  # `wait` leads to an abort, which reads back

    def _send(self) -> None:
        polling, setpoints = self._polling, self._setpoints
        interval, last = setpoints.interval, len(setpoints.planned) - 1
        start, index = polling.clock(), 0
        while index <= last and not self.cancelled.is_set():
            now = polling.clock() - start
            index = max(index, min(int(now / interval), last))  # what is due, if it is late
            counts, torques = self._send_row(index)
            self._sent.append(index)
            self._times.append(now)
            self._counts.append(counts)
            self._torques.append(torques)
            self._check_followed(index)
            index += 1
            if (ahead := start + index * interval - polling.clock()) > 0:
                polling.sleep(ahead)
        if not self.cancelled.is_set():
            self._hold()

    def _check_followed(self, index: int) -> None:
        away = np.abs(self._counts[-1] - self._setpoints.planned[index])
        if (away > self._error_limit).any():
            joint = int(away.argmax())
            raise MotionFault(
                f"joint {joint + 1} is {away[joint]:.0f} counts from its plan, more than"
                f" controller.position_error_limit, {self._error_limit} counts; remove what is"
                " in its way, then home() again"
            )
