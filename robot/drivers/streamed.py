"""Base of drivers whose controllers store no motion, so that the host streams its setpoints."""

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Generic, TypeVar

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.robot.controller import Capture
from sautereau.robot.drivers.driver import POLL, Clock, Driver, Polling, Sleep
from sautereau.robot.drivers.limits import Limits
from sautereau.robot.drivers.serial_port import Wire
from sautereau.robot.errors import MotionFault, NotReady
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Counts, Segments


@dataclass(frozen=True)
class Punctuality:
    """Timing of the setpoints of one motion."""

    largest_gap: float
    """Longest time between two setpoints, s."""
    jitter: float
    """RMS difference of the setpoints from their due times, s."""
    skipped: int
    """Setpoints that were not sent because the next one was due."""
    exchange: float
    """Median time in which a setpoint is sent and answered, s."""


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
        self._took: list[float] = []
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
            float(np.median(self._took)) if self._took else 0.0,
        )

    def check_punctuality(self) -> None:
        """Refuse a motion with too large a gap between setpoints."""
        found, limit = self.punctuality, 3.0 * self._setpoints.interval
        if found.largest_gap > limit * (1 + 1e-9):
            fix = "end other programs on this computer, then press again"
            if found.exchange > self._setpoints.interval:
                fix = (
                    f"sending one takes {found.exchange * 1e3:.3g} ms, longer than the"
                    f" {self._setpoints.interval * 1e3:.3g} ms between them: set the latency timer"
                    " of the USB adapter to 1 ms, see `sautereau doctor`, or raise"
                    " controller.baud_rate, then press again"
                )
            raise MotionFault(
                f"the motion had a gap of {found.largest_gap * 1e3:.3g} ms between two setpoints"
                f" and {limit * 1e3:.3g} ms are allowed ({found.jitter * 1e3:.3g} ms RMS"
                f" jitter, {found.skipped} setpoints skipped), so its speed was not the planned"
                f" one; {fix}"
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
            self._took.append(polling.clock() - start - now)
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


RowsT = TypeVar("RowsT", bound=Rows)


class StreamedDriver(Driver, ABC, Generic[RowsT]):
    """A `Driver` for a controller to which the host streams setpoints.

    A derived class implements `plan`, which sets ``_planned``.

    Args:
        supply: Name of the power supply of the motors, for messages.
    """

    stepped = False
    """Whether the controller is a stand-in whose time waits for the host."""
    stream: Stream | None = None
    """The last motion that was started."""
    _planned: tuple[Segments, RowsT]

    def __init__(self, rig: Rig, clock: Clock, sleep: Sleep, wire: Wire, supply: str):
        self._rig, self._settings, self._wire = rig, rig.controller, wire
        self.limits = Limits(rig.arm)
        # A command may take up to 1 ms to take effect.
        self.polling = Polling(clock, sleep, supply, delay=POLL)

    @abstractmethod
    def introduce(self) -> str:
        """Identify the controller, and refuse another one; return its identity."""

    @abstractmethod
    def set_up_axes(self) -> None:
        """Switch off, set limits and watchdog, and verify all of them."""

    @abstractmethod
    def pass_time(self, seconds: float) -> None:
        """Advance the time of a stand-in that waits for the host, see docs/decisions/0002."""

    @abstractmethod
    def check_running(self, what: str) -> None:
        """Refuse ``what`` where an axis has switched itself off; name its errors."""

    @abstractmethod
    def check_settings(self) -> None:
        """Refuse settings that are no longer what this driver set."""

    @abstractmethod
    def follow(self, at: Counts) -> None:
        """Let both axes follow setpoints, from the first one on (counts, shape (2,))."""

    @abstractmethod
    def send(self, rows: RowsT, index: int, /) -> tuple[Counts, Floats | None]:
        """Send a row of setpoints; return joint positions (counts) and torques (N m), (2,) each."""

    @abstractmethod
    def hold(self) -> None:
        """End the motion of both axes; they stay where they are."""

    @abstractmethod
    def switch_off(self) -> None:
        """Switch the motors off, and verify it."""

    def set_up(self) -> str:
        identity = self.introduce()
        if self.stepped:
            host = HostTime(self.pass_time, self.polling.sleep)
            self.polling.clock, self.polling.sleep = host.clock, host.sleep
        self.set_up_axes()
        return identity

    def close(self) -> None:
        self._wire.close()

    def abort(self) -> None:
        try:
            self.cancel()
        finally:
            self.switch_off()

    @property
    def punctuality(self) -> Punctuality:
        """Timing of the setpoints of the last motion."""
        return self._streamed("punctuality").punctuality

    def cancel(self) -> None:
        """Stop sending setpoints."""
        if self.stream is not None:
            self.stream.cancel()

    def check_ready(self, what: str, /) -> None:
        self.check_running(what)
        self.check_settings()

    def load(self) -> Segments:
        """Return the planned motion; nothing is sent."""
        return self._planned[0]

    def arm(self) -> None:
        """Let the axes follow setpoints."""
        self.follow(self._planned[0].start)

    def start(self) -> None:
        _, rows = self._planned
        lead, limit = self.CAPABILITIES.lead_intervals, self._settings.position_error_limit
        send = partial(self.send, rows)
        self.stream = Stream(rows, send, self.hold, self.send_abort, self.polling, lead, limit)
        self.stream.start()

    def wait(self) -> None:
        """Wait until the motion has ended, and verify that it ended as it should.

        Raises:
            MotionFault: A gap between setpoints was too large, a joint did not follow, or an
                axis switched itself off.
        """
        stream, (motion, _) = self._streamed("wait"), self._planned
        stream.wait()
        self.check_running("the press")
        stream.check_punctuality()
        self.polling.settle(self.positions, motion.end, self.limits)

    def capture(self) -> Capture:
        """Return the host's record of the last motion, at the host's times."""
        return self._streamed("capture").capture(self._settings.sample_period)

    def _streamed(self, call: str) -> Stream:
        if self.stream is None:
            raise NotReady(f"{call}: no motion was streamed; start() one first")
        return self.stream


class HostTime:
    """Simulated time of a stand-in that waits for the host, see docs/decisions/0002.

    Args:
        wait: Advances the stand-in's time by seconds.
        sleep: Sleep of the host, which may raise.
    """

    def __init__(self, wait: Callable[[float], object], sleep: Sleep):
        self._wait, self._sleep, self._now = wait, sleep, 0.0

    def clock(self) -> float:
        """Return the seconds waited so far."""
        return self._now

    def sleep(self, seconds: float) -> None:
        """Advance the stand-in's time by seconds."""
        self._sleep(0.0)
        self._wait(seconds)
        self._now += seconds
