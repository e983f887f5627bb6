"""The driver of an ODrive 3.x, firmware 0.5.6: a press that the host streams.

An ODrive stores no motion: the host sends 256 setpoints per second. This has disadvantages:

- The host determines the times of a press, with milliseconds of jitter on a busy computer.
  `OdriveDriver.punctuality` measures it, and a press with too large a gap is refused.
- No property of the firmware sets a pin, so there is no trigger. The acquisition starts before the
  motion, and `sautereau.analysis.loading.alignment` finds the motion in the samples.
- The host reads the encoders, at its own times.
- Only this driver watches the joints' limits and the following error; the firmware has neither.
  If the host stops, the joints come to rest (`Setpoints.run_out`), and the watchdogs switch the
  motors off.

The command `q` is never used: its torque limit replaces the configured one.
"""

from functools import partial

from sautereau.rig.capabilities import Capabilities, HomingKind
from sautereau.robot.controller import TorqueTable
from sautereau.robot.drivers.odrive.axes import Axes
from sautereau.robot.drivers.odrive.homing import find_switches, switches_closed
from sautereau.robot.drivers.odrive.setpoints import INTERVAL, LEAD, Setpoints
from sautereau.robot.drivers.polling import STOPPING
from sautereau.robot.drivers.powered_arm import PoweredArm
from sautereau.robot.errors import GarbledAnswer, RobotError, UnsafeRequest
from sautereau.trajectory.segments import Counts, Segments

FIRMWARE = "0.5.6"
_FLAWS = {
    "0.5.1": "it has no command to clear errors (sc)",
    "0.5.2": "it corrupts answers of several lines",
    "0.5.3": "it refuses to change the state of an axis",
    "0.5.4": "homing may end before the axis has moved",
    "0.5.5": "homing may end before the axis has moved",
}
"""Why earlier versions cannot be used, by `CHANGELOG.md` of odriverobotics/ODrive."""


class OdriveDriver(Axes):
    """A `Driver` over a serial line; while `home_levels` reads the switches, the motors are off."""

    WITHOUT_HOST = (
        "The controller's watchdogs switch them off {period:g} s after the host's last sign of"
        " life."
    )
    ABORT_AFTER = frozenset({"home_levels", "arm"})
    CAPABILITIES = Capabilities(
        trigger_output=False,
        torque_feed_forward=False,  # its filter of positions takes none
        preloaded=False,
        capture_interval=INTERVAL,
        homing=HomingKind.SWITCHES,
        lead_intervals=LEAD,
    )

    def introduce(self) -> str:
        """Return hardware, firmware and serial number of an ODrive, and refuse other devices."""
        line = self.line
        lines = line.resynchronise()
        identity = ", ".join(lines)
        if not lines[0].startswith("Hardware version: 3."):
            raise GarbledAnswer(
                f"port {line.name}: an ODrive 3.x gives its hardware version, this one answers"
                f" {identity[:60]!r}; correct controller.port in the rig file"
            )
        version = lines[1].removeprefix("Firmware version: ")
        if version != FIRMWARE:
            why = _FLAWS.get(version, f"this driver knows the properties of {FIRMWARE} only")
            raise RobotError(
                f"controller on {line.name}: its firmware is {version[:20]}: {why}; install"
                f" {FIRMWARE}"
            )
        self.stepped = "SIM" in identity and "stepped" in identity
        return f"ODrive, {identity}"

    def pass_time(self, seconds: float) -> None:
        self.line.ask(f"w stand_in.wait {seconds:.9f}")

    def halt(self) -> None:
        """Stop sending setpoints, and decelerate to a standstill."""
        self.cancel()
        self.line.resynchronise()
        if self.running:
            self.start_halt()
            self.await_moved("the stop", STOPPING)

    def find_home(self, home: Counts) -> None:
        find_switches(self, home)

    def home_levels(self) -> list[float]:
        return [float(not closed) for closed in switches_closed(self)]

    def plan(self, segments: Segments, torque: TorqueTable | None) -> None:
        settings = self._settings
        setpoints = Setpoints.of(segments, settings.sample_period)
        faults = self._beyond(setpoints)
        if (need := self.needed_baud_rate(setpoints)) > settings.baud_rate:
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
        least, most = self.limits.lower, self.limits.upper
        return [
            f"joint {joint + 1} would run out to {low[joint]} to {high[joint]} counts if the host"
            f" died, outside arm limits {least[joint]} to {most[joint]}: stay further inside"
            for joint in (0, 1)
            if low[joint] < least[joint] or high[joint] > most[joint]
        ]


OdriveController = partial(PoweredArm, OdriveDriver)
"""A `MotionController` over a serial line; further arguments as for `PoweredArm`."""
