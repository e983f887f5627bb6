"""Learning: the trajectory corrected from the measured speed of the jack, press after press."""

import uuid
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sautereau.analysis.model.predict import expected_of
from sautereau.daq.file.reading import read_session
from sautereau.entrance.devices import Connected, Devices
from sautereau.entrance.session import Session
from sautereau.entrance.shown import Shown
from sautereau.rig.disk import may_replace
from sautereau.robot.drivers.registry import motion_controller
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.feedforward import force_of
from sautereau.robot.experiment.folder_lock import only_session
from sautereau.robot.experiment.learning import IterativeLearning, write_learned
from sautereau.robot.experiment.plan import digest
from sautereau.robot.experiment.session import Item, Origin, make_presses

if TYPE_CHECKING:
    import pandas as pd

LEARNED = "learned.json"
"""File of the correction in the folder."""


@dataclass(frozen=True, repr=False)
class Learned(Shown):
    """A learned correction."""

    session: Session
    errors: tuple[float, ...]
    """RMS relative error of the jack speed over the cruise, of each press; dimensionless."""
    stopped: str
    """Why learning has ended before the last press; empty if it has not."""
    path: Path | None
    """File of the correction, for `press(learned=...)`; None if none reduced the error."""
    simulated: bool
    """Whether the stand-in made any of the presses."""
    seed: int | None
    """Seed of the stand-in's random numbers."""
    warnings: tuple[str, ...]

    def __repr__(self) -> str:
        errors = ", ".join(f"{error:.2%}" for error in self.errors)
        return f"<Learned from {len(self.errors)} presses: RMS speed error {errors}>"

    def to_frame(self) -> "pd.DataFrame":
        """Return the RMS speed error of each press."""
        import pandas as pd

        index = pd.RangeIndex(1, len(self.errors) + 1, name="press")
        return pd.DataFrame({"rms_speed_error": self.errors}, index)


class Learning:
    """Learning that is about to start; see `sautereau.entrance.bench.Bench.learn`."""

    def __init__(self, bench: Devices, n: int, out: Path, notes: str, feed_forward: Path | None):
        self._bench, self._out = bench, out
        self._nominal = bench.rig.values
        self._file = out / LEARNED
        if self._file.exists() and not may_replace(self._file):
            raise RobotError(f"learning: {self._file} already exists; give another folder")
        self._pushed = digest(feed_forward) if feed_forward else ""
        measured = force_of(feed_forward) if feed_forward else None
        expected, doubts = expected_of(self._nominal)
        self._made = IterativeLearning(self._nominal, expected, n, measured=measured, notes=notes)
        self.warnings = (*doubts, *self._made.warnings)

    def run(
        self,
        on: Callable[[Connected], Any] = lambda bench: None,
        on_press: Callable[[Path, float], Any] = lambda path, error: None,
    ) -> Learned:
        """Make the presses.

        Args:
            on: Called with the devices before the first press.
            on_press: Called with each recording and its RMS speed error.
        """
        made, nominal = self._made, self._nominal
        with only_session(self._out), self._bench.connected() as bench:
            on(bench)

            def done(item: Item, path: Path) -> None:
                bench.keep_truth(path)
                made.update(item, path)
                on_press(path, made.errors[-1])

            recordings = make_presses(
                motion_controller(bench.rig),
                self._out,
                made.presses_on(bench.rig),
                Origin(uuid.uuid4().hex, bench.scene, bench.seed),
                on_press=done,
            )
        if made.best is not None:
            write_learned(self._file, nominal, made.best, made.errors, self._pushed)
        return Learned(
            Session(recordings, folder=self._out),
            tuple(made.errors),
            made.stopped,
            self._file if made.best is not None else None,
            any(read_session(path).simulated for path in recordings),
            bench.seed,
            self.warnings,
        )
