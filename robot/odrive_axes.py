"""The two motors behind an ODrive: settings, states, errors, on and off.

Names are those of firmware 0.5.x (confirm them with `odrivetool` for another version).
Positions are counts of a joint; on the wire they are turns of its motor, 0 at home.
"""

import math
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from rig.schema import Rig
from robot.errors import GarbledAnswer, MotionFault, RobotError, SettingNotTaken
from robot.odrive_errors import check_errors
from robot.odrive_line import LineRefused, OdriveLine, framed
from robot.odrive_setpoints import Setpoints
from robot.odrive_settings import AXES, set_limits
from trajectory.counts import to_counts
from trajectory.motion import Floats
from trajectory.segments import Counts

IDLE, CLOSED_LOOP = 1, 8
"""States of an axis."""
_POSITION_FILTER = 3  # input_mode
SETTLING = 1.0
"""s that a joint may take to come within tolerance after a motion."""
SWITCHING = 0.5
"""s that an axis may take to change its state."""
MARGIN = 10.0
"""s that a motion may last longer than it should before it counts as stuck."""
_RUN_UP = 0.1  # s, from rest to the speed of a move
_POLL = 0.01
_POSITIONS = ("f 0", "f 1")
_CURRENTS = tuple(f"r {name}.motor.current_control.Iq_setpoint" for name in AXES)


