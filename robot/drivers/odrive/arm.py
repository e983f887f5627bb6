"""The arm behind an ODrive: what it is told to home, move and stop.

Positions are counts, speeds counts a second.
"""

from sautereau.robot.drivers.arm import Arm
from sautereau.robot.drivers.joint_axes import STOPPING
from sautereau.robot.drivers.odrive.axes import OdriveAxes
from sautereau.robot.drivers.odrive.clock import HostTime
from sautereau.robot.drivers.odrive.homing import find_switches, switches_closed
from sautereau.robot.drivers.odrive.line import OdriveLine
from sautereau.robot.drivers.odrive.stream import Stream
from sautereau.robot.errors import GarbledAnswer, RobotError
from sautereau.trajectory.segments import Counts


class OdriveArm(Arm[OdriveLine, OdriveAxes]):
    """Two joints that can be powered, homed and moved; arguments as for `ConnectedArm`.

    While `check_home` reads the switches, the motors are off.
    """

    _line = OdriveLine
    _WITHOUT_HOST = (
        "The controller's watchdogs switch them off {period:g} s after the host's last sign of"
        " life."
    )
    _stream: Stream | None = None

    def _set_up(self, line: OdriveLine) -> tuple[str, OdriveAxes]:
        line.resynchronise()
        identity = _introduced(line)
        clock, sleep = self._clock, self._sleep
        if HostTime.is_kept_by(identity):
            clock, sleep = (host := HostTime(line)).clock, host.sleep
        axes = OdriveAxes(line, self._rig, clock, sleep)
        axes.set_up()
        self._stream = None
        return identity, axes

    def _switch_on(self, axes: OdriveAxes) -> None:
        axes.switch_on()

    def _halt(self, axes: OdriveAxes) -> None:
        """Send no more setpoints, and move on to where the joints can stand."""
        if self._stream is not None:
            self._stream.cancel()
        axes.line.resynchronise()
        if axes.running:
            axes.halt(self._limits.acceleration, self._limits.speed)
            axes.await_moved("the stop", STOPPING)

    def _abort(self, axes: OdriveAxes) -> None:
        try:
            if self._stream is not None:
                self._stream.cancel()
        finally:
            axes.abort()

    def _find_home(self, axes: OdriveAxes, home: Counts) -> None:
        find_switches(axes, self._limits, home)

    def _home_levels(self, axes: OdriveAxes) -> list[float]:
        with self._guarded(axes):
            return [float(not closed) for closed in switches_closed(axes)]

    def _go(self, axes: OdriveAxes, target: Counts, speed: float) -> None:
        axes.go(target, speed, self._limits.acceleration, self._limits.tolerance)


def _introduced(line: OdriveLine) -> str:
    """Return hardware, firmware and serial number of an ODrive, and refuse other things."""
    lines = line.ask("i", 3)
    identity = ", ".join(lines)
    if not lines[0].startswith("Hardware version: 3."):
        raise GarbledAnswer(
            f"port {line.name}: an ODrive 3.x gives its hardware version, this one says"
            f" {identity[:60]!r}; correct controller.port in the rig file"
        )
    if not lines[1].startswith("Firmware version: 0.5."):
        raise RobotError(
            f"controller on {line.name}: {lines[1]!r}, and this driver knows the properties of"
            " 0.5.x; install 0.5.6"
        )
    return f"ODrive, {identity}"
