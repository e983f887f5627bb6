"""Learning: the trajectory corrected from the measured speed of the jack, press after press."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sautereau.analysis.model.predict import expected_of
from sautereau.analysis.results.result import Shown, frame_of
from sautereau.analysis.text import counted
from sautereau.daq.file.reading import read_session
from sautereau.entrance.devices import Connected, Devices, fresh_seed
from sautereau.entrance.press_file import PressFile
from sautereau.entrance.session import Session
from sautereau.rig import schema
from sautereau.rig.disk import may_replace
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.feedforward import force_of
from sautereau.robot.experiment.learning import (
    IterativeLearning,
    LearnedCorrection,
    write_learned,
)
from sautereau.robot.experiment.plan import LEARNING, Plan, Row, digest
from sautereau.robot.experiment.run import Crew, PlanRun
from sautereau.robot.experiment.session_folder import Manifest, SessionFolder, only_session
from sautereau.robot.experiment.steps import of_rows
from sautereau.sim_backend.scene import current_scene
from sautereau.trajectory.learning import CUTOFF, is_better

if TYPE_CHECKING:
    import pandas as pd

LEARNED = "learned.json"  # File of the correction in the folder


@dataclass(frozen=True, repr=False)
class Learned(Shown):
    """A learned correction."""

    session: Session
    errors: tuple[float, ...]
    """RMS relative error of the jack speed while a string is held, of each press; over the cruise
    without a pluck; dimensionless."""
    stopped: str
    """Why learning has ended before the last press; empty if it has not."""
    held_speed_error: float
    """The same while a string is held, of the press with the smallest error; over the cruise
    without a pluck."""
    tolerance: float
    """`press.speed_tolerance`; dimensionless."""
    reached: bool
    """Whether `held_speed_error` is within it."""
    floor: float
    """RMS relative error of the jack speed that no correction removes: `rounding`, `scatter` and
    `fast`; an upper limit if `improving`."""
    rounding: float
    """Its part from the rounding of the plan to encoder counts."""
    scatter: float | None
    """Its part that differs from press to press: noise, the reading of the encoders by the position
    loops, the instrument; None after one press."""
    fast: float
    """Its part above the frequencies that are corrected, in the press with the smallest error: the
    step of the force where one of two strings is released, noise."""
    path: Path | None
    """File of the correction, for `press(learned=...)`; None if none reduced the error."""
    simulated: bool
    """Whether the stand-in made any of the presses."""
    seed: int | None
    """Seed of the stand-in's random numbers."""
    warnings: tuple[str, ...]

    @property
    def improving(self) -> bool:
        """Whether the last press was better than those before it. What differs between presses
        is then not only scatter, and `floor` is an upper limit."""
        return len(self.errors) > 1 and is_better(self.errors[-1], self.errors[:-1])

    @property
    def verdict(self) -> str:
        """Whether the jack has the planned speed with the correction, and what to do if not."""
        found = (
            f"reached: RMS speed error {100 * self.held_speed_error:.3g} % while a string is held"
            f" after {counted(len(self.errors), 'press')}, press.speed_tolerance"
            f" {100 * self.tolerance:.3g} %; floor {'at most ' * self.improving}"
            f"{100 * self.floor:.2g} % (rounding to encoder counts {100 * self.rounding:.2g} %"
        )
        if self.scatter is not None:
            found += f", scatter from press to press {100 * self.scatter:.2g} %"
        found += f", above {CUTOFF:g} Hz {100 * self.fast:.2g} %)"
        if self.reached:
            return found
        fixes = "learn with --feed-forward, lower press.jack_speed, or stiffen the position loops"
        if not self.stopped:
            fixes = f"request more presses with -n, {fixes}"
        # What is fast in a press far from its plan may disappear with the rest.
        at_floor = self.tolerance < self.floor and self.held_speed_error < 2 * self.floor
        if at_floor and not self.improving:
            fixes = (
                "use encoders with more counts (arm.counts_per_revolution), reduce the damping gain"
                " of the position loops, which amplifies the steps of the encoders,"
            )
            if self.fast > max(self.rounding, self.scatter or 0.0):
                fixes = "learn with --feed-forward, stiffen the position loops,"
            fixes = f"no correction reaches the tolerance: {fixes} or raise press.speed_tolerance"
        return f"not {found}; {fixes}"

    def __repr__(self) -> str:
        errors = ", ".join(f"{100 * error:.2f} %" for error in self.errors)
        return f"<Learned from {len(self.errors)} presses: RMS speed error {errors}>"

    def to_frame(self) -> "pd.DataFrame":
        """Return the RMS speed error of each press."""
        return frame_of(enumerate(self.errors, 1), ("press", "rms_speed_error"), "press")


