"""The driver of an ODrive 3.x, firmware 0.5.x: a press that the host streams.

An ODrive keeps no motion: the host sends 256 setpoints per second. This has a price:

- The times of a press are the host's, with milliseconds of jitter on a busy computer.
  `OdriveDriver.punctuality` measures it, and a press with too large a gap is refused.
- The trigger's edge is sent in the same write as the first setpoint, and lags as the line does.
- The host reads the encoders, at its own times.
- Only this driver watches the joints' limits and the following error; the firmware has neither.
  If the host dies, the joints run out (`Setpoints.run_out`), and the watchdogs switch the
  motors off.

The command `q` is never used: its torque limit replaces the configured one.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.robot.controller import Capture, TorqueTable
from sautereau.robot.drivers.driver import Clock, Sleep
from sautereau.robot.drivers.limits import Limits
from sautereau.robot.drivers.odrive.axes import Axes
from sautereau.robot.drivers.odrive.clock import HostTime
from sautereau.robot.drivers.odrive.homing import find_switches, switches_closed
from sautereau.robot.drivers.odrive.line import OdriveLine
from sautereau.robot.drivers.odrive.setpoints import Setpoints
from sautereau.robot.drivers.odrive.stream import Punctuality, Stream
from sautereau.robot.drivers.polling import POLL, STOPPING, Polling
from sautereau.robot.drivers.powered_arm import PoweredArm
from sautereau.robot.drivers.serial_port import Port
from sautereau.robot.errors import GarbledAnswer, NotReady, RobotError, UnsafeRequest
from sautereau.trajectory.segments import Counts, Segments


class OdriveDriver:
    """A `Driver` over a serial line; while `home_levels` reads the switches, the motors are off."""

    WITHOUT_HOST = (
        "The controller's watchdogs switch them off {period:g} s after the host's last sign of"
        " life."
    )
    ABORT_AFTER = frozenset({"home_levels", "arm"})

    def __init__(self, rig: Rig, port: Port, clock: Clock, sleep: Sleep):
        self._settings = rig.controller
        self._limits = Limits(rig.arm)
        self.line = OdriveLine(port, rig.controller.port, rig.controller.timeout)
        # The axes take up to 1 ms to start.
        self.polling = Polling(clock, sleep, "motors' supply", delay=POLL)
        self._axes = Axes(self.line, self.polling, rig)
        self._power = self._axes.power
        self._planned: tuple[Segments, Setpoints] | None = None
        self._loaded: tuple[Segments, Setpoints] | None = None
        self.stream: Stream | None = None
        """The last motion that was started."""

    @property
    def punctuality(self) -> Punctuality:
        """Timing of the setpoints of the last motion."""
        return self._streamed("punctuality").punctuality

    def set_up(self) -> str:
        self.line.resynchronise()
        identity = _introduced(self.line)
        if HostTime.is_kept_by(identity):
            host = HostTime(self.line)
            self.polling.clock, self.polling.sleep = host.clock, host.sleep
        self._axes.set_up()
        return identity

    def close(self) -> None:
        self.line.close()

    def positions(self) -> Counts:
        return self._axes.positions()

    def switch_on(self) -> None:
        self._power.switch_on()

    def renew(self, _keep_waiting: Callable[[], bool] | None = None, /) -> None:
        self._power.renew()

    def halt(self) -> None:
        """Send no more setpoints, and decelerate to a standstill."""
        if self.stream is not None:
            self.stream.cancel()
        self.line.resynchronise()
        if self._power.running:
            self._axes.halt()
            self._axes.await_moved("the stop", STOPPING)

    def abort(self) -> None:
        try:
            if self.stream is not None:
                self.stream.cancel()
        finally:
            self._power.abort()

    def send_abort(self) -> None:
        self._power.send_abort()

    def find_home(self, home: Counts) -> None:
        find_switches(self._axes, home)

    def home_levels(self) -> list[float]:
        return [float(not closed) for closed in switches_closed(self._axes)]

    def go(self, target: Counts, speed: float) -> None:
        self._axes.go(target, speed)

    def plan(self, segments: Segments, torque: TorqueTable | None) -> None:
        """Compute the setpoints of a motion; torques are refused."""
        settings = self._settings
        setpoints = Setpoints.of(segments, settings.sample_period)
        faults = self._beyond(setpoints)
        if torque is not None:
            faults.append(
                "torques are given, and an ODrive that filters its setpoints takes none: press"
                " without, or with another controller"
            )
        if (need := self._axes.needed_baud_rate(setpoints)) > settings.baud_rate:
            faults.append(
                f"the setpoints need {need:.0f} bits/s and controller.baud_rate is"
                f" {settings.baud_rate}: set both ends to 921600 (an ODrive's own USB port ignores"
                " the baud rate)"
            )
        if faults:
            raise UnsafeRequest(f"load: {'; '.join(faults)}")
        self._planned = segments, setpoints

    def _beyond(self, setpoints: Setpoints) -> list[str]:
        """Return where a motion would leave the limits if the host died during it."""
        low, high = setpoints.run_out.min(axis=0), setpoints.run_out.max(axis=0)
        least, most = self._limits.lower, self._limits.upper
        return [
            f"joint {joint + 1} would run out to {low[joint]} to {high[joint]} counts if the host"
            f" died, outside arm limits {least[joint]} to {most[joint]}: stay further inside"
            for joint in (0, 1)
            if low[joint] < least[joint] or high[joint] > most[joint]
        ]

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
        self._power.check_running("arming")
        self._axes.follow(motion.start)

    def start(self) -> None:
        _, setpoints = self._motion("start")
        self.stream = Stream(self._axes, setpoints, self._settings.position_error_limit)
        self.stream.start()

    def wait(self) -> None:
        """Wait until the motion has ended, and verify that it ended as it should.

        Raises:
            MotionFault: A gap between setpoints was too large, a joint did not follow, or an
                axis switched itself off.
        """
        stream, (motion, _) = self._streamed("wait"), self._motion("wait")
        stream.wait()
        self._power.check_running("the press")
        stream.check_punctuality()
        self.polling.settle(self.positions, motion.end, self._limits.tolerance)

    def capture(self) -> Capture:
        """Return what the host recorded of the last motion, at the host's times."""
        stream, period = self._streamed("capture"), self._settings.sample_period
        return Capture(
            samples=np.rint(stream.times / period).astype(np.int64),
            counts=stream.counts,
            following_errors=stream.following_errors,
            torques=stream.torques,
            sample_period=period,
        )

    def _motion(self, call: str) -> tuple[Segments, Setpoints]:
        if self._loaded is None:
            raise NotReady(f"{call}: no motion is loaded; call load() first")
        return self._loaded

    def _streamed(self, call: str) -> Stream:
        if self.stream is None:
            raise NotReady(f"{call}: no motion was streamed; start() one first")
        return self.stream


def _introduced(line: OdriveLine) -> str:
    """Return hardware, firmware and serial number of an ODrive, and refuse other devices."""
    lines = line.ask("i", 3)
    identity = ", ".join(lines)
    if not lines[0].startswith("Hardware version: 3."):
        raise GarbledAnswer(
            f"port {line.name}: an ODrive 3.x gives its hardware version, this one answers"
            f" {identity[:60]!r}; correct controller.port in the rig file"
        )
    if not lines[1].startswith("Firmware version: 0.5."):
        raise RobotError(
            f"controller on {line.name}: {lines[1]!r}, and this driver knows the properties of"
            " 0.5.x; install 0.5.6"
        )
    return f"ODrive, {identity}"


OdriveController = partial(PoweredArm, OdriveDriver)
"""A `MotionController` over a serial line; further arguments as for `PoweredArm`."""
