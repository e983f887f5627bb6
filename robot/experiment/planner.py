"""Trajectories and torques of the presses of a session, each planned once."""

from collections.abc import Sequence
from pathlib import Path

from sautereau.analysis.model.predict import expected_of
from sautereau.rig.faults import fault_list
from sautereau.rig.schema import Rig
from sautereau.robot.controller import TorqueTable
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.feedforward import force_of, torque_table
from sautereau.robot.experiment.learning import read_learned
from sautereau.robot.experiment.plan import digest
from sautereau.robot.experiment.plan_table import Row
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.press import Trajectory, plan_press


class Planner:
    """Plans presses with the files that a session uses.

    Args:
        learned: Correction of the trajectory, written by `sautereau learn`.
        feed_forward: Recording of an earlier press, for torques against its measured force.

    Raises:
        RobotError: A file cannot be read.
    """

    def __init__(self, learned: Path | None = None, feed_forward: Path | None = None):
        used = {"learned": learned, "feed_forward": feed_forward}
        self.files = {name: digest(path) for name, path in used.items() if path}
        """SHA-256 of the files by their role."""
        self._learned = learned
        self._measured = force_of(feed_forward) if feed_forward else None
        self._made: list[tuple[Rig, tuple[Trajectory, TorqueTable | None]]] = []
        self.warnings: list[str] = []
        """What is doubtful about the plans so far."""

    def __call__(self, row: Row) -> tuple[Trajectory, TorqueTable | None]:
        """Return trajectory and feed-forward torques of a row's presses.

        Raises:
            TrajectoryError: The press cannot be made.
            RobotError: The correction is of another press, or a torque is too large.
        """
        for rig, made in self._made:
            if rig is row.rig or rig == row.rig:
                return made
        rig = row.rig
        expected, doubts = expected_of(rig)
        pushed = self.files.get("feed_forward", "")
        correction = read_learned(self._learned, rig, pushed) if self._learned else None
        trajectory = plan_press(rig, expected, correction)
        torques = torque_table(rig, trajectory, self._measured) if self._measured else None
        self._made.append((rig, (trajectory, torques)))
        self.warnings += [*doubts, *trajectory.warnings]
        return trajectory, torques

    def plan_all(self, rows: Sequence[Row]) -> None:
        """Plan the press of every row, before the first is made.

        Raises:
            RobotError: Lists every row of a table whose press cannot be planned.
            TrajectoryError: The only press cannot be planned.
        """
        faults = []
        for row in rows:
            try:
                self(row)
            except (TrajectoryError, RobotError) as error:
                if row.line is None:
                    raise
                faults.append(f"line {row.line}: {error}")
        if faults:
            raise RobotError(fault_list("plan table", faults))