class Learning:
    """Learning, new or continued; see `sautereau.entrance.bench.Bench.learn`."""

    def __init__(self, bench: Devices, n: int, out: Path, notes: str, feed_forward: Path | None):
        self._bench, self._out = bench, out
        self._nominal = bench.rig.values
        self._file = out / LEARNED
        self._open = cache(PressFile)  # a recording is analysed once
        if self._file.exists() and not may_replace(self._file):
            raise RobotError(f"learning: {self._file} already exists; give another folder")
        measured = force_of(feed_forward) if feed_forward else None
        self._pushed = digest(feed_forward) if feed_forward else ""
        files = {"learned": LEARNING}
        self._plan = Plan(
            self._nominal,
            (Row(self._nominal, n, notes=notes),),
            scene=bench.scene_text,
            files=files | ({"feed_forward": self._pushed} if feed_forward else {}),
        )
        expected, doubts, _ = expected_of(self._nominal)
        self._made = IterativeLearning(self._nominal, expected, n, measured=measured, notes=notes)
        self.warnings = (*doubts, *self._made.warnings)

    def run(
        self,
        on: Callable[[Connected], Any] = lambda bench: None,
        on_press: Callable[[Path, float], Any] = lambda path, error: None,
    ) -> Learned:
        """Learn from the presses in the folder, and make those that are left.

        Args:
            on: Called with the devices before the first press, and after a pause.
            on_press: Called with each recording and its RMS speed error.
        """
        made, bench = self._made, self._bench
        fresh = None if bench.scene is None else fresh_seed()
        with only_session(self._out, bench.real):
            folder = SessionFolder(self._out, self._continued, bench.seed, fresh, current_scene)
            left = made.presses_on(self._nominal)
            following = [*islice(left, 1)]

            @contextmanager
            def devices(rig: schema.Rig, seed: int | None) -> Iterator[Connected]:
                with self._bench.connected(rig, seed) as bench:
                    on(bench)
                    yield bench

            def learn(path: Path) -> None:
                if following and not run.fault:
                    made.update(following[0], path)
                    on_press(path, made.errors[-1])
                    following[:] = islice(left, 1)

            crew = Crew(
                lambda row: (following[0].trajectory, following[0].torques),
                devices,
                examine=lambda path, first: self._open(path).health(first and self._open(first)),
                opened=learn,
                goes_on=lambda: bool(following),
            )
            run = PlanRun(folder, of_rows(self._plan.rows or ()), crew, bench.control)
            run.run()
            if run.fault:
                raise RobotError(f"learning: {run.fault}; then run the same command again")
        recordings = [folder.done[number] for number in sorted(folder.done)]
        simulated = any(read_session(path).simulated for path in recordings)
        of_session = simulated, folder.seed, self.warnings
        session = Session(map(self._open, recordings), folder=self._out)
        press = session[int(np.argmin(made.errors))]
        best = press.analysed.features
        held, peak = best["held_speed_error"], best["peak_force"]
        error = held if isinstance(held, float) else min(made.errors)
        file = None
        if made.best is not None:
            load = error, peak if isinstance(peak, float) else None
            # The date of the press, so that the same presses give the same file again.
            learned = LearnedCorrection(made.best, *load, read_session(press.path).started)
            file = self._file
            write_learned(file, self._nominal, learned, made.errors, self._pushed)
        limit = self._nominal.press.speed_tolerance
        verdict = error, limit, error <= limit, made.floor, made.rounding, made.scatter, made.fast
        return Learned(session, tuple(made.errors), made.stopped, *verdict, file, *of_session)

    def _continued(self, started: Manifest | None) -> Plan:
        """Return the plan with the engine of a session that was started."""
        self._bench = self._bench.continuing(started)
        return replace(self._plan, scene=self._bench.scene_text)
