"""An arm's connection and power: whatever happens in between, its motors end off.

What differs between controllers is in the hooks of `ConnectedArm`.
"""

import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import ClassVar, Generic, Self, TypeVar

from sautereau.rig.schema import Rig
from sautereau.robot.drivers.joint_axes import JointAxes
from sautereau.robot.drivers.keep_alive import Renewing
from sautereau.robot.drivers.limits import Limits
from sautereau.robot.drivers.serial_port import Port, open_port
from sautereau.robot.drivers.states import State, States
from sautereau.robot.drivers.wire import Wire
from sautereau.robot.errors import NotReady, RobotError
from sautereau.trajectory.segments import Counts

_SAFE = "The arm was stopped and its motors are off: the controller confirms it."

Renewal = Callable[[Callable[[Callable[[], bool]], None], float], AbstractContextManager[object]]
"""Makes what gives the watchdog its signs of life; called as `Renewing` is."""
WireT = TypeVar("WireT", bound=Wire)
AxesT = TypeVar("AxesT", bound=JointAxes[Wire])


class ConnectedArm(ABC, Generic[WireT, AxesT]):
    """Two joints that can be powered and stopped.

    Args:
        rig: Its controller and arm are used.
        open_port: Opens the port: name, baud rate, timeout in seconds.
        clock: Seconds, of any origin.
        sleep: Wait for seconds.
        renewing: Gives the controller's watchdog signs of life while the motors are on.
    """

    _line: type[WireT]
    """Its line to the controller."""
    _WITHOUT_HOST: ClassVar[str]
    """Sentence on what the controller does without its host, for {period:g} s."""

    def __init__(
        self,
        rig: Rig,
        *,
        open_port: Callable[[str, int, float], Port] = open_port,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
        renewing: Renewal = Renewing,
    ):
        self._rig, self._arm, self._settings = rig, rig.arm, rig.controller
        self._limits = Limits(rig.arm)
        self._open_port, self._clock, self._sleep = open_port, clock, sleep
        self._renewing = renewing
        self._connection: AxesT | None = None
        self._identity = ""
        self._states = States()

    @abstractmethod
    def _set_up(self, line: WireT) -> tuple[str, AxesT]:
        """Identify the controller, switch off and set its limits; return identity and axes."""

    @abstractmethod
    def _switch_on(self, axes: AxesT) -> None:
        """Let the watchdog run, switch the motors on, and verify both."""

    @abstractmethod
    def _halt(self, axes: AxesT) -> None:
        """Decelerate to a stand, motors on."""

    def _abort(self, axes: AxesT) -> None:
        """Stop at once and switch off; raise where this is not confirmed."""
        axes.abort()

    @property
    def identity(self) -> str:
        """What the controller is, with its firmware, as it says it."""
        self._axes("identity")
        return self._identity

    @property
    def simulated(self) -> bool:
        """Whether the controller says of itself that it is a stand-in."""
        return "SIM" in self.identity

    @property
    def state(self) -> State:
        """What state the arm is in; see `sautereau.robot.drivers.states`."""
        return self._states.now

    def connect(self) -> str:
        """Open the port, switch off, set the limits, and return the identity."""
        if self._connection is not None:
            raise NotReady("connect: already connected; call disconnect() first")
        name, timeout = self._settings.port, self._settings.timeout
        line = self._line(self._open_port(name, self._settings.baud_rate, timeout), name, timeout)
        try:
            self._identity, axes = self._set_up(line)
        except BaseException:
            line.close()
            raise
        self._states.enter(State.OFF)
        self._connection = axes
        return self._identity

    def disconnect(self) -> None:
        """Switch off what is on, and close the port; never hides an earlier error."""
        axes, earlier = self._connection, sys.exception()
        if axes is None:
            return
        try:
            if self._states.now is State.FAULTED:
                axes.shout()
            elif self._states.on:
                if earlier is None:
                    self._switch_off(axes)
                else:
                    self._make_safe(earlier, lambda: self._switch_off(axes))
        finally:
            self._connection = None
            self._states.enter(State.OFF)
            axes.line.close()

    def __enter__(self) -> Self:
        self.connect()
        return self

    def __exit__(self, *exception: object) -> None:
        self.disconnect()

    @contextmanager
    def powered(self) -> Iterator[Self]:
        """Switch the motors on; leaving, by whatever way, stops and switches them off."""
        axes = self._axes("powered")
        self._states.require("powered")
        self._states.enter(State.STOPPED)
        try:
            self._switch_on(axes)
            with self._renewing(axes.renew, self._settings.watchdog_period):
                yield self
        except BaseException as error:
            if self._states.on and self._states.now is not State.FAULTED:
                self._make_safe(error, lambda: self._switch_off(axes))
            raise
        else:
            if self._states.on:
                self._switch_off(axes)

    def positions(self) -> Counts:
        """Read the joint positions: counts, shape (2,)."""
        return self._axes("positions").positions()

    def stop(self) -> Counts:
        """Decelerate to a stand, motors on; return where (counts, shape (2,))."""
        axes = self._axes("stop")
        self._states.require("stop")
        with self._guarded(axes):
            self._halt(axes)
            self._states.enter(State.STOPPED)
            return axes.positions()

    def abort(self) -> None:
        """Stop at once and switch the motors off; raise where this is not confirmed."""
        axes = self._axes("abort")
        self._confirm(lambda: self._abort(axes))

    def _axes(self, caller: str) -> AxesT:
        """Return the connected axes."""
        if self._connection is None:
            raise NotReady(f"{caller}: not connected; call connect() first")
        return self._connection

    @contextmanager
    def _guarded(self, axes: AxesT) -> Iterator[None]:
        """Abort a motion that fails, and say in the error what became of it."""
        try:
            yield
        except RobotError as error:
            self._make_safe(error, lambda: self._confirm(lambda: self._abort(axes)))
            raise

    def _switch_off(self, axes: AxesT) -> None:
        """Stop with deceleration where possible, then abort."""

        def off() -> None:
            try:
                self._halt(axes)
            except RobotError:  # abort says what became of it
                pass
            finally:
                self._abort(axes)

        try:
            self._confirm(off)
        except KeyboardInterrupt:  # impatience must not leave the motors on
            self._confirm(off)
            raise

    def _confirm(self, switch_off: Callable[[], None]) -> None:
        """Switch off, and say so where the controller does not confirm it."""
        self._states.enter(State.FAULTED)
        try:
            switch_off()
        except RobotError as error:
            error.aftermath = self._not_safe("see above")
            raise
        self._states.enter(State.OFF)

    def _make_safe(self, error: BaseException, switch_off: Callable[[], None]) -> None:
        """Switch off, and put the outcome into an error that is on its way."""
        try:
            switch_off()
            outcome = _SAFE
        except RobotError as fault:
            outcome = self._not_safe(fault.args[0])
        if isinstance(error, RobotError):
            error.aftermath = outcome
        else:
            error.add_note(outcome)

    def _not_safe(self, reason: str) -> str:
        meanwhile = self._WITHOUT_HOST.format(period=self._settings.watchdog_period)
        return f"The motors are NOT confirmed off ({reason}): press the emergency stop. {meanwhile}"
