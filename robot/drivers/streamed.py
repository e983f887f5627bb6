"""What drivers share whose controllers keep no motion, so that the host streams it."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Generic, TypeVar

from sautereau.rig.capabilities import Capabilities
from sautereau.rig.controller import Controller
from sautereau.robot.controller import Capture, TorqueTable
from sautereau.robot.drivers.limits import Limits
from sautereau.robot.drivers.polling import Polling
from sautereau.robot.drivers.stream import Punctuality, Rows, Stream
from sautereau.robot.errors import NotReady
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Counts, Segments

RowsT = TypeVar("RowsT", bound=Rows)


class StreamedDriver(Generic[RowsT]):
    """Plays and records motions: a mixin for the axes of one kind of controller.

    The axes have the methods declared below; `plan` of the driver sets ``_planned``.
    """

    CAPABILITIES: ClassVar[Capabilities]
    limits: Limits
    polling: Polling
    _settings: Controller
    _planned: tuple[Segments, RowsT] | None = None
    _loaded: tuple[Segments, RowsT] | None = None
    stream: Stream | None = None
    """The last motion that was started."""

    if TYPE_CHECKING:

        def positions(self) -> Counts: ...
        def send(self, rows: RowsT, index: int, /) -> tuple[Counts, Floats | None]: ...
        def follow(self, at: Counts) -> None:
            """Let both axes follow setpoints, from the first one on."""

        def hold(self) -> None: ...
        def send_abort(self) -> None: ...
        def check_running(self, what: str) -> None:
            """Refuse ``what`` where an axis has switched itself off; name its errors."""

    @property
    def punctuality(self) -> Punctuality:
        """Timing of the setpoints of the last motion."""
        return self._streamed("punctuality").punctuality

    def cancel(self) -> None:
        """Send no more setpoints."""
        if self.stream is not None:
            self.stream.cancel()

    def load(self) -> Segments:
        """Keep the planned motion for `start`; nothing is sent."""
        self._loaded = self._planned
        return self._motion("load")[0]

    @property
    def loaded_torque(self) -> TorqueTable | None:
        return None

    def arm(self) -> None:
        """Let the axes follow setpoints."""
        motion, _ = self._motion("arm")
        self.check_running("arming")
        self.follow(motion.start)

    def start(self) -> None:
        _, rows = self._motion("start")
        lead, limit = self.CAPABILITIES.lead_intervals, self._settings.position_error_limit
        self.stream = Stream(self, rows, partial(self.send, rows), lead, limit)
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
        """Return what the host recorded of the last motion, at the host's times."""
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
    """Simulated time of a stand-in that waits for the host, see docs/decisions/0006.

    Args:
        wait: Advances the stand-in's time by seconds.
    """

    def __init__(self, wait: Callable[[float], object]):
        self._wait, self._now = wait, 0.0

    def clock(self) -> float:
        """Return the seconds waited so far."""
        return self._now

    def sleep(self, seconds: float) -> None:
        """Advance the stand-in's time by seconds."""
        self._wait(seconds)
        self._now += seconds
