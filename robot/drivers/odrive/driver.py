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

The home switches are the axes' min endstops, closed at home and below. If an enabled switch closes
while its motor is on, the firmware reports an error. They are therefore enabled only to be found or
read.

The command `q` is never used: its torque limit replaces the configured one.
"""

import math
from functools import partial

import numpy as np

from sautereau.rig.capabilities import Capabilities, HomingKind
from sautereau.robot.controller import TorqueTable
from sautereau.robot.drivers.driver import MARGIN, STOPPING
from sautereau.robot.drivers.odrive.axes import AXES, IDLE, SWITCHING, Axes
from sautereau.robot.drivers.odrive.setpoints import INTERVAL, LEAD, Setpoints
from sautereau.robot.drivers.powered_arm import PoweredArm
from sautereau.robot.errors import GarbledAnswer, MotionFault, RobotError, UnsafeRequest
from sautereau.trajectory.segments import Counts, Segments

FIRMWARE = "0.5.6"
_HOMING = 11  # state of an axis
_BACK_OFF = 0.02  # rad, off a home switch
_SPEEDS = (0.2, 0.05)  # rad/s, to find the switches and to find them exactly
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

        def identify() -> list[str]:
            lines = line.resynchronise()
            if not all(lines) or not lines[0].startswith("Hardware version: 3."):
                raise GarbledAnswer(
                    f"port {line.name}: an ODrive 3.x gives its hardware version, this one answers"
                    f" {', '.join(lines)[:60]!r}; correct controller.port in the rig file"
                )
            return lines

        lines = line.reading(identify)
        identity = ", ".join(lines)
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
        """Find both home switches, then slowly find them exactly, and move there.

        The motors' turns are 0 there. The joints move one after the other. A joint's motor is off
        for a moment after it has found its switch.
        """
        fast, slow = map(self.limits.in_counts, _SPEEDS)
        off = self.limits.in_counts(_BACK_OFF)
        for joint in (1, 2):
            self._find_switch(joint, fast)
        self.go(self.positions() + np.array([off, off]), fast)
        for joint in (1, 2):
            self._find_switch(joint, slow)
        self.go(home, fast)

    def home_levels(self) -> list[float]:
        for joint in (1, 2):
            self._enable_switch(joint, True)
        levels = [float(not self._closed(joint)) for joint in (1, 2)]
        for joint in (1, 2):
            self._enable_switch(joint, False)
        self.switch_on()
        return levels

    def _find_switch(self, joint: int, speed: float) -> None:
        """Move joint 1 or 2 to its home switch, from above; counts per second."""
        line, name = self.line, AXES[joint - 1]
        self._enable_switch(joint, True)
        self.switch_on()
        self._open_switch(joint)
        turns = speed / float(self.per_turn[joint - 1])
        line.set({f"{name}.controller.config.homing_speed": turns})
        line.confirmed(f"w {name}.requested_state {_HOMING}")
        limit = 2 * math.pi * self.limits.in_counts(1.0) / speed + MARGIN
        self.polling.until(lambda: line.read(f"{name}.current_state") != _HOMING, "homing", limit)
        self.check_errors("homing")
        if not line.read(f"{name}.is_homed"):
            raise MotionFault(
                f"homing: joint {joint} stopped before its home switch; check that the arm moves"
                " freely and the switch, then home() again"
            )
        self._enable_switch(joint, False)
        self.switch_on()

    def _open_switch(self, joint: int) -> None:
        """Move joint 1 or 2 up until it is above its home switch."""
        up = self.limits.in_counts(_BACK_OFF) * (np.array([1, 2]) == joint)
        speed, moved = self.limits.in_counts(_SPEEDS[0]), 0.0
        while self._closed(joint):
            if moved > 0.5:  # rad below its home switch
                raise MotionFault(
                    f"homing: the home switch of joint {joint} is still closed after {moved:.3g}"
                    " rad; check it and its wiring, or move the arm by hand"
                )
            self.go(self.positions() + up, speed)
            moved += _BACK_OFF

    def _enable_switch(self, joint: int, enabled: bool) -> None:
        """Switch joint 1 or 2 off, and enable or disable its home switch."""
        line, name = self.line, AXES[joint - 1]
        line.confirmed(f"w {name}.requested_state {IDLE}")
        self.polling.until(
            lambda: line.read(f"{name}.current_state") == IDLE, "switching off", SWITCHING
        )
        line.set({f"{name}.min_endstop.config.enabled": int(enabled)})
        self.polling.sleep(0.01)  # s, until the switch has been read, debounced

    def _closed(self, joint: int) -> bool:
        return self.line.read(f"{AXES[joint - 1]}.min_endstop.endstop_state") != 0

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
