"""One recording of a press."""

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sautereau.analysis.errors import AnalysisError, MissingSignalError
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.analysis.results.press import HEADER, press_line, press_summary
from sautereau.analysis.results.result import Shown, shown
from sautereau.analysis.results.rig import Rig
from sautereau.analysis.session.analysed import AnalysedPress, analyse_file, analyse_partial
from sautereau.daq.convert.export import to_xarray
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import SessionInfo
from sautereau.robot.experiment.health import Health, health_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


class PressFile(Shown):
    """One recording. It is read when it is used."""

    def __init__(self, path: str | Path):
        self.path = Path(path)

    def __repr__(self) -> str:
        return f"<PressFile {self.path}>"

    def __str__(self) -> str:
        return f"{HEADER}\n{self.line}"

    @cached_property
    def analysed(self) -> AnalysedPress:
        """Phases, features and description of the press, without most samples."""
        return analyse_file(self.path).light()

    @cached_property
    def partial(self) -> AnalysedPress:
        """The same of a press that may lack the force or the velocity: for tables of its phases
        and features, which omit what needs the missing signal."""
        try:
            return self.analysed
        except MissingSignalError:
            return analyse_partial(self.path).light()

    @property
    def line(self) -> str:
        """The phases as rows of a table, under `HEADER`."""
        return press_line(self.partial.press, self.partial.phases, self.partial.features)

    @cached_property
    def press(self) -> Press:
        """The press with all its samples."""
        found = analyse_file(self.path)
        vars(self).setdefault("analysed", found.light())
        return found.press

    @property
    def data(self) -> "pd.DataFrame":
        """Samples in SI units over the time in s after the trigger; `attrs` has the units."""
        return self.press.data

    @property
    def phases(self) -> Phases:
        """Contact, release and the other instants, with uncertainties."""
        return self.analysed.phases

    def health(self, first: "PressFile | None" = None) -> Health:
        """Return whether jack, key and force transducer are fit for the next press.

        Args:
            first: First press with the same plan and instrument; None if this is the first. Nothing
                is wrong with a recording that cannot be analysed.
        """
        try:
            return health_of(self.partial, first and first.partial)
        except AnalysisError:
            return Health()

    @property
    def info(self) -> SessionInfo:
        """Description of the press: date, devices, notes, number in its session."""
        return self.analysed.session

    @property
    def rig(self) -> Rig:
        """The rig saved in the recording."""
        return Rig(self.analysed.press.rig)

    @property
    def document(self) -> dict[str, Any]:
        """The phases as JSON."""
        return press_summary(self.partial.press, self.partial.phases, self.partial.features)

    def to_frame(self) -> "pd.DataFrame":
        """Return the samples."""
        return self.data

    def to_xarray(self) -> Any:
        """Return samples in SI units, encoders and plan as an xarray Dataset; see `to_xarray`."""
        return to_xarray(read_recording(self.path))

    def plot(self) -> "Figure":
        """Return a figure of force and speed with contact and release."""
        from sautereau.analysis.figures.phases import phases_figure

        return shown(phases_figure([self.press], [self.phases]))
