"""The driver of Dynamixel X servos on one bus: for teaching and for slow presses.

IDs 1 and 2 turn joints 1 and 2. A servo stores no motion: the host streams 128 setpoints per
second, and the servo moves linearly from each to the next. This has disadvantages:

- A count is 1/4096 of a turn, about 0.2 to 0.3 mm at the fingertip. The speed is as coarse.
- The host determines the times of a press. The analysis finds the motion in the samples.
- The servos limit their torque by their own settings, current limit and shutdown. This driver sets
  no limit; the planner assumes `arm.torque_limit`.
- If the host dies, the watchdogs stop the servos, which keep holding their position.

The encoders are absolute, so that nothing moves to find home.
"""

from functools import partial

from sautereau.rig.capabilities import Capabilities, HomingKind
from sautereau.robot.controller import TorqueTable
from sautereau.robot.drivers.dynamixel import line as table
from sautereau.robot.drivers.dynamixel.servos import INTERVAL, LEAD, Goals, Servos
from sautereau.robot.drivers.polling import STOPPING
from sautereau.robot.drivers.powered_arm import PoweredArm
from sautereau.robot.errors import NotReady, RobotError
from sautereau.trajectory.segments import Counts, Segments

MODELS = {
    1000: "XH430-W350",
    1010: "XH430-W210",
    1020: "XM430-W350",
    1030: "XM430-W210",
    1040: "XH430-V350",
    1050: "XH430-V210",
    1060: "XL430-W250",
    1070: "XC430-W150",
    1080: "XC430-W240",
    1100: "XH540-W270",
    1110: "XH540-W150",
    1120: "XM540-W270",
    1130: "XM540-W150",
    1140: "XH540-V270",
    1150: "XH540-V150",
}
"""Names of the models of 4096 counts per turn with these registers, by their number."""
OLDEST = 42
"""Firmware version that has the bus watchdog and profiles by time."""


class DynamixelDriver(Servos):
    """A `Driver` over the serial adapter of a bus."""

    WITHOUT_HOST = (
        "The servos' watchdogs stop them {period:g} s after the host's last packet; they then hold"
        " their position."
    )
    ABORT_AFTER = frozenset({"arm"})
    CAPABILITIES = Capabilities(
        trigger_output=False,
        torque_feed_forward=False,
        preloaded=False,
        capture_interval=INTERVAL,
        homing=HomingKind.ABSOLUTE,
        lead_intervals=LEAD,
    )

    def pass_time(self, seconds: float) -> None:
        self.line.write_one(1, table.WAIT, round(seconds * 1e6))

    def introduce(self) -> str:
        """Return models and firmware of both servos, and refuse others."""
        models, versions, information = (
            self.line.read(item)
            for item in (table.MODEL_NUMBER, table.FIRMWARE_VERSION, table.MODEL_INFORMATION)
        )
        faults = [
            f"servo {servo} is a model {model} with firmware {version}"
            for servo, model, version in zip(table.SERVOS, models, versions, strict=True)
            if int(model) not in MODELS or version < OLDEST
        ]
        if faults:
            raise RobotError(
                f"controller on {self.line.name}: {'; '.join(faults)}; this driver is for models"
                f" {', '.join(sorted(MODELS.values()))} with firmware {OLDEST} or newer"
            )
        named = (
            f"servo {servo}: {MODELS[int(model)]}, firmware {version}"
            for servo, model, version in zip(table.SERVOS, models, versions, strict=True)
        )
        mark = int(information[0]).to_bytes(4, "little")
        self.stepped = mark == b"SIMs"
        simulated = ", SIM sautereau stand-in" if mark.startswith(b"SIM") else ""
        return f"Dynamixel, {', '.join(named)}{simulated}"

    def halt(self) -> None:
        """Stop sending setpoints, and let the joints come to rest."""
        self.cancel()
        self.hold()
        if self.line.read(table.TORQUE_ENABLE).all():
            self.stay()
            self.await_still("the stop", STOPPING)

    def find_home(self, home: Counts) -> None:
        pass  # its encoders are absolute

    def home_levels(self) -> list[float]:
        raise NotReady("home_levels: absolute encoders have no home switches")

    def plan(self, segments: Segments, torque: TorqueTable | None) -> None:
        self._planned = segments, Goals.of(segments, self._settings.sample_period)


DynamixelController = partial(PoweredArm, DynamixelDriver)
"""A `MotionController` over a serial port; further arguments as for `PoweredArm`."""
