"""One connection to a Galil controller: identity, settings and program; everything off."""

import logging

from sautereau.rig.capabilities import GalilModel, families
from sautereau.rig.schema import Rig
from sautereau.robot.drivers.driver import Clock, Polling, Sleep
from sautereau.robot.drivers.galil.dmc import (
    BOTH,
    PRESS,
    TORQUES,
    controller_program,
    signature,
)
from sautereau.robot.drivers.galil.line import Line
from sautereau.robot.drivers.galil.settings import ControllerSettings
from sautereau.robot.drivers.keep_alive import first_wait
from sautereau.robot.drivers.limits import Limits
from sautereau.robot.drivers.serial_port import TCP, Port
from sautereau.robot.errors import (
    CommandRefused,
    GarbledAnswer,
    MotionFault,
    RobotError,
    SettingNotTaken,
)

_STATE = ("_MOA", "_MOB", "_BGA", "_BGB", "_OFA", "_OFB")
_SAFE = [1, 1, 0, 0, 0, 0]
_NEEDED = {"PV": "PVT mode", "TL": "limit of its torque", "OA": "check of its encoders"}
"""Commands without which the driver cannot press safely, by their letters."""
_LOG = logging.getLogger(__name__)


def _lacks(model: GalilModel) -> list[str]:
    """Return what a model lacks for this driver."""
    lacks = [f"has no {what} ({code})" for code, what in _NEEDED.items() if code in model.absent]
    return lacks + ["has one axis, and the arm two joints"] * (model.axes < 2)


class Connection:
    """A controller with axes A and B; arguments as for `Driver`."""

    def __init__(self, rig: Rig, port: Port, clock: Clock, sleep: Sleep):
        settings = rig.controller
        self.rig, self._settings = rig, settings
        self.limits = Limits(rig.arm)
        self.line = Line(port, settings.port, settings.timeout, first_wait(settings))
        self._serial = not settings.port.startswith(TCP)
        if self._serial:  # a renewal of the watchdog must not wait long behind an upload
            characters = settings.baud_rate / 10 * first_wait(settings)  # 10 bits each
            self.line.piece = max(2, int(characters / 16))  # 16 for an array's element
        self._polling = Polling(clock, sleep, "amplifiers")
        self.settings = ControllerSettings(self.line, rig)
        self._sign = signature(settings.trigger_output)
        trigger_off = f"CB {settings.trigger_output}"
        # Ends everything that the program does except its watchdog.
        self._quiet = (f"HX {PRESS}", f"HX {TORQUES}", f"HX {BOTH}", "OF 0,0", "RC 0", trigger_off)
        self._abort_commands = ("AB", "MO AB", ";".join(self._quiet))
        self._watched = False
        """Whether the watchdog was started, and nothing was sent since that ends it."""
        self.model: GalilModel | None = None
        """Axes and commands of the controller; None before `introduce`, or if it is unknown."""
        self.identity = ""
        """Model and firmware, as the controller reports them."""

    def close(self) -> None:
        self.line.close()

    def set_up(self) -> str:
        self.identity = self.introduce()
        self.abort()
        self.settings.read_memory(self.model.absent if self.model else frozenset())
        self.settings.set()
        self.download()
        return self.identity

    def download(self) -> None:
        """Replace the program in the controller by the driver's own."""
        self.line.download(controller_program(self._settings.trigger_output))

    def introduce(self) -> str:
        """Identify the controller, switch its echo on where it has one, and mark its messages.

        Returns:
            Model and firmware, as the controller reports them.

        Raises:
            RobotError: It is no Galil controller with PVT mode and two axes, or a serial port has
                no echo.
        """
        line = self.line
        line.resynchronise()
        first = "EO 0" if self._serial else "CW 1"
        try:
            line.ask(first)
        except CommandRefused:  # the rest of a line that another host broke off
            line.ask(first)
        identity = line.reading(self._identify)
        self.model = GalilModel.of(identity)
        if self.model is None:
            _LOG.warning(
                "controller on %s: %s is no model that this driver knows; it is taken for one with"
                " two axes and all commands",
                line.name,
                identity,
            )
        elif lacks := _lacks(self.model):
            raise RobotError(
                f"controller on {line.name}: {identity} {' and '.join(lacks)}; use a"
                f" {', '.join(families(frozenset(_NEEDED)))} with two axes or more, and firmware"
                " without -FAST in its name"
            )
        if self._serial:
            self._switch_echo_on(identity)
        line.ask("CF I", "CW 1")
        return identity

    def _identify(self) -> str:
        """Return model and firmware, and refuse another device."""
        identity = " ".join(self.line.ask("\x12\x16").split())
        if "DMC" not in identity:
            raise GarbledAnswer(
                f"port {self.line.name}: a Galil controller gives its revision as DMC..., this one"
                f" answers {identity[:40]!r}; correct controller.port in the rig file"
            )
        return identity

    def _switch_echo_on(self, identity: str) -> None:
        line = self.line
        line.ask("EO 1")
        line.echo = True
        try:
            line.verify({"_EO": 1})
        except GarbledAnswer as error:
            raise SettingNotTaken(
                f"controller on {line.name}: {identity} does not echo what it receives, so that a"
                f" command corrupted on the line would be executed ({error}); connect it by another"
                ' serial port, or by Ethernet: controller.port = "tcp://host:23"'
            ) from error

    @property
    def record(self) -> str:
        """The controller as a rig file names it: model, firmware and serial number."""
        return f"{self.identity}, serial number {self.settings.serial_number}"

    def abort(self) -> None:
        """Stop at once, switch motors and trigger off, and verify by reading back.

        Raises:
            RobotError: The controller did not confirm that the motors are off.
        """
        self._watched = False
        state: list[float] = []
        for _ in range(2):  # what was sent before may have spoilt the first
            try:
                state = self.line.send_unchecked(self._abort_commands, *_STATE)
            except GarbledAnswer:
                state = self.line.send_unchecked((), *_STATE)
            if state == _SAFE:
                return
        raise MotionFault(
            f"the controller reads {','.join(_STATE)} = {state}, not motors off and at rest"
        )

    def send_abort(self) -> None:
        """Send what `abort` sends, unacknowledged."""
        self._watched = False
        self.line.send_unacknowledged(*self._abort_commands)
