"""The two motors behind an ODrive: limits, moves, setpoints and what the encoders tell.

Positions are counts of a joint; on the wire they are turns of its motor, 0 at home.
"""

from collections.abc import Callable

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.robot.drivers.joint_axes import MARGIN
from sautereau.robot.drivers.odrive.line import OdriveLine, framed
from sautereau.robot.drivers.odrive.power import OdrivePower
from sautereau.robot.drivers.odrive.setpoints import Setpoints
from sautereau.robot.drivers.odrive.settings import AXES, set_limits
from sautereau.trajectory.counts import to_counts
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Counts

_POSITION_FILTER = 3  # input_mode
_RUN_UP = 0.1  # s, from rest to the speed of a move
_POSITIONS = ("f 0", "f 1")
_CURRENTS = tuple(f"r {name}.motor.current_control.Iq_setpoint" for name in AXES)


class OdriveAxes(OdrivePower):
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
        super().__init__(line, rig.controller, clock, sleep)
        self._rig = rig
        self._home = to_counts(rig.arm.home_angles, rig.arm.counts_per_revolution)
        self._per_turn = rig.arm.counts_per_revolution / np.array(rig.arm.gear_ratios)
        self._per_ampere = np.ones(2)

    def set_up(self) -> None:
        """Switch off, set limits and watchdog, and verify all of them."""
        line = self.line
        self.abort()
        set_limits(line, self._rig)
        self.renew()
        line.set({f"{name}.config.enable_watchdog": 1 for name in AXES})
        constants = [line.read(f"{name}.motor.config.torque_constant") for name in AXES]
        self._per_ampere = np.array(constants) * self._rig.arm.gear_ratios

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

    def await_moved(self, what: str, patience: float) -> None:
        """Wait until both moves are done, ``patience`` seconds at most."""

        def ended() -> bool:
            self.check_running(what)
            return all(self.line.read(f"{name}.controller.trajectory_done") for name in AXES)

        self.await_(ended, what, patience)

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
