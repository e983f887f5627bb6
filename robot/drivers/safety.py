"""The arm's state, the calls that it allows, and how a powered arm is made safe after an error."""

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from types import FrameType
from typing import Self

from sautereau.robot.drivers.driver import Driver
from sautereau.robot.errors import NotReady, RobotError

_SAFE = "The arm was stopped and its motors are off: the controller confirms it."
PAUSE = 1.0  # Time in s after an interrupt in which further ones wait, while the program handles it
_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1", "SIGUSR2", "SIGALRM", "SIGXCPU")


class State(StrEnum):
    """State of the arm, as known to the host."""

    OFF = "off"
    """Motors off, confirmed by the controller."""
    STOPPED = "stopped"
    """Motors on, at a standstill; the positions are not known for certain."""
    HOMED = "homed"
    """Motors on, at a standstill, at known positions."""
    LOADED = "loaded"
    """Homed, with a motion in the controller."""
    ARMED = "armed"
    """Loaded, with capture and trigger prepared."""
    MOVING = "moving"
    """In motion."""
    FAULTED = "faulted"
    """Unknown: the controller has not confirmed that the motors are off."""


WAYS_OUT = {
    State.OFF: "the motors are off: enter powered() first",
    State.STOPPED: "the joints' positions are unknown: call home() first",
    State.HOMED: "no motion is loaded: call load() first",
    State.LOADED: "the motion is not armed: call arm() first",
    State.ARMED: "the motion has not started: call start() first",
    State.MOVING: "a motion is running: call wait() or stop() first",
    State.FAULTED: "press the emergency stop, then call disconnect() and connect()",
}
"""How to proceed after a refused call, by state."""


_STANDING = frozenset({State.HOMED, State.LOADED, State.ARMED})


_ON = _STANDING | {State.STOPPED, State.MOVING}


_CALLS: dict[str, frozenset[State]] = {
    "powered": frozenset({State.OFF}),
    "home": _STANDING | {State.STOPPED},
    "check_home": _STANDING,
    "move_to": _STANDING,
    "load": _STANDING,
    "arm": frozenset({State.LOADED, State.ARMED}),
    "start": frozenset({State.ARMED}),
    "wait": frozenset({State.MOVING}),
    "capture": _STANDING | {State.OFF, State.STOPPED},
    "stop": _ON,
}
"""States in which a call may be made."""


class States:
    """The arm's state; a refused call names it and the way out."""

    def __init__(self) -> None:
        self.now = State.OFF

    @property
    def on(self) -> bool:
        """Whether the motors are on, or may be."""
        return self.now is not State.OFF

    def require(self, call: str) -> None:
        """Refuse a call that this state does not allow.

        Raises:
            NotReady: Names the state and the way out of it.
        """
        if self.now not in _CALLS[call]:
            way = WAYS_OUT[self.now]
            if call == "powered" and self.now is not State.FAULTED:
                way = "the motors are on already: leave the first powered() block first"
            raise NotReady(f"{call}: the arm is {self.now}; {way}")

    def enter(self, state: State) -> None:
        """Change the state."""
        self.now = state

    @contextmanager
    def moving(self, to: State) -> Iterator[None]:
        """Be MOVING in the block, and in state ``to`` after it unless it fails."""
        self.now = State.MOVING
        yield
        self.now = to


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


class Interrupts:
    """A context manager that passes signals to their handlers, but delays those that follow soon.

    It acts in the main thread only, which handles signals. A signal without a handler keeps its
    default action. At the end a delayed signal is raised as `KeyboardInterrupt`, unless an error is
    being raised already. If it ends in another thread, as when that one frees a generator which was
    never closed, the handlers cannot be replaced, and pass on every signal.
    """

    def __init__(self) -> None:
        self._before: dict[int, Callable[[int, FrameType | None], object]] = {}
        self._last = -PAUSE
        self._holding = self._waited = self._ended = False

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for name in _SIGNALS:
                number = getattr(signal, name, None)
                handler = None if number is None else signal.getsignal(number)
                if number is not None and callable(handler):
                    self._before[number] = handler
                    signal.signal(number, self._handle)
        return self

    def hold(self) -> None:
        """Delay all signals from now on."""
        self._holding = True

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        self._ended = True
        if threading.current_thread() is threading.main_thread():
            for number, handler in self._before.items():
                signal.signal(number, handler)
        if self._waited and kind is None:
            raise KeyboardInterrupt

    def _handle(self, number: int, frame: FrameType | None) -> None:
        now = time.perf_counter()
        if not self._ended and (self._holding or now < self._last + PAUSE):
            self._waited = True
            return
        self._last = now
        self._before[number](number, frame)
