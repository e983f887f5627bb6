"""A powered arm: connection, power, homing, moves and presses, for every controller alike.

Whatever happens while the motors are on, they end off. What differs between controllers is
in the `Driver` that the arm holds.
"""

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Generic, Self, TypeVar

import numpy as np

from sautereau.rig.capabilities import Capabilities, HomingKind
from sautereau.rig.schema import Rig
from sautereau.robot.controller import Capture, MotionController, TorqueTable
from sautereau.robot.drivers.driver import Clock, Driver, Sleep
from sautereau.robot.drivers.keep_alive import KeepAlive
from sautereau.robot.drivers.limits import Limits
from sautereau.robot.drivers.safety import Interrupts, Safety, State, States
from sautereau.robot.drivers.serial_port import Port, open_port
from sautereau.robot.errors import MotionFault, NotReady, UnsafeRequest
from sautereau.trajectory.segments import Counts, Segments, to_counts

MakeKeepAlive = Callable[
    [Callable[[Callable[[], bool]], None], float], AbstractContextManager[object]
]
"""Makes the context manager that renews the watchdog; it has the arguments of `KeepAlive`."""
DriverT = TypeVar("DriverT", bound=Driver)


class PoweredArm(MotionController, Generic[DriverT]):
    """A `MotionController` whose commands a `Driver` sends; see there for its methods.

    Args:
        open_port: Opens the port: name, baud rate, timeout in seconds.
        clock: Returns seconds from any origin.
        sleep: Waits for seconds.
        keep_alive: Renews the controller's watchdog while the motors are on.
    """

    def __init__(
        self,
        driver: type[DriverT],
        rig: Rig,
        *,
        open_port: Callable[[str, int, float], Port] = open_port,
        clock: Clock = time.perf_counter,
        sleep: Sleep = time.sleep,
        keep_alive: MakeKeepAlive = KeepAlive,
    ):
        self._rig, self._settings = rig, rig.controller
        self._limits = Limits(rig.arm)
        self._home = to_counts(rig.arm.home_angles, rig.arm.counts_per_revolution)
        self._make_driver, self._open_port = driver, open_port
        self._clock, self._sleep, self._keep_alive = clock, sleep, keep_alive
        self._driver: DriverT | None = None
        self._identity = ""
        self._states = States()
        self._safety = Safety(self._states, rig.controller.watchdog_period)
        self._abort_requested = threading.Event()
        self._motion: Segments
        self._played = False

    @property
    def capabilities(self) -> Capabilities:
        return self._make_driver.CAPABILITIES

    # Connection.

    @property
    def identity(self) -> str:
        self._connected("identity")
        return self._identity

    @property
    def connected(self) -> bool:
        """Whether there is a connection."""
        return self._driver is not None

    @property
    def simulated(self) -> bool:
        return "SIM" in self.identity

    @property
    def state(self) -> State:
        """State of the arm; see `sautereau.robot.drivers.safety`."""
        return self._states.now

    @property
    def driver(self) -> DriverT:
        """The driver of this connection."""
        return self._connected("driver")

    def connect(self) -> str:
        if self._driver is not None:
            raise NotReady("connect: already connected; call disconnect() first")
        settings = self._settings
        port = self._open_port(settings.port, settings.baud_rate, settings.timeout)
        driver = self._make_driver(self._rig, port, self._clock, self._wait)
        try:
            self._identity = driver.set_up()
        except BaseException as error:
            driver.close()
            _say(error, "The motors were not switched on.")
            raise
        self._states.enter(State.OFF)
        self._driver, self._played = driver, False
        return self._identity

    def disconnect(self) -> None:
        driver, earlier = self._driver, sys.exception()
        if driver is None:
            return
        try:
            if self._states.now is State.FAULTED:
                driver.send_abort()
            elif self._states.on:
                self._safety.switch_off(driver, earlier)
            elif earlier is not None:
                _say(earlier, "The motors are off.")
        finally:
            self._driver = None
            self._states.enter(State.OFF)
            driver.close()

    def __enter__(self) -> Self:
        self.connect()
        return self

    def __exit__(self, *exception: object) -> None:
        self.disconnect()

    # Power.

    @contextmanager
    def powered(self) -> Iterator[Self]:
        driver = self._ready("powered")
        with Interrupts() as interrupts:
            self._abort_requested.clear()
            self._states.enter(State.STOPPED)
            try:
                driver.switch_on()
                with self._keep_alive(driver.renew, self._settings.watchdog_period):
                    yield self
            except BaseException as error:
                interrupts.hold()
                if self._states.on and self._states.now is not State.FAULTED:
                    self._safety.switch_off(driver, error)
                raise
            else:
                interrupts.hold()
                if self._states.on:
                    self._safety.switch_off(driver)

    def positions(self) -> Counts:
        return self._connected("positions").positions()

    def stop(self) -> Counts:
        driver = self._ready("stop")
        with self._safety.guarded(driver):
            driver.halt()
            self._states.enter(State.STOPPED)
            return driver.positions()

    def abort(self) -> None:
        self._safety.abort(self._connected("abort"))

    def request_abort(self) -> None:
        self._abort_requested.set()

    # Homing and moves.

    def home(self) -> Counts:
        driver = self._ready("home")
        self._check_ready(driver, "homing")
        with self._safety.guarded(driver), self._states.moving(State.HOMED):
            driver.find_home(self._home)
        return self._home.copy()

    def check_home(self) -> None:
        driver = self._ready("check_home")
        if self.capabilities.homing is not HomingKind.SWITCHES:
            return
        tolerance = self._settings.home_tolerance
        speed = self._limits.in_counts(self._rig.arm.approach_speed)
        levels = []
        for side in (-1, 1):
            self.move_to(self._home + side * tolerance, speed)
            with self._safety.guarded(driver, "home_levels"):
                levels.append(driver.home_levels())
        slipped = [
            f"joint {joint}"
            for joint, (before, behind) in enumerate(zip(*levels, strict=True), 1)
            if (before, behind) != (0, 1)
        ]
        if slipped:
            with self._safety.guarded(driver):
                raise MotionFault(
                    f"the home switch of {' and '.join(slipped)} is not within {tolerance} counts"
                    " of where it was found (controller.home_tolerance): an encoder has slipped or"
                    " a switch has moved; distrust what was recorded since home(), check coupling"
                    " and switch, then home() again"
                )

    def move_to(self, counts: Counts, speed_counts_per_s: float) -> Counts:
        driver = self._ready("move_to")
        target = np.rint(counts).astype(np.int64)
        self._limits.check_move(target, speed_counts_per_s)
        after = State.HOMED if self._states.now is State.HOMED else State.LOADED
        self._check_ready(driver, "the move")
        with self._safety.guarded(driver), self._states.moving(after):
            driver.go(target, speed_counts_per_s)
        return target

    # A press.

    def load(self, segments: Segments, torque: TorqueTable | None = None) -> Segments:
        driver = self._ready("load")
        limit = self._settings.segment_limit if self.capabilities.preloaded else None
        self._limits.check_motion(segments, limit, self._settings.sample_period)
        if torque is not None and not self.capabilities.torque_feed_forward:
            raise UnsafeRequest("load: this controller adds no torques; press without feed-forward")
        driver.plan(segments, torque)
        self._states.enter(State.HOMED)
        self._played = False
        self._motion = driver.load()
        self._states.enter(State.LOADED)
        return self._motion

    def arm(self) -> None:
        """Prepare capture, trigger and start; refuse where the arm is not at the start.

        Its driver checks that motors, program and settings are as it left them, so that nothing
        but the acquisition should be between this call and `start`.
        """
        driver = self._ready("arm")
        self._check_ready(driver, "the motion")
        self._limits.check_at(driver.positions(), self._motion.start)
        with self._safety.guarded(driver, "arm"):
            driver.arm()
        self._states.enter(State.ARMED)

    def start(self) -> None:
        driver = self._ready("start")
        self._states.enter(State.MOVING)
        with self._safety.guarded(driver):
            driver.start()

    def wait(self) -> None:
        driver = self._ready("wait")
        with self._safety.guarded(driver):
            driver.wait()
        self._played = True
        self._states.enter(State.HOMED)

    def capture(self) -> Capture:
        driver = self._ready("capture")
        if not self._played:
            raise NotReady("capture: no motion is done; wait() for the end of one first")
        return driver.capture()

    def _check_ready(self, driver: DriverT, what: str) -> None:
        """Check before a motion that nobody has changed the controller; abort if somebody has."""
        with self._safety.guarded(driver):
            driver.check_ready(what)

    def _connected(self, call: str) -> DriverT:
        """Return the driver of the connection."""
        if self._driver is None:
            raise NotReady(f"{call}: not connected; call connect() first")
        return self._driver

    def _ready(self, call: str) -> DriverT:
        """Return the driver, or refuse a call that the arm's state does not allow."""
        driver = self._connected(call)
        self._states.require(call)
        return driver

    def _wait(self, seconds: float) -> None:
        """Sleep for the driver, unless its motion is to be aborted."""
        if self._abort_requested.is_set() and self._states.now is State.MOVING:
            self._abort_requested.clear()
            raise MotionFault(
                "the motion was aborted by the operator; run the same again to continue the session"
            )
        self._sleep(seconds)


def _say(error: BaseException, state: str) -> None:
    """Add the motors' state to an interrupt that does not say it yet."""
    if isinstance(error, KeyboardInterrupt) and not hasattr(error, "__notes__"):
        error.add_note(state)
