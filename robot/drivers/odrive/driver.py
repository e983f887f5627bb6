"""The driver of an ODrive 3.x, firmware 0.5.x: a press that the host streams.

An ODrive keeps no motion. The host sends 256 setpoints a second, and what that costs is
this: the times of a press are the host's, with milliseconds of jitter on a busy computer
(`OdriveController.punctuality` measures it, and a press with too large a gap is refused);
the trigger's edge is said in the same breath as the first setpoint, so its lag is the
line's; the encoders are read by the host, at its own time. The joints' limits and the
following error are watched by this driver alone, for the firmware has neither. If the host
dies, the joints run out (`Setpoints.run_out`), and the watchdogs switch the motors off.

The command `q` is never used: its torque limit replaces the configured one.
"""

from typing import TYPE_CHECKING

import numpy as np

from sautereau.robot.controller import Capture
from sautereau.robot.drivers.odrive.arm import OdriveArm
from sautereau.robot.drivers.odrive.setpoints import Setpoints
from sautereau.robot.drivers.odrive.stream import Punctuality, Stream
from sautereau.robot.drivers.states import State
from sautereau.robot.errors import NotReady, UnsafeRequest
from sautereau.trajectory.segments import Segments

if TYPE_CHECKING:
    from sautereau.robot.experiment.feedforward import TorqueTable


class OdriveController(OdriveArm):
    """A `MotionController` over a serial line; arguments as for `OdriveArm`."""

    _motion: Segments | None = None
    _setpoints: Setpoints | None = None
    _played: Stream | None = None

    @property
    def punctuality(self) -> Punctuality:
        """How well the host kept the time of the last motion."""
        if self._stream is None:
            raise NotReady("punctuality: no motion was streamed; start() one first")
        return self._stream.punctuality

    def load(self, segments: Segments, torque: "TorqueTable | None" = None) -> Segments:
        """Make the setpoints of a motion; return what will be sent.

        Args:
            segments: The motion.
            torque: None; the axes' filter takes no torques.
        """
        axes = self._axes("load")
        self._states.require("load")
        settings = self._settings
        self._limits.check_motion(segments, settings.segment_limit, settings.sample_period)
        setpoints = Setpoints.of(segments, settings.sample_period)
        faults = self._beyond(setpoints)
        if torque is not None:
            faults.append(
                "torques are given, and an ODrive that filters its setpoints takes none: press"
                " without, or with another controller"
            )
        if (need := axes.needed_baud_rate(setpoints)) > settings.baud_rate:
            faults.append(
                f"the setpoints need {need:.0f} bits/s and controller.baud_rate is"
                f" {settings.baud_rate}: set both ends to 921600 (an ODrive's own USB port heeds"
                " no baud rate)"
            )
        if faults:
            raise UnsafeRequest(f"load: {'; '.join(faults)}")
        self._motion, self._setpoints, self._played = segments, setpoints, None
        self._states.enter(State.LOADED)
        return segments

    def _beyond(self, setpoints: Setpoints) -> list[str]:
        """Return where a motion would leave the limits if the host died in it."""
        low, high = setpoints.run_out.min(axis=0), setpoints.run_out.max(axis=0)
        least, most = self._limits.lower, self._limits.upper
        return [
            f"joint {joint + 1} would run out to {low[joint]} to {high[joint]} counts if the host"
            f" died, outside arm limits {least[joint]} to {most[joint]}: stay further inside"
            for joint in (0, 1)
            if low[joint] < least[joint] or high[joint] > most[joint]
        ]

    @property
    def loaded_torque(self) -> "TorqueTable | None":
        """None: no torques are taken."""
        return None

    def arm(self) -> None:
        """Let the axes follow setpoints; refuse where the arm is not at the start."""
        axes = self._axes("arm")
        self._states.require("arm")
        if self._motion is None:
            raise NotReady("arm: no motion is loaded; call load() first")
        self._limits.check_at(axes.positions(), self._motion.start, "arm: the arm")
        with self._guarded(axes):
            axes.check_running("arming")
            axes.follow(self._motion.start)
        self._states.enter(State.ARMED)

    def start(self) -> None:
        """Let a thread stream the motion and return at once."""
        axes = self._axes("start")
        self._states.require("start")
        if self._setpoints is None:
            raise NotReady("start: no motion is loaded; call load() first")
        self._stream = Stream(axes, self._setpoints, self._settings.position_error_limit)
        self._states.enter(State.MOVING)
        self._stream.start()

    def wait(self) -> None:
        """Wait until the motion has ended, and verify that it ended as it should.

        Raises:
            MotionFault: Setpoints came too far apart, a joint did not follow, or an axis
                switched itself off.
        """
        axes = self._axes("wait")
        self._states.require("wait")
        stream, motion = self._stream, self._motion
        if stream is None or motion is None:
            raise NotReady("wait: no motion was started; call load(), arm() and start() first")
        with self._guarded(axes):
            stream.wait()
            axes.check_running("the press")
            stream.check_punctuality()
            axes.settle(motion.end, self._limits.tolerance)
        self._motion, self._setpoints, self._played = None, None, stream
        self._states.enter(State.HOMED)

    def capture(self) -> Capture:
        """Return what the host recorded of the last whole motion, at the host's times."""
        self._axes("capture")
        self._states.require("capture")
        if self._played is None:
            raise NotReady("capture: no motion is done; wait() for the end of one first")
        period = self._settings.sample_period
        return Capture(
            samples=np.rint(self._played.times / period).astype(np.int64),
            counts=self._played.counts,
            following_errors=self._played.following_errors,
            torques=self._played.torques,
            sample_period=period,
        )
