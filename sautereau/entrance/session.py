"""Recordings: one press, and the presses of one or more sessions."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from glob import glob
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from sautereau.analysis.campaign.row import row_of, unit_of
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.analysis.session.analysed import AnalysedPress, analyse_file
from sautereau.analysis.session.conditions import analyse, differing, what_is_alike
from sautereau.analysis.session.difference import side_by_side
from sautereau.analysis.summary.press import HEADER, press_line, press_summary
from sautereau.analysis.summary.text import counted
from sautereau.daq.convert.to_xarray import to_xarray
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.durable import PART
from sautereau.daq.file.reading import read_recording, read_session
from sautereau.daq.file.recorded import SessionInfo
from sautereau.entrance.comparison import Comparison
from sautereau.entrance.fit import Fit, fitted
from sautereau.entrance.rig import Rig
from sautereau.entrance.shown import Shown, shown
from sautereau.rig import schema
from sautereau.rig.errors import SautereauError
from sautereau.robot.experiment.session_folder import read_manifest

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


PERIOD = 0.5
"""s, between two looks into a watched folder."""


class PressFile(Shown):
    """One recording; it is read when it is used."""

    def __init__(self, path: str | Path):
        self.path = Path(path)

    def __repr__(self) -> str:
        return f"<PressFile {self.path}>"

    def __str__(self) -> str:
        return f"{HEADER}\n{press_line(self.analysed.press, self.phases)}"

    @cached_property
    def analysed(self) -> AnalysedPress:
        """Phases, features and description of the press, without most samples."""
        return analyse_file(self.path).light()

    @cached_property
    def press(self) -> Press:
        """The press with all its samples."""
        found = analyse_file(self.path)
        self.__dict__.setdefault("analysed", found.light())
        return found.press

    @property
    def data(self) -> "pd.DataFrame":
        """Samples in SI units over the time in s after the trigger; `attrs` has the units."""
        return self.press.data

    @property
    def phases(self) -> Phases:
        """Contact, release and the other instants, with uncertainties."""
        return self.analysed.phases

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
        return press_summary(self.analysed.press, self.phases)

    def to_frame(self) -> "pd.DataFrame":
        """Return the samples."""
        return self.data

    def to_xarray(self) -> Any:
        """Return samples in SI units, encoders and plan as an xarray Dataset; see `to_xarray`."""
        return to_xarray(read_recording(self.path))

    def plot(self) -> "Figure":
        """Return a figure of force and speed with contact and release."""
        return Session([self]).plot()


class Session(Shown, Sequence[PressFile]):
    """Presses in the order in which they were made; `session[0]` is the first.

    Args:
        presses: Recordings.
        warnings: About the folder that they are from.
    """

    def __init__(self, presses: Iterable[str | Path | PressFile], warnings: Sequence[str] = ()):
        self._presses = [p if isinstance(p, PressFile) else PressFile(p) for p in presses]
        self.warnings = tuple(warnings)

    def __repr__(self) -> str:
        return f"<Session of {counted(len(self), 'press')}>"

    def __len__(self) -> int:
        return len(self._presses)

    @overload
    def __getitem__(self, index: int) -> PressFile: ...
    @overload
    def __getitem__(self, index: slice) -> "Session": ...
    def __getitem__(self, index: int | slice) -> "PressFile | Session":
        if isinstance(index, slice):
            return Session(self._presses[index], self.warnings)
        return self._presses[index]

    def read(
        self, on_read: Callable[[], Any] = lambda: None, *, samples: bool = False
    ) -> "Session":
        """Read and analyse every recording now, and return the session.

        Args:
            on_read: Called after each.
            samples: Whether to keep all samples.

        Raises:
            RecordingError: A file is not a complete recording.
            AnalysisError: A recording holds no press.
        """
        for press in self:
            _ = press.press if samples else press.analysed
            on_read()
        return self

    @property
    def simulated(self) -> bool:
        """Whether the stand-in made any of the presses."""
        return any(press.analysed.press.simulated for press in self)

    @property
    def features(self) -> "pd.DataFrame":
        """One row for each press: session, rig and features in SI units, as in a campaign."""
        import pandas as pd

        frame = pd.DataFrame([row_of(press.analysed, press.path) for press in self])
        frame.attrs = {"units": {name: unit_of(name) for name in frame}}
        return frame

    def to_frame(self) -> "pd.DataFrame":
        """Return the features."""
        return self.features

    def compare(
        self,
        against: "Session | str | Path | None" = None,
        *,
        rig: Rig | schema.Rig | str | Path | None = None,
        level: str = "elastica",
    ) -> Comparison:
        """Compare the presses with the model, with each other, and with those of another set.

        Presses of different rigs, scenes or days are not pooled: each is a condition of its own.

        Args:
            against: The other set.
            rig: The bench to predict with; None for that of each recording.
            level: Of the plectrum's bending model.

        Raises:
            AnalysisError: There is no press, or the sets have no condition in common.
        """
        bench = None if rig is None else Rig(rig).values
        found = analyse([press.analysed for press in self], level, bench)
        if against is None:
            return Comparison(found)
        other = against if isinstance(against, Session) else open(against)
        others = analyse([press.analysed for press in other], level, bench)
        return Comparison(found, side_by_side(found, others))

    def identify(
        self,
        names: Sequence[str],
        priors: Sequence[str] = (),
        *,
        level: str = "elastica",
        starts: int = 3,
        robust: bool = False,
    ) -> Fit:
        """Fit unknown values of the rig to the presses, without those for warm-up.

        Args:
            names: Parameters to fit: `["plectrum.overlap", "key.inertia"]`.
            priors: Prior knowledge: `"key.inertia=7e-4 kg m^2 +- 1e-4 kg m^2"`, or bounds:
                `"plectrum.overlap=0.1 mm to 0.5 mm"`.
            level: Of the plectrum's bending model.
            starts: Number of starting points.
            robust: Weight large residuals linearly instead of quadratically.

        Raises:
            AnalysisError: There is no press, no parameter, or the presses are of different rigs.
            ModelError: The model has no solution for the rig's values.
        """
        own = [p for p in self if p.press and not p.info.warm_up]
        presses, phases = [p.press for p in own], [p.phases for p in own]
        values = what_is_alike([p.analysed for p in own])
        keys = {key.partition(".")[0] for other in values for key in differing(values[0], other)}
        mixed = sorted(keys & {"day", "scene"})
        return fitted(
            presses, phases, names, priors, mixed, level=level, starts=starts, robust=robust
        )

    def plot(self) -> "Figure":
        """Return a figure with a row for each press, at most eight: force, speed, phases."""
        from sautereau.analysis.figures.phases import phases_figure

        return shown(phases_figure([p.press for p in self], [p.phases for p in self]))


def open(what: "str | Path | Iterable[str | Path]", *, folder: str | Path | None = None) -> Session:
    """Open recordings; they are read when they are used.

    Args:
        what: A recording, a folder (of one session: its manifest excludes others), a pattern
            such as `monday/*.mcap`, a table of `sautereau campaign`, or several of these.
        folder: Folder of the recordings of a campaign's table; None for that of the table.

    Raises:
        AnalysisError: There is no recording.
    """
    if not isinstance(what, str | Path):
        parts = [open(part, folder=folder) for part in what]
        return Session([p for part in parts for p in part], [w for s in parts for w in s.warnings])
    path, warnings = Path(what), []
    if path.is_dir():
        found, warnings = recordings_in(path)
    elif path.suffix == ".parquet":
        from sautereau.analysis.campaign.table import read_campaign

        home = path.parent if folder is None else Path(folder)
        found = [home / source.path for source in read_campaign(path).sources]
    elif path.exists():
        found = [path]
    else:
        found = [Path(name) for name in sorted(glob(str(what)))]  # noqa: PTH207 (absolute patterns)
    missing = [str(one) for one in found if not one.is_file()]
    if missing or not found:
        raise AnalysisError(
            f"{what}: {f'there is no {missing[0]}' if missing else 'it holds no recording'};"
            " give recordings (NAME.mcap), the folder of a session, or a campaign's table with"
            " the folder of its recordings"
        )
    return Session(found, warnings)


def watch(folder: str | Path, wait: Callable[[float], Any] = time.sleep) -> Iterator[Session]:
    """Yield the session of a folder whenever recordings have arrived, without end.

    A recording that cannot be analysed is omitted, with a warning.

    Args:
        folder: Of the recordings.
        wait: Waits for seconds.

    Raises:
        AnalysisError: There is no such folder.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise AnalysisError(f"{folder}: there is no such folder; give that of the recordings")
    presses: dict[Path, PressFile] = {}
    known: set[Path] = set()
    faults: list[str] = []
    while True:
        names = set(folder.glob("*.mcap"))
        if names - known:
            found, _ = recordings_in(folder)
            for path in found:
                if path not in known:
                    press = PressFile(path)
                    try:
                        _ = press.analysed
                        presses[path] = press
                    except SautereauError as error:
                        faults.append(f"omitted: {path}: {error}")
            known = names
            yield Session(presses.values(), faults)
        wait(PERIOD)


def recordings_in(folder: Path) -> tuple[list[Path], list[str]]:
    """Return the recordings of the session in a folder, and warnings about the others.

    Without a manifest, all recordings of the folder are of one session.
    """
    manifest = read_manifest(folder)
    found = sorted(folder.glob("*.mcap"))
    warnings = [
        f"{path.name} is of an interrupted press; `sautereau recover` makes it readable"
        for path in sorted(folder.glob(f"*.mcap{PART}"))
    ]
    own = []
    for path in found:
        try:
            if manifest is not None and read_session(path).session != manifest.session:
                continue
        except RecordingError:
            pass  # it stays in the list, so that its fault is reported
        own.append(path)
    if len(own) < len(found):
        warnings.append(f"{len(found) - len(own)} recordings in the folder are of other sessions")
    return own, warnings
