"""The power of the two motors behind an ODrive: states of the axes, errors, on and off.

Names are those of firmware 0.5.x (confirm them with `odrivetool` for another version).
"""

import math
from collections.abc import Callable
from contextlib import suppress

from sautereau.rig.schema import Controller
from sautereau.robot.drivers.joint_axes import POLL, JointAxes
from sautereau.robot.drivers.odrive.errors import check_errors
from sautereau.robot.drivers.odrive.line import LineRefused, OdriveLine
from sautereau.robot.drivers.odrive.settings import AXES
from sautereau.robot.errors import GarbledAnswer, MotionFault, RobotError, SettingNotTaken

IDLE, CLOSED_LOOP = 1, 8
"""States of an axis."""
SWITCHING = 0.5
"""s that an axis may take to change its state."""


class OdrivePower(JointAxes[OdriveLine]):
    """Axes 0 and 1, on and off.

    Args:
        line: To the controller.
        settings: The rig's.
        clock: Seconds, of any origin.
        sleep: Wait for seconds.
    """

    _SUPPLY = "motors' supply"

    def __init__(
        self,
        line: OdriveLine,
        settings: Controller,
        clock: Callable[[], float],
        sleep: Callable[[float], None],
    ):
        super().__init__(line, clock, sleep)
        self._settings = settings
        self._trigger = f"gpio{settings.trigger_output}.state"

    def edge(self, level: bool) -> str:
        """Return the command that sets the output wired to the acquisition's trigger."""
        return f"w {self._trigger} {int(level)}"

    def renew(self, _patient: Callable[[], bool] | None = None, /) -> None:
        """Tell both watchdogs that the host lives."""
        self.line.say("u 0", "u 1")

    def await_(self, ended: Callable[[], bool], what: str, patience: float) -> None:
        """Poll until ``ended``, ``patience`` seconds at most; ``what`` names the motion."""
        self.sleep(POLL)  # the axes take up to 1 ms to begin
        super().await_(ended, what, patience)

    @property
    def running(self) -> bool:
        """Whether both axes hold their position."""
        return self.states() == [CLOSED_LOOP, CLOSED_LOOP]

    def states(self) -> list[int]:
        """Read the state of both axes."""
        return [int(self.line.read(f"{name}.current_state")) for name in AXES]

    def check_running(self, what: str) -> None:
        """Refuse to go on with ``what`` where an axis has switched itself off, and say why."""
        states = self.states()
        if states != [CLOSED_LOOP, CLOSED_LOOP]:
            check_errors(self.line, what)
            raise MotionFault(
                f"{what} broke off: the axes are in states {states[0]} and {states[1]}, not in"
                f" closed loop ({CLOSED_LOOP}), and tell no error; check the motors' supply,"
                " then home() again"
            )

    def switch_on(self) -> None:
        """Verify the watchdogs, switch the motors on where they stand, and verify that."""
        line, period = self.line, self._settings.watchdog_period
        guards = {f"{name}.config.enable_watchdog": 1.0 for name in AXES}
        guards |= {f"{name}.config.watchdog_timeout": period for name in AXES}
        line.refuse(
            [
                f"{name} is {value:g} and should be {wanted:g}"
                for name, wanted in guards.items()
                if not math.isclose(value := line.read(name), wanted, abs_tol=2e-6)
            ]
        )
        self.renew()
        line.tell("sc")  # a watchdog that ran out with the motors off counts as an error
        check_errors(self.line, "switching on")
        self.request(CLOSED_LOOP)
        try:
            self.await_(lambda: self.running, "switching on", SWITCHING)
        except MotionFault as error:
            check_errors(self.line, "switching on")
            raise SettingNotTaken(
                "the controller accepted closed loop and its motors are still off; check that"
                " they are calibrated, the emergency stop and the supply"
            ) from error

    def request(self, state: int) -> None:
        """Request a state of both axes."""
        self.line.tell(*(f"w {name}.requested_state {state}" for name in AXES))

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

    def shout(self) -> None:
        """Say once more what `abort` says to a controller that does not answer."""
        with suppress(RobotError):  # that it was not confirmed has been said
            self.line.say(*self.off)

    def _off_and_read_back(self) -> float:
        """Switch off, wait for the idle state of both axes, and return the trigger's level."""
        self.line.resynchronise()
        self.line.say(*self.off)
        deadline = self.clock() + SWITCHING
        while (states := self._states_heard()) != [IDLE, IDLE]:
            if self.clock() > deadline:
                raise MotionFault(
                    f"the axes are in states {states[0]} and {states[1]} after {SWITCHING:g} s,"
                    f" not off ({IDLE})"
                )
            self.sleep(POLL)
        return self._trigger_level()

    def _trigger_level(self) -> float:
        try:
            return self.line.read(self._trigger)
        except LineRefused as error:
            raise SettingNotTaken(
                f"controller on {self.line.name} has no {self._trigger}, by which the trigger's"
                " edge is made: stock firmware sets no pin, so build one that has this property,"
                " or use another controller"
            ) from error

    def _states_heard(self) -> list[int]:
        """Read the states; what a refused `w` has said before them is no answer."""
        try:
            return self.states()
        except (GarbledAnswer, LineRefused):
            self.line.resynchronise()
            return self.states()
