"""Base of drivers whose controllers store no motion, so that the host streams it."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from typing import Generic, TypeVar

from sautereau.rig.schema import Rig
from sautereau.robot.controller import Capture
from sautereau.robot.drivers.driver import Clock, Driver, Sleep
from sautereau.robot.drivers.limits import Limits
from sautereau.robot.drivers.polling import POLL, Polling
from sautereau.robot.drivers.serial_port import Wire
from sautereau.robot.drivers.stream import Punctuality, Rows, Stream
from sautereau.robot.errors import NotReady
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Counts, Segments

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
    _planned: tuple[Segments, RowsT] | None = None
    _loaded: tuple[Segments, RowsT] | None = None

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
        """Keep the planned motion for `start`; nothing is sent."""
        self._loaded = self._planned
        return self._motion("load")[0]

    def arm(self) -> None:
        """Let the axes follow setpoints."""
        motion, _ = self._motion("arm")
        self.follow(motion.start)

    def start(self) -> None:
        _, rows = self._motion("start")
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
        stream, (motion, _) = self._streamed("wait"), self._motion("wait")
        stream.wait()
        self.check_running("the press")
        stream.check_punctuality()
        self.polling.settle(self.positions, motion.end, self.limits.tolerance)

    def capture(self) -> Capture:
        """Return the host's record of the last motion, at the host's times."""
        return self._streamed("capture").capture(self._settings.sample_period)

    def _motion(self, call: str) -> tuple[Segments, RowsT]:
        if self._loaded is None:
            raise NotReady(f"{call}: no motion is loaded; call load() first")
        return self._loaded

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