class OdriveAxes:
    """Axes 0 and 1, which turn joints 1 and 2.

    Args:
        line: To the controller.
        rig: Its controller and arm are used.
        clock: Seconds, of any origin.
        sleep: Wait for seconds.
    """

    def __init__(
        self,
        line: OdriveLine,
        rig: Rig,
        clock: Callable[[], float],
        sleep: Callable[[float], None],
    ):
        self.line, self.clock, self.sleep = line, clock, sleep
        self._rig, self._settings = rig, rig.controller
        self._home = to_counts(rig.arm.home_angles, rig.arm.counts_per_revolution)
        self._per_turn = rig.arm.counts_per_revolution / np.array(rig.arm.gear_ratios)
        self._per_ampere = np.ones(2)
        self._trigger = f"gpio{rig.controller.trigger_output}.state"

    def set_up(self) -> None:
        """Switch off, set limits and watchdog, and verify all of them."""
        line = self.line
        self.abort()
        set_limits(line, self._rig)
        self.renew()
        line.set({f"{name}.config.enable_watchdog": 1 for name in AXES})
        constants = [line.read(f"{name}.motor.config.torque_constant") for name in AXES]
        self._per_ampere = np.array(constants) * self._rig.arm.gear_ratios

    def edge(self, level: bool) -> str:
        """Return the command that sets the output wired to the acquisition's trigger."""
        return f"w {self._trigger} {int(level)}"

    def setpoints(self, setpoints: Setpoints) -> list[tuple[str, str]]:
        """Return the commands of setpoints, for both axes."""
        turns = self._turns(setpoints.positions)
        speeds = setpoints.velocities / self._per_turn
        return [
            (f"p 0 {first:.7f} {v:.6f}", f"p 1 {second:.7f} {w:.6f}")
            for (first, second), (v, w) in zip(turns, speeds, strict=True)
        ]

    def needed_baud_rate(self, setpoints: Setpoints) -> float:
        """Return the bits a second by which setpoints reach the controller in time."""
        rows = ((*row, *_POSITIONS, *_CURRENTS) for row in self.setpoints(setpoints))
        longest = max(sum(len(framed(command)) for command in row) for row in rows)
        return 10 * longest / setpoints.interval

    def observe(self, *commands: str) -> tuple[Counts, Floats]:
        """Say commands, and ask in the same breath for positions and torques.

        Returns:
            Counts, positions of the joints, and N m, that their motors are asked for; shape (2,).
        """
        answers = self.line.exchange((*commands, *_POSITIONS, *_CURRENTS), 4)
        currents = [
            self.line.parsed(asked, text, 1)[0]
            for asked, text in zip(_CURRENTS, answers[2:], strict=True)
        ]
        return self._counts(self._told(answers[:2])[0]), np.array(currents) * self._per_ampere

    def positions(self) -> Counts:
        """Read the encoders: counts, shape (2,)."""
        return self._counts(self._told(self.line.exchange(_POSITIONS, 2))[0])

    def in_turns(self, joint: int, counts: float) -> float:
        """Return the motor's turns of counts of joint 1 or 2, a second or not."""
        return counts / float(self._per_turn[joint - 1])

    def move(self, target: Floats | Counts, speed: float, acceleration: float) -> None:
        """Begin a move of both joints; counts, counts a second and counts a second squared."""
        settings = {}
        for name, per_turn in zip(AXES, self._per_turn, strict=True):
            settings |= {
                f"{name}.trap_traj.config.vel_limit": speed / per_turn,
                f"{name}.trap_traj.config.accel_limit": acceleration / per_turn,
                f"{name}.trap_traj.config.decel_limit": acceleration / per_turn,
            }
        self.line.set(settings)
        first, second = self._turns(target)
        self.line.tell(f"t 0 {first:.7f}", f"t 1 {second:.7f}")

    def halt(self, acceleration: float, speed: float) -> None:
        """Move on to where the joints can stand; counts a second squared, counts a second."""
        turns, rates = self._told(self.line.exchange(_POSITIONS, 2))
        speeds = rates * self._per_turn
        rest = self._counts(turns) + speeds * np.abs(speeds) / (2 * acceleration)
        self.move(rest, speed, acceleration)

    def follow(self, at: Counts) -> None:
        """Let both axes follow setpoints, and stand at the first (counts, shape (2,))."""
        self.line.set({f"{name}.controller.config.input_mode": _POSITION_FILTER for name in AXES})
        first, second = self._turns(at)
        self.line.tell(f"p 0 {first:.7f} 0", f"p 1 {second:.7f} 0")

    def renew(self, _over: Callable[[], bool] | None = None) -> None:
        """Tell both watchdogs that the host lives."""
        self.line.say("u 0", "u 1")

    def await_(self, ended: Callable[[], bool], what: str, patience: float) -> None:
        """Poll until ``ended``, ``patience`` seconds at most; ``what`` names the motion."""
        deadline = self.clock() + patience
        while True:
            self.sleep(_POLL)  # the axes take up to 1 ms to begin
            if ended():
                return
            if self.clock() > deadline:
                raise MotionFault(
                    f"{what} has not ended after {patience:.3g} s; check that the arm moves"
                    " freely, its switches and the motors' supply"
                )

    def await_moved(self, what: str, patience: float) -> None:
        """Wait until both moves are done, ``patience`` seconds at most."""

        def ended() -> bool:
            self.check_running(what)
            return all(self.line.read(f"{name}.controller.trajectory_done") for name in AXES)

        self.await_(ended, what, patience)

    def settle(self, target: Counts, tolerance: int) -> None:
        """Wait until both joints are within ``tolerance`` counts of ``target`` (counts, (2,))."""
        deadline = self.clock() + SETTLING
        while np.abs((actual := self.positions()) - target).max() > tolerance:
            if self.clock() > deadline:
                raise MotionFault(
                    f"the joints stand at {actual[0]}, {actual[1]} counts, {SETTLING:g} s after"
                    f" a motion to {target[0]}, {target[1]} that may miss by {tolerance}; check"
                    " that the arm moves freely, and the gains of its position loops"
                )
            self.sleep(_POLL)

    def go(self, target: Floats | Counts, speed: float, most: float, tolerance: int) -> None:
        """Move both joints to a target, and stand there within a tolerance.

        Args:
            target: Counts, absolute; shape (2,).
            speed: Counts a second, of either joint.
            most: Counts a second squared, of either joint.
            tolerance: Counts.
        """
        whole: Counts = np.rint(np.asarray(target)).astype(np.int64)
        distance = int(np.abs(whole - self.positions()).max())
        self.move(whole, speed, min(speed / _RUN_UP, most))
        self.await_moved("the move", distance / speed + MARGIN)
        self.settle(whole, tolerance)

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
            self.sleep(_POLL)
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

    def _turns(self, counts: Floats | Counts) -> Floats:
        """Return the motors' turns from home of joint positions (counts, (..., 2))."""
        return (counts - self._home) / self._per_turn

    def _counts(self, turns: Floats) -> Counts:
        """Return joint positions (counts, (2,)) of the motors' turns from home."""
        return np.rint(turns * self._per_turn + self._home).astype(np.int64)

    def _told(self, answers: list[str]) -> tuple[Floats, Floats]:
        """Return the turns, and turns a second, of the answers to `f`; shape (2,)."""
        pairs = [
            self.line.parsed(asked, text, 2)
            for asked, text in zip(_POSITIONS, answers, strict=True)
        ]
        turns, rates = np.array(pairs).T
        return turns, rates
