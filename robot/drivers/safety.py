"""Make a powered arm safe after an error or a request, and report what the controller confirms."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from sautereau.robot.drivers.driver import Driver
from sautereau.robot.drivers.states import State, States
from sautereau.robot.errors import RobotError

_SAFE = "The arm was stopped and its motors are off: the controller confirms it."


class Safety:
    """Switches the motors off, and adds the outcome to the error that led to it.

    Args:
        states: States of the arm.
        watchdog_period: Period of the watchdog, s, for messages.
    """

    def __init__(self, states: States, watchdog_period: float):
        self._states, self._period = states, watchdog_period

    @contextmanager
    def guarded(self, driver: Driver, call: str = "") -> Iterator[None]:
        """Abort a motion that fails, and report the outcome in the error.

        Args:
            call: Method that is guarded for some drivers only; empty for every driver.
        """
        try:
            yield
        except RobotError as error:
            if not call or call in driver.ABORT_AFTER:
                self._after(error, driver, lambda: self.abort(driver))
            raise

    def abort(self, driver: Driver) -> None:
        """Switch off at once, and report a controller that does not confirm it."""
        self._confirm(driver, driver.abort)

    def switch_off(self, driver: Driver, error: BaseException | None = None) -> None:
        """Stop with deceleration where possible, then abort.

        Args:
            error: Error that is being raised. The outcome is added to it, and nothing is raised.
        """

        def off() -> None:
            try:
                driver.halt()
            except RobotError:  # abort reports the outcome
                pass
            finally:
                driver.abort()

        def confirmed() -> None:
            try:
                self._confirm(driver, off)
            except KeyboardInterrupt:  # a second Ctrl-C must not leave the motors on
                self._confirm(driver, off)
                raise

        if error is None:
            confirmed()
        else:
            self._after(error, driver, confirmed)

    def _confirm(self, driver: Driver, switch_off: Callable[[], None]) -> None:
        self._states.enter(State.FAULTED)
        try:
            switch_off()
        except RobotError as error:
            error.aftermath = self._not_safe(driver, "see above")
            raise
        self._states.enter(State.OFF)

    def _after(self, error: BaseException, driver: Driver, switch_off: Callable[[], None]) -> None:
        """Switch off, and add the outcome to an error that is being raised."""
        try:
            switch_off()
            outcome = _SAFE
        except RobotError as fault:
            outcome = self._not_safe(driver, fault.args[0])
        if isinstance(error, RobotError):
            error.aftermath = outcome
        else:
            error.add_note(outcome)

    def _not_safe(self, driver: Driver, reason: str) -> str:
        meanwhile = driver.WITHOUT_HOST.format(period=self._period)
        return f"The motors are NOT confirmed off ({reason}): press the emergency stop. {meanwhile}"
