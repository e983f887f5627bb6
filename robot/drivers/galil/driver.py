"""The driver of a Galil DMC-4x: a press, preloaded as PVT segments that the controller plays.

Positions are counts, speeds counts per second, durations controller samples.

Home are the edges of the home switches, or the encoders' next index beyond them. Find Edge moves
backward if the home input reads 1 and forward if it reads 0. It thus moves towards the edge that
has 0 below it and 1 above, and decelerates behind it. The last approach is always slow and from the
same side. The torque is low, and software limits around the position of the arm end a search in the
wrong direction.
"""

import math
from functools import partial
from typing import ClassVar

import numpy as np

from sautereau.rig.capabilities import Capabilities, HomingKind
from sautereau.robot.controller import Capture, TorqueTable
from sautereau.robot.drivers.driver import MARGIN
from sautereau.robot.drivers.galil.arrays import (
    EXPONENTS,
    SOURCES,
    CapturePlan,
    Push,
    make_room,
    plan_push,
    read_capture,
    write_push,
)
from sautereau.robot.drivers.galil.axes import Axes
from sautereau.robot.drivers.galil.dmc import (
    CLEAR_SEGMENTS,
    EDGE_FOUND,
    END_OF_MOTION,
    INDEX_FOUND,
    NORMAL_ENDS,
    PRESS,
    RATE,
    WATCH,
    check_segments,
    halting,
    profile,
    segment_commands,
)
from sautereau.robot.drivers.powered_arm import PoweredArm
from sautereau.robot.errors import MotionFault, SettingNotTaken
from sautereau.trajectory.segments import Counts, Segments

_SLOW = 0.01  # Speed of the last approach to home (rad/s)
_AXES = "AB"


