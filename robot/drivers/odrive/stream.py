"""Setpoints sent one by one by a thread of their own, and how punctual that was."""

import threading
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from sautereau.robot.drivers.odrive.axes import OdriveAxes
from sautereau.robot.drivers.odrive.setpoints import Setpoints
from sautereau.robot.errors import MotionFault, RobotError
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Counts

LARGEST_GAP = 3.0
"""Intervals that may pass between two setpoints."""


@dataclass(frozen=True)
class Punctuality:
    """How well the host kept the time of a motion."""

    largest_gap: float
    """s, longest time between two setpoints."""
    jitter: float
    """s rms, of setpoints about the time when they were due."""
    skipped: int
    """Setpoints that were not sent, because the next one was due."""


class Stream:
    """One motion, on its way as soon as it is started.

    Where it fails the motors are told to go off at once, not only when somebody waits.

    Args:
        axes: Follow setpoints already.
        setpoints: Of the motion.
        error_limit: Counts between a joint and its plan at which the motors go off.
    """

    def __init__(self, axes: OdriveAxes, setpoints: Setpoints, error_limit: int):
        self._axes, self._setpoints, self._error_limit = axes, setpoints, error_limit
        self._commands = axes.setpoints(setpoints)
        self._sent: list[int] = []
        self._times: list[float] = []
        self._counts: list[Counts] = []
        self._torques: list[Floats] = []
        self._cancelled = threading.Event()
        self._fault: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="ODrive setpoints", daemon=True)

    def start(self) -> None:
        """Begin, and return at once."""
        self._thread.start()

    def wait(self) -> None:
        """Wait for the end; raise what went wrong meanwhile."""
        self._thread.join()
        if self._fault is not None:
            raise self._fault

    def cancel(self) -> None:
        """Send no more setpoints; what went wrong does not matter any more."""
        self._cancelled.set()
        if self._thread.is_alive():
            self._thread.join()

    @property
    def times(self) -> Floats:
        """s since the first setpoint, when each was sent; shape (n,)."""
        return np.array(self._times)

    @property
    def counts(self) -> Counts:
        """Counts, where the joints were then; shape (n, 2)."""
        return np.array(self._counts)

    @property
    def following_errors(self) -> Counts:
        """Counts, by which they were short of their plan; shape (n, 2)."""
        return np.rint(self._setpoints.planned[self._sent]).astype(np.int64) - self.counts

    @property
    def torques(self) -> Floats:
        """N m, that the joints' motors were asked for; shape (n, 2)."""
        return np.array(self._torques)

    @property
    def punctuality(self) -> Punctuality:
        """How well the time was kept so far."""
        late = self.times - np.array(self._sent) * self._setpoints.interval
        return Punctuality(
            float(np.diff(self.times).max(initial=0.0)),
            float(np.sqrt(np.mean(late**2))) if len(late) else 0.0,
            len(self._setpoints) - len(self._sent),
        )

    def check_punctuality(self) -> None:
        """Refuse a motion whose setpoints came too far apart."""
        found, limit = self.punctuality, LARGEST_GAP * self._setpoints.interval
        if found.largest_gap > limit * (1 + 1e-9):
            raise MotionFault(
                f"the motion had a gap of {found.largest_gap * 1e3:.3g} ms between two setpoints"
                f" and {limit * 1e3:.3g} ms are allowed ({found.jitter * 1e3:.3g} ms rms of"
                f" jitter, {found.skipped} setpoints skipped), so its speed was not the planned"
                " one; end other programs on this computer, then press again"
            )

    def _run(self) -> None:
        try:
            self._send()
        except BaseException as error:  # noqa: BLE001 - `wait` raises it
            self._fault = error
            with suppress(RobotError):  # `wait` leads to an abort, which reads back
                self._axes.line.say(*self._axes.off)

    def _send(self) -> None:
        axes, interval, last = self._axes, self._setpoints.interval, len(self._setpoints) - 1
        start, index = axes.clock(), 0
        while index <= last and not self._cancelled.is_set():
            edge = () if self._sent else (axes.edge(True),)
            now = axes.clock() - start
            index = max(index, min(int(now / interval), last))  # what is due, if it is late
            counts, torques = axes.observe(*edge, *self._commands[index])
            self._sent.append(index)
            self._times.append(now)
            self._counts.append(counts)
            self._torques.append(torques)
            self._check_followed(index)
            index += 1
            if (ahead := start + index * interval - axes.clock()) > 0:
                axes.sleep(ahead)
        axes.line.tell(axes.edge(False))

    def _check_followed(self, index: int) -> None:
        away = np.abs(self._counts[-1] - self._setpoints.planned[index])
        if (away > self._error_limit).any():
            joint = int(away.argmax())
            raise MotionFault(
                f"joint {joint + 1} is {away[joint]:.0f} counts off its plan, more than"
                f" controller.position_error_limit, {self._error_limit} counts; remove what is"
                " in its way, then home() again"
            )
