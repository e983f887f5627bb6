"""The presses of a session before they are made: the rows of a recording, and the plans."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from sautereau.analysis.loading.press import press_of
from sautereau.analysis.model.predict import expected_of
from sautereau.analysis.session.analysed import AnalysedPress
from sautereau.analysis.session.conditions import differing
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import Recorded
from sautereau.rig.disk import as_text, explained, read_limited
from sautereau.rig.document import values_of
from sautereau.rig.faults import fault_list
from sautereau.rig.schema import Gesture, Press, Rig
from sautereau.rig.units import format_quantity
from sautereau.robot.controller import TorqueTable
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.feedforward import force_of, torque_table
from sautereau.robot.experiment.learning import LEARN, LearnedCorrection, read_learned
from sautereau.robot.experiment.plan import Row, digest
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.press import Trajectory, plan_press
from sautereau.trajectory.timing import press_law

MEASURED_STEP = 4e-3  # Time between the samples of a gesture from a measured rise (s)
SAME = 1e-6
"""m, within which the recorded plan is that of the recorded rig; otherwise it was corrected."""
BESIDE = 5  # Samples of rest before and after the motion, so that it starts and ends smoothly


class Planner:
    """Plans presses with the files that a session uses.

    Args:
        learned: Correction of the trajectory, written by `sautereau learn`.
        feed_forward: Recording of an earlier press, for torques against its measured force.

    Raises:
        RobotError: A file cannot be read.
    """

    def __init__(self, learned: Path | None = None, feed_forward: Path | None = None):
        # Before they are hashed: neither may be a file of any other kind and size.
        self._measured = force_of(feed_forward) if feed_forward else None
        if learned:
            with explained(RobotError, f"learned correction {learned}: cannot be read", LEARN):
                read_limited(learned)
        used = {"learned": learned, "feed_forward": feed_forward}
        self.files = {name: digest(path) for name, path in used.items() if path}
        """SHA-256 of the files by their role."""
        self._path = learned
        self.learned: LearnedCorrection | None = None
        """The correction of the last plan."""
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
        expected, doubts, _ = expected_of(rig)
        pushed = self.files.get("feed_forward", "")
        if self._path:
            self.learned = read_learned(self._path, rig, pushed)
            doubts = [*doubts, *self.learned.doubts]
        trajectory = plan_press(rig, expected, self.learned and self.learned.correction)
        torques = torque_table(rig, trajectory, self._measured) if self._measured else None
        self._made.append((rig, (trajectory, torques)))
        self.warnings += [*doubts, *trajectory.warnings]
        return trajectory, torques

    def stale(self, presses: Iterable[AnalysedPress]) -> str:
        """Return how presses contradict the correction they were made with; empty if not."""
        if self.learned is None:
            return ""
        errors, forces, tolerance = [], [], 0.0
        for press in presses:
            tolerance = press.press.rig.press.speed_tolerance
            for name, found in (("held_speed_error", errors), ("peak_force", forces)):
                if isinstance(value := press.features[name], float):
                    found.append(value)
        found = self.learned.stale(errors, forces, tolerance)
        return found and f"learned correction {self._path}: {found}"

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


def rows_of_recording(
    recording: Path, rig: Rig, repeats: int = 1, notes: str = ""
) -> tuple[Row, ...]:
    """Return the row of presses with the motion of a recorded one.

    The motion is the planned one: the law of the recorded rig's `press`, or with a learned
    correction a gesture. A recording without a plan, such as an imported one, gives its measured
    rise as the gesture.

    Args:
        repeats: Number of presses.

    Raises:
        daq.errors.RecordingError: The file is not a complete recording.
        RobotError: The jack does not move in it.
    """
    recorded = read_recording(recording)
    again = rig.model_copy(update={"press": _press(recorded)})
    changed = differing(values_of(rig), values_of(again))
    notes = "; ".join(filter(None, (notes, f"replay of {as_text(recording.name)}")))
    return (Row(again, repeats, changed, notes),)


def _press(recorded: Recorded) -> Press:
    """Return the press that a recording shows."""
    press, plan = recorded.rig.press, recorded.plan
    if plan is not None:
        planned = press_law(press).law.at(plan.t - plan.t[0]).position
        if np.abs(planned - plan.jack_rise).max() <= SAME:
            return press
        return _with_gesture(press, plan.t, plan.jack_rise, recorded, SAME, 2e-3)  # Every 2 ms
    measured = press_of(recorded)
    n = max(1, round(MEASURED_STEP * recorded.rate))
    both = np.stack([measured.time, measured.samples["jack_rise"]])
    time, rise = both[:, : both.shape[1] // n * n].reshape(2, -1, n).mean(axis=2)
    # From a rise of 20 um on, the jack moves.
    return _with_gesture(press, time, rise, recorded, 20e-6, MEASURED_STEP)


def _with_gesture(
    press: Press, time: Floats, rise: Floats, recorded: Recorded, least: float, step: float
) -> Press:
    """Return the press with a motion as its gesture, from the first to the last rise above one."""
    moving = np.flatnonzero(rise > least)
    if len(moving) < 3:
        raise RobotError(f"replay of {recorded.path}: the jack does not move in it; give another")
    first, last = max(moving[0] - BESIDE, 0), min(moving[-1] + BESIDE, len(rise) - 1)
    n = max(3, round(float(time[last] - time[first]) / step))
    even = np.linspace(time[first], time[last], n)
    rises = np.interp(even, time, rise)
    rises[0] = 0.0
    gesture = {
        "time": [format_quantity(t, "s") for t in (even - even[0]).tolist()],
        "rise": [format_quantity(r, "m") for r in np.maximum(rises, 0.0).tolist()],
    }
    tolerance = max(press.speed_tolerance, 0.02)  # A gesture's, by rounding
    update = {"gesture": Gesture.model_validate(gesture), "speed_tolerance": tolerance}
    return press.model_copy(update=update)