class GalilDriver(Axes):
    """A `Driver` over a serial line or Ethernet."""

    WITHOUT_HOST: ClassVar[str] = (
        "A motion that the controller has started continues until its watchdog trips, {period:g} s"
        " after the host last renewed it."
    )
    ABORT_AFTER: ClassVar[frozenset[str]] = frozenset()
    CAPABILITIES: ClassVar[Capabilities] = Capabilities(
        trigger_output=True,
        torque_feed_forward=True,
        preloaded=True,
        capture_interval=2 ** min(EXPONENTS),
        homing=HomingKind.SWITCHES,
    )

    _planned: tuple[Segments, Push | None]
    _plan: CapturePlan

    def find_home(self, home: Counts) -> None:
        """Find home, define the position there, and set the limits of torque and travel.

        Raises:
            MotionFault: A switch or index was not found within `controller.home_travel`, or not
                twice within `controller.home_tolerance`.
        """
        settings, limits = self._settings, self.limits
        start, reach = self.positions(), math.ceil(limits.in_counts(settings.home_travel))
        self.settings.limit_torque(settings.home_torque)
        self.settings.limit_travel(start - reach, start + reach)
        self._find_edges(_AXES, 0.2)  # rad/s
        first, second = self.approach_home(), self.approach_home()
        if (apart := np.abs(second - first)).max() > settings.home_tolerance:
            raise MotionFault(
                f"homing: the switches were found twice, {apart[0]} and {apart[1]} counts apart,"
                f" and controller.home_tolerance is {settings.home_tolerance}; check that the"
                " switches are fixed and clean"
            )
        if settings.home_index:
            sign = 1 if settings.home_approach == "forward" else -1
            speed = 2 * round(sign * limits.in_counts(_SLOW) / 2)
            self.line.ask(f"JG {speed},{speed}", f"HV {abs(speed)},{abs(speed)}")
            self._search("FI", _AXES, _SLOW, INDEX_FOUND)
        self.line.ask(f"DP {home[0]},{home[1]}")
        self.settle(home)
        self.settings.limit_travel(limits.lower, limits.upper)
        self.settings.limit_torque(1.0)

    def approach_home(self) -> Counts:
        """Cross the edges slowly, the last time in the rig's direction; return the positions."""
        self._find_edges(_AXES, _SLOW)
        behind = 1.0 if self._settings.home_approach == "forward" else 0.0
        levels = self.home_levels()
        if wrong := "".join(a for a, at in zip(_AXES, levels, strict=True) if at != behind):
            self._find_edges(wrong, _SLOW)
        return self.positions()

    def _find_edges(self, which: str, speed: float) -> None:
        cruise, start, _ = profile(self.limits, self.limits.in_counts(speed))
        self.line.ask(cruise, start, halting(self.limits)[0])  # stops close behind the edge
        self._search("FE", which, speed, EDGE_FOUND)

    def _search(self, command: str, which: str, speed: float, found: int) -> None:
        self.line.ask(f"{command} {which}")
        self.line.ask(f"BG {which}")
        self.await_standstill("homing", self._settings.home_travel / speed + MARGIN)
        # A joint that did not take part keeps the code of its own last search.
        self.check_stop("homing", {found, EDGE_FOUND})

    def home_levels(self) -> list[float]:
        return self.line.read("_HMA", "_HMB")

    def go(self, target: Counts, speed: float) -> None:
        distance = int(np.abs(target - self.positions()).max())
        self.line.ask(*profile(self.limits, speed))
        self.line.ask(f"PA {target[0]},{target[1]}")
        self.line.ask("BG AB")
        self.await_standstill("the move", distance / speed + MARGIN)
        self.check_stop("the move", NORMAL_ENDS)
        self.settle(target)

    def plan(self, segments: Segments, torque: TorqueTable | None) -> None:
        check_segments(segments)
        push = (
            None if torque is None else plan_push(self.rig, torque, segments, self.settings.torque)
        )
        self._planned = segments, push

    def load(self) -> Segments:
        """Preload the motion; return the motion as it was sent.

        The controller repeats every segment that it receives. Its arrays of torques are read
        back.
        """
        segments, push = self._planned
        line, count = self.line, len(segments)
        free = self._empty_fifo()
        line.ask_packed([*segment_commands(segments), *END_OF_MOTION])
        left = line.read("_PVA", "_PVB")
        falls = [before - after for before, after in zip(free, left, strict=True)]
        # The end may count as one, of both axes alike.
        if falls[0] != falls[1] or falls[0] not in (count, count + 1):
            raise SettingNotTaken(
                f"controller on {line.name}: {count} segments were sent and its FIFO took"
                f" {falls[0]:g} and {falls[1]:g}; load() again, and check the cable's shield"
            )
        self._plan = make_room(line, segments.total_samples, 0 if push is None else len(push.volts))
        write_push(line, push)
        return segments

    def _empty_fifo(self) -> list[float]:
        """Return the free space of both FIFOs, emptied of a motion that was never played."""
        line, limit = self.line, self._settings.segment_limit
        free = line.read("_PVA", "_PVB")
        if free != [limit, limit]:
            line.ask(*CLEAR_SEGMENTS)
            free = line.read("_PVA", "_PVB")
        if min(free) < limit:
            raise SettingNotTaken(
                f"controller on {line.name}: its FIFO has room for {min(free):g} segments after"
                f" it was cleared, and controller.segment_limit is {limit}; switch the"
                " controller off and on, or correct the rig file"
            )
        return free

    def arm(self) -> None:
        exponent = self._plan.exponent
        self.line.ask(*halting(self.limits))
        self.line.ask(f"RA {','.join(f'{name}[]' for name in SOURCES)}")
        self.line.ask(f"RD {','.join(SOURCES.values())}")
        self.line.ask(f"{RATE}={exponent}")
        self.line.verify({RATE: exponent, f"_XQ{PRESS}": -1})

    def start(self) -> None:
        self.line.ask(f"XQ #PRESS,{PRESS}")

    def wait(self) -> None:
        motion, _ = self._planned
        duration = motion.total_samples * self._settings.sample_period
        self._polling.until(self._ended, "the press", duration + MARGIN)
        self.check_stop("the press", NORMAL_ENDS)
        *played, end_a, end_b = self.line.read("_BTA", "_BTB", "_RPA", "_RPB")
        if (end_a, end_b) != tuple(motion.end):
            raise MotionFault(
                f"the press ended at {end_a:g} and {end_b:g} counts instead of {motion.end[0]} and"
                f" {motion.end[1]}: a segment was not taken as it was sent; check the cable's"
                " shield and the firmware's revision, then home() again"
            )
        if any(done not in (len(motion), len(motion) + 1) for done in played):
            raise MotionFault(
                f"the press ended after {played[0]:g} and {played[1]:g} of its"
                f" {len(motion)} segments; check the stop inputs, then load() again"
            )

    def capture(self) -> Capture:
        return read_capture(self.line, self._plan, self.rig)

    def _ended(self) -> bool:
        """Return whether both axes are at rest and the program has ended, or something stopped it.

        The watchdog can stop it, or a limit, which stops one axis while the other moves.
        """
        names = ("_BGA", "_BGB", "_SCA", "_SCB", f"_XQ{PRESS}", f"_XQ{WATCH}")
        *moving, code_a, code_b, press, watch = self.line.read(*names)
        if any(moving):
            codes = zip(moving, (code_a, code_b), strict=True)
            return any(not moves and code not in NORMAL_ENDS for moves, code in codes)
        return press < 0 or watch < 0


GalilController = partial(PoweredArm, GalilDriver)
"""A `MotionController` over a serial line or Ethernet; further arguments as for `PoweredArm`."""
