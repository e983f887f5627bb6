"""The two motors behind a Galil controller: on, watched, stopping and standstill."""

from collections.abc import Callable, Collection

import numpy as np

from sautereau.robot.drivers.driver import STOPPING
from sautereau.robot.drivers.galil.connection import Connection
from sautereau.robot.drivers.galil.dmc import (
    CAUSES,
    FAULT,
    LEFT,
    LIMIT,
    RESOLUTION,
    SIGN,
    TICK,
    WATCH,
    stop_reason,
)
from sautereau.robot.drivers.keep_alive import TICKS
from sautereau.robot.errors import (
    CommandRefused,
    GarbledAnswer,
    MotionFault,
    NotReady,
    SettingNotTaken,
)
from sautereau.trajectory.segments import Counts

_ENDED = ("_SCA", "_SCB", f"_XQ{WATCH}", LEFT, FAULT)
"""Stop codes and state of the program: why a motion, or the power, has ended."""


class Axes(Connection):
    """Axes A and B, which turn joints 1 and 2."""

    on_trial = False
    """Whether a controller that is not verified may be switched on."""

    _signed = 0.0
    """Samples on the controller's clock at the last signature of the program."""
    silent = False
    """Whether the watchdog is not renewed, to measure it."""

    def positions(self) -> Counts:
        """Read the encoders: counts, shape (2,)."""
        return np.rint(self.line.read("_TPA", "_TPB")).astype(np.int64)

    def await_record(self) -> None:
        """Wait until a recording is complete."""
        self._polling.until(lambda: not self.line.read("_RC")[0], "the recording", STOPPING)

    def await_standstill(self, what: str, limit: float) -> None:
        """Wait until both axes are at rest, ``limit`` seconds at most; ``what`` is the motion."""
        self._polling.until(lambda: not any(self.line.read("_BGA", "_BGB")), what, limit)

    def settle(self, target: Counts) -> None:
        """Wait until both joints are at a target, counts of shape (2,)."""
        self._polling.settle(self.positions, target, self.limits)

    def check_stop(self, what: str, normal: Collection[int]) -> None:
        """Refuse a motion that stopped for another reason than the stop codes ``normal``."""
        *codes, running, left, fault = self.line.read(*_ENDED)
        cause = self._refused(fault)
        if not cause and not CAUSES.intersection(codes):
            cause = _ended_program(running, left)
        stopped = [f"joint {j} {stop_reason(c)}" for j, c in enumerate(codes, 1) if c not in normal]
        if cause or stopped:
            cause = cause or f"{', '.join(stopped)}; remove the cause"
            raise MotionFault(f"{what} broke off: {cause}, then home() again")

    def check_ready(self, what: str) -> None:
        """Refuse a motion unless motors, program and settings are as this driver left them.

        Raises:
            MotionFault: The motors are off, or another program runs in the controller.
            SettingChanged: Lists the settings that differ.
        """
        names = ("_MOA", "_MOB", "_AB", SIGN, "TIME", *_ENDED)
        off_a, off_b, abort, sign, now, *codes, running, left, fault = self.line.read(*names)
        cause = self._refused(fault) or _ended_program(running, left)
        if not cause and (off_a or off_b):
            seen = [f"joint {j} {stop_reason(c)}" for j, c in enumerate(codes, 1) if c in CAUSES]
            seen += ["the abort input is active"] * (not abort)
            no_reason = f"no reason in the stop codes {codes[0]:g} and {codes[1]:g}"
            cause = f"the motors are off: {', '.join(seen) or no_reason}; remove the cause"
        if cause:
            raise MotionFault(f"{what} was not started: {cause}, then home() again")
        if self._replaced(sign, left, running, now):
            raise self._other_program("the motors are switched off")
        self.settings.check()

    def _refused(self, fault: float) -> str:
        """Return what the program in the controller reports of a limit or a refused command."""
        if fault == LIMIT:
            return f"{self._limits_reached()}; remove the cause"
        if fault:
            return (
                "the controller refused a command of its program, with code"
                f" {fault:g} (TC); look it up in the command reference"
            )
        return ""

    def _limits_reached(self) -> str:
        """Name the joints that are at a limit switch or a software limit now."""
        names = ("_LFA", "_LRA", "_TPA", "_FLA", "_BLA", "_LFB", "_LRB", "_TPB", "_FLB", "_BLB")
        values = self.line.read(*names)
        reached = []
        for joint in (1, 2):
            forward, reverse, at, high, low = values[5 * joint - 5 : 5 * joint]
            near = self.limits.tolerance
            if not forward or at > high - near:
                reached.append(f"joint {joint} stopped by the forward limit")
            if not reverse or at < low + near:
                reached.append(f"joint {joint} stopped by the reverse limit")
        return " and ".join(reached) or "a joint stopped by a limit that it has left again"

    def switch_on(self) -> None:
        """Start the watchdog and see it count; then switch the motors on, and verify."""
        self._check_verified()
        abort, *allowed = self.line.read("_AB", "_LFA", "_LFB", "_LRA", "_LRB")
        if not abort:
            raise SettingNotTaken(
                f"controller on {self.line.name}: its abort input is active; release the emergency"
                " stop, then enter powered() again"
            )
        names = [f"{side} limit of joint {j}" for side in ("forward", "reverse") for j in (1, 2)]
        active = [name for name, allows in zip(names, allowed, strict=True) if not allows]
        if active and self._settings.limit_switches != "none":
            raise SettingNotTaken(
                f"controller on {self.line.name}: active: {', '.join(active)}; move the arm off"
                " the switch by hand, or correct controller.limit_switches in the rig file"
            )
        self.start_watchdog()
        self.line.ask("SH AB")
        if any(self.line.read("_MOA", "_MOB")):
            raise SettingNotTaken(
                "the controller accepted SH AB and its motors are still off; check the"
                " emergency stop and the amplifiers"
            )

    def _check_verified(self) -> None:
        """Refuse a real controller that was not verified, or has changed since."""
        rig = self._settings
        if self.on_trial or "SIM" in self.identity:
            return
        pairs = ((rig.verified, self.record), (rig.verified_settings, self.settings.memory_text))
        changed = [f"{before!r} is now {now!r}" for before, now in pairs if before != now]
        if changed:
            since = f"has changed since {rig.verified_on}: {', '.join(changed)}"
            raise NotReady(
                f"powered: the controller on {self.line.name}"
                f" {since if rig.verified else 'was never verified on this bench'}; run"
                " `sautereau setup verify` with your rig file"
            )

    def start_watchdog(self) -> None:
        """Start the watchdog and see it count."""
        steps = round(self._settings.watchdog_period * 1e3 / TICKS / RESOLUTION)
        tick = steps * RESOLUTION
        self.line.ask(f"{TICK}={tick}", f"{LEFT}={TICKS}", f"{SIGN}=0", f"{FAULT}=0")
        self.line.verify({TICK: tick, LEFT: TICKS})
        self.line.ask(f"XQ #WATCH,{WATCH}")
        self._polling.until(lambda: self._left() < TICKS, "the watchdog's first count", STOPPING)
        (self._signed,) = self.line.read("TIME")
        self._watched = True
        self.renew()

    def _left(self) -> float:
        """Return the counts that the watchdog has left; it must be running."""
        left, running = self.line.read(LEFT, f"_XQ{WATCH}")
        if running < 0:
            raise SettingNotTaken(
                f"controller on {self.line.name}: its watchdog does not run; connect() again"
            )
        return left

    def renew(self, keep_waiting: Callable[[], bool] | None = None, /) -> None:
        """Renew the watchdog; stop the arm where another program runs in its place.

        Args:
            keep_waiting: As for `Line.ask`.
        """
        if self.silent:
            return
        # Once at 0 it stays there, so that whoever asks later finds that it has tripped.
        again = f"{LEFT}={TICKS}*({LEFT}>0)"
        renewal = (f"MG {SIGN},{LEFT},_XQ{WATCH},TIME", f"{SIGN}=0", again)
        sign, left, running, now = self.line.numbers(*renewal, count=4, keep_waiting=keep_waiting)
        replaced = self._replaced(sign, left, running, now)
        if left <= 0:  # it has tripped; what waits for the motion reports that
            self._watched = False
        elif self._watched and replaced:
            self.abort()
            self.line.report(self._other_program("the motors were switched off"))

    def _replaced(self, sign: float, left: float, running: float, now: float) -> bool:
        """Return whether another program runs in the place of the watchdog.

        Args:
            sign: The signature that a program has written since the last renewal, 0 for none.
            left: Counts that the watchdog has left.
            running: Line that its thread executes, -1 for none.
            now: Samples on the controller's clock.
        """
        if sign == self._sign:
            self._signed = now
        unsigned = (now - self._signed) * self._settings.sample_period
        # Without pacing, the stand-in's program does not count; see docs/stand-in.md.
        late = unsigned >= self._settings.watchdog_period / 2 and "SIM" not in self.identity
        return running < 0 or (sign != self._sign and (left < TICKS or late))

    def _other_program(self, so: str) -> MotionFault:
        return MotionFault(
            f"controller on {self.line.name}: its watchdog was stopped or its program was"
            f" replaced, so {so}; end the other program that uses"
            " the controller, then connect() again"
        )

    def halt(self) -> None:
        """Decelerate to a standstill, motors on, without a torque from the program."""
        self.line.resynchronise()
        self._ask_with_retry("ST AB")
        self._ask_with_retry(*self._quiet)
        self.await_standstill("the stop", STOPPING)

    def _ask_with_retry(self, *commands: str) -> None:
        """Send commands, twice where a broken-off line before them spoilt the first."""
        try:
            self.line.ask(*commands)
        except (CommandRefused, GarbledAnswer):
            self.line.resynchronise()
            self.line.ask(*commands)


def _ended_program(running: float, left: float) -> str:
    """Return who has ended the program: its own watchdog, which counts down to 0, or another.

    Args:
        running: Line that its thread executes, -1 for none.
        left: Counts that the watchdog has left.
    """
    if left <= 0:  # it has switched off, or is about to
        return (
            "the controller's watchdog has switched the motors off, because the host did not"
            " renew it for too long (controller.watchdog_period); reduce the load on this"
            " machine, let nothing suspend it, or use a faster line (controller.baud_rate)"
        )
    if running < 0:
        return (
            f"the controller's program was ended with {left:g} of {TICKS} counts of its"
            " watchdog left; end the other program that uses the controller"
        )
    return ""
