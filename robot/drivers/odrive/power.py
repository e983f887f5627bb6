"""The power of the two motors behind an ODrive: states of the axes, errors, on and off.

Property names are those of firmware 0.5.x (check them with `odrivetool` for another version).
"""

import math
from contextlib import suppress

from sautereau.rig.schema import Controller
from sautereau.robot.drivers.odrive.errors import check_errors
from sautereau.robot.drivers.odrive.line import LineRefused, OdriveLine
from sautereau.robot.drivers.odrive.settings import AXES
from sautereau.robot.drivers.polling import POLL, Polling
from sautereau.robot.errors import GarbledAnswer, MotionFault, RobotError, SettingNotTaken

IDLE, CLOSED_LOOP = 1, 8
"""States of an axis."""
SWITCHING = 0.5
"""s that an axis may take to change its state."""


class Power:
    """The power of axes 0 and 1.

    Args:
        line: To the controller.
        polling: Waits for it.
        settings: The rig's.
    """

    def __init__(self, line: OdriveLine, polling: Polling, settings: Controller):
        self.line, self.polling = line, polling
        self._settings = settings
        self._trigger = f"gpio{settings.trigger_output}.state"

    def edge(self, level: bool) -> str:
        """Return the command that sets the output wired to the acquisition's trigger."""
        return f"w {self._trigger} {int(level)}"

    def renew(self) -> None:
        """Give both watchdogs a sign of life."""
        self.line.say("u 0", "u 1")

    @property
    def running(self) -> bool:
        """Whether both axes hold their position."""
        return self.states() == [CLOSED_LOOP, CLOSED_LOOP]

    def states(self) -> list[int]:
        """Read the state of both axes."""
        return [int(self.line.read(f"{name}.current_state")) for name in AXES]

    def check_running(self, what: str) -> None:
        """Refuse ``what`` where an axis has switched itself off; name its errors."""
        states = self.states()
        if states != [CLOSED_LOOP, CLOSED_LOOP]:
            check_errors(self.line, what)
            raise MotionFault(
                f"{what} broke off: the axes are in states {states[0]} and {states[1]}, not in"
                f" closed loop ({CLOSED_LOOP}), and report no error; check the motors' supply,"
                " then home() again"
            )

    def switch_on(self) -> None:
        """Verify the watchdogs, switch the motors on where they are, and verify that."""
        line, period = self.line, self._settings.watchdog_period
        guards = {f"{name}.config.enable_watchdog": 1.0 for name in AXES}
        guards |= {f"{name}.config.watchdog_timeout": period for name in AXES}
        line.refuse(
            [
                f"{name} is {value:g} and should be {due:g}"
                for name, due in guards.items()
                if not math.isclose(value := line.read(name), due, abs_tol=2e-6)
            ]
        )
        self.renew()
        line.confirmed("sc")  # a watchdog that ran out with the motors off counts as an error
        check_errors(self.line, "switching on")
        self.request(CLOSED_LOOP)
        try:
            self.polling.until(lambda: self.running, "switching on", SWITCHING)
        except MotionFault as error:
            check_errors(self.line, "switching on")
            raise SettingNotTaken(
                "the controller accepted closed loop and its motors are still off; check that"
                " they are calibrated, the emergency stop and the supply"
            ) from error

    def request(self, state: int) -> None:
        """Request a state of both axes."""
        self.line.confirmed(*(f"w {name}.requested_state {state}" for name in AXES))

    @property
    def off(self) -> tuple[str, ...]:
        """The commands that switch both motors and the trigger off."""
        return (*(f"w {name}.requested_state {IDLE}" for name in AXES), self.edge(False))

    def abort(self) -> None:
        """Stop at once, switch motors and trigger off, and verify by reading back.

        Raises:
            RobotError: The controller did not confirm that the motors are off.
        """
        try:
            found = self._off_and_read_back()
        except (GarbledAnswer, MotionFault):  # a spoilt line, or a late answer to an earlier one
            found = self._off_and_read_back()
        if found:
            raise SettingNotTaken(
                f"controller on {self.line.name}: {self._trigger} is {found:g} after it was"
                " cleared; check what is wired to it"
            )

    def send_abort(self) -> None:
        """Send what `abort` sends, unacknowledged."""
        with suppress(RobotError):  # the error that it was not confirmed is raised already
            self.line.say(*self.off)

    def _off_and_read_back(self) -> float:
        """Switch off, wait for the idle state of both axes, and return the trigger's level."""
        self.line.resynchronise()
        self.line.say(*self.off)
        deadline = self.polling.clock() + SWITCHING
        while (states := self._states_read_again()) != [IDLE, IDLE]:
            if self.polling.clock() > deadline:
                raise MotionFault(
                    f"the axes are in states {states[0]} and {states[1]} after {SWITCHING:g} s,"
                    f" not off ({IDLE})"
                )
            self.polling.sleep(POLL)
        return self._trigger_level()

    def _trigger_level(self) -> float:
        try:
            return self.line.read(self._trigger)
        except LineRefused as error:
            raise SettingNotTaken(
                f"controller on {self.line.name} has no {self._trigger}, which makes the trigger's"
                " edge: stock firmware sets no pin, so build one that has this property,"
                " or use another controller"
            ) from error

    def _states_read_again(self) -> list[int]:
        """Read the states, again where a refused `w` was answered before them."""
        try:
            return self.states()
        except (GarbledAnswer, LineRefused):
            self.line.resynchronise()
            return self.states()
