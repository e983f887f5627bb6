"""The presses of one or more sessions, also while their recordings arrive."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from sautereau.analysis.campaign.row import row_of, unit_of
from sautereau.analysis.campaign.workers import run_over, worthwhile
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.compliant import fit_presses
from sautereau.analysis.identify.identified import evaluate
from sautereau.analysis.identify.parameters import read_prior
from sautereau.analysis.press.loops import PositionLoops, position_loops
from sautereau.analysis.results.comparison import Comparison
from sautereau.analysis.results.effects import DEFAULT, Effects, effects_of
from sautereau.analysis.results.fit import Fit
from sautereau.analysis.results.result import Shown, shown
from sautereau.analysis.results.rig import Rig
from sautereau.analysis.session.analysed import AnalysedPress
from sautereau.analysis.session.conditions import analyse, differing, what_is_alike
from sautereau.analysis.session.difference import side_by_side
from sautereau.analysis.text import counted, listed
from sautereau.daq.file.reading import read_recording
from sautereau.entrance.found import each, every, recordings_in, recordings_of
from sautereau.entrance.press_file import PressFile
from sautereau.rig import schema
from sautereau.rig.disk import make_folder, sealed, write_durably
from sautereau.rig.errors import SautereauError, require
from sautereau.rig.progress import tracked

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from sautereau.entrance.package import Package
    from sautereau.entrance.report import Report


WORTH_A_PROCESS = 8  # Recordings whose analysis takes longer than the start of a process
PAGE = "report.html"  # Name of the report in the session's folder


class Session(Shown, Sequence[PressFile]):
    """Presses in the order in which they were made; `session[0]` is the first.

    Args:
        presses: Recordings.
        warnings: Warnings about their folder.
        folder: Folder of the session; None for presses of several folders.
    """

    def __init__(
        self,
        presses: Iterable[str | Path | PressFile],
        warnings: Sequence[str] = (),
        folder: Path | None = None,
    ):
        self._presses = [p if isinstance(p, PressFile) else PressFile(p) for p in presses]
        self.warnings, self.folder = tuple(warnings), folder

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

    def read(self, *, samples: bool = False) -> "Session":
        """Read and analyse every recording now, and return the session.

        Args:
            samples: Whether to keep all samples.

        Raises:
            RecordingError: A file is not a complete recording.
            AnalysisError: A recording contains no press. Errors of further recordings are notes.
        """
        every(self, lambda press: press.press if samples else press.partial)
        return self

    def readable(
        self, *, samples: bool = False, processes: int | None = 1
    ) -> "tuple[Session, list[str]]":
        """Read and analyse every recording now, as `read`; return those without a fault.

        Args:
            samples: Whether to keep all samples.
            processes: Processes that analyse the recordings, without samples; None for as many as
                shorten the work, at most one per core. Each imports the program that calls this.

        Returns:
            The presses, and the faults of the other recordings.

        Raises:
            SautereauError: No recording can be analysed.
        """
        if processes is None:
            processes = worthwhile(len(self), WORTH_A_PROCESS)
        if processes > 1 and not samples:
            work = run_over(_analysed, [press.path for press in self], processes)
            for _, (number, one) in zip(tracked(self), work, strict=True):
                if one is not None:  # the others show their fault below
                    vars(self[number])["analysed"] = one
        found, faults = each(
            self, lambda press: (press, press.press if samples else press.analysed)
        )
        presses = [press for press, _ in found]
        return Session(presses, self.warnings, self.folder), [str(error) for _, error in faults]

    @property
    def simulated(self) -> bool:
        """Whether the stand-in made any of the presses."""
        return any(press.analysed.press.simulated for press in self)

    @property
    def position_loops(self) -> PositionLoops | None:
        """Stiffness and damping of the position loops; None without feedback or with torques of a
        feed-forward, which the controller records together with those of the loops."""
        return position_loops(read_recording(press.path) for press in self)

    @property
    def features(self) -> "pd.DataFrame":
        """One row for each press: session, rig and features in SI units, as in a campaign."""
        import pandas as pd

        frame = pd.DataFrame([row_of(press.partial, press.path) for press in self])
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
        level: str = "auto",
    ) -> Comparison:
        """Compare the presses with the model, with each other, and with those of another set.

        Presses of different rigs, scenes or days are not pooled but compared separately.

        Args:
            against: The other set.
            rig: Rig to predict with; None for that of each recording.
            level: Plectrum model.

        Raises:
            AnalysisError: There is no press, or the sets have no condition in common.
            ModelError: There is no such level.
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
        names: Sequence[str] | str,
        priors: Sequence[str] | str = (),
        *,
        level: str = "auto",
        starts: int = 3,
        robust: bool = False,
    ) -> Fit:
        """Fit unknown values of the rig to the presses, except warm-up presses.

        Args:
            names: Parameters to fit: `["plectrum.overlap", "key.inertia"]`, or a text with commas.
            priors: Prior knowledge: `"key.inertia=7e-4 kg m^2 +- 1e-4 kg m^2"`, or bounds:
                `"plectrum.overlap=0.1 mm to 0.5 mm"`.
            level: Plectrum model.
            starts: Number of starting points.
            robust: Weight large residuals linearly instead of quadratically.

        Raises:
            AnalysisError: There is no usable press, no parameter, or the presses are of different
                rigs.
            ModelError: The model has no solution for the rig's values.
        """
        own = [p for p in self if p.press and not p.info.warm_up]
        presses, phases = [p.press for p in own], [p.phases for p in own]
        known = dict(read_prior(text) for text in listed(priors))
        made = fit_presses(presses, phases, listed(names), known, level, starts, robust)
        simulated = any(press.simulated for press in presses)
        values = what_is_alike([p.analysed for p in own])
        keys = {key.partition(".")[0] for other in values for key in differing(values[0], other)}
        mixed = tuple(sorted(keys & {"day", "scene"}))
        warned = tuple(bool(p.analysed.warnings) for p in own)
        return Fit(presses[0].rig, simulated, mixed, made, evaluate(made), warned=warned)

    def effects(
        self, names: Sequence[str] | str = DEFAULT, *, interaction: bool = False
    ) -> Effects:
        """Estimate the effects of the factors in which the presses differ, by a mixed model.

        Args:
            names: Features of a press, or a text with commas; those of string 2 end in `_2`.
            interaction: Whether to estimate the interactions of every two factors.

        Raises:
            AnalysisError: A name is unknown, the presses do not differ, or effects cannot be
                separated.
        """
        presses = [press.analysed for press in self]
        return effects_of(presses, listed(names), interaction=interaction)

    def report(self, out: str | Path | None = None, *, level: str = "auto") -> "Report":
        """Write one HTML page about the presses, which replaces an earlier one.

        Args:
            out: File of the page; None for report.html in the folder of the session.
            level: Plectrum model.

        Raises:
            AnalysisError: No recording can be read, or the presses are of several folders and
                there is no `out`.
            MissingExtraError: A package of the extra `report` is not installed.
        """
        require("report", "report", "jinja2", "plotly")
        from sautereau.entrance.report import Report, page_of

        if out is None and self.folder is None:
            raise AnalysisError(
                "report: the presses were not given as one folder; give the folder of the session,"
                " or the file to write (--out, or `out`)"
            )
        page = Path(out) if out is not None else Path(self.folder or "") / PAGE
        paths = [press.path for press in self]
        text, contents = page_of(paths, self.folder, self.warnings, level)
        make_folder(page.parent)
        write_durably(page, sealed(text), replace=True)
        return Report(page, len(contents.presses), contents.simulated, dict(contents.unread))

    def package(
        self,
        out: str | Path | None = None,
        *,
        licence: str = "",
        authors: Sequence[str] = (),
        processes: int | None = 1,
    ) -> "Package":
        """Pack the session's folder as one archive for a repository, described as an RO-Crate 1.1.

        Args:
            out: ZIP file; None for the name of the folder with .zip, beside it.
            licence: Address (https) of the licence; empty for none.
            authors: Their names, or addresses of their ORCID.
            processes: As of `readable`.

        Raises:
            AnalysisError: The presses are not of one folder, or the archive does not read back.
            OSError: The archive cannot be written, or exists already.
        """
        from sautereau.entrance.package import package_of, write_package

        if self.folder is None:
            raise AnalysisError(
                "package: the presses were not given as one folder; open the folder of the session"
            )
        read, faults = self.readable(processes=processes)
        made = write_package(
            self.folder,
            Path(out) if out else package_of(self.folder),
            [press.path for press in self],
            [press.analysed for press in read],
            read.features,
            licence,
            authors,
        )
        return replace(made, left_out=tuple(faults))

    def plot(self) -> "Figure":
        """Return a figure with a row for each press, at most eight: force, speed, phases."""
        from sautereau.analysis.figures.phases import phases_figure

        return shown(phases_figure([p.press for p in self], [p.phases for p in self]))


def _analysed(path: Path) -> AnalysedPress | None:
    """Return a press without most samples; None if it cannot be analysed."""
    try:
        return PressFile(path).analysed
    except SautereauError:
        return None


def open(what: "str | Path | Iterable[str | Path]", *, folder: str | Path | None = None) -> Session:
    """Open recordings. They are read when they are used.

    Args:
        what: A recording, a folder (of one session: its manifest excludes others; without warm-up
            presses), a pattern such as `monday/press-*.mcap`, a table of `sautereau campaign`, or
            several of these.
        folder: Folder of the recordings of a campaign's table; None for that of the table.

    Raises:
        AnalysisError: Lists the parts of `what` without a recording; or there is no part.
    """
    parts = [what] if isinstance(what, str | Path) else list(what)
    found, faults = [], [] if parts else ["open: no recording was given; give files or folders"]
    for part in parts:
        try:
            found.append(recordings_of(part, folder))
        except AnalysisError as error:
            faults.append(str(error))
    if faults:
        raise AnalysisError("\n".join(faults))
    home = Path(parts[0]) if len(parts) == 1 and Path(parts[0]).is_dir() else None
    paths = [path for some, _ in found for path in some]
    return Session(paths, [warning for _, some in found for warning in some], home)


def watch(folder: str | Path, wait: Callable[[float], Any] = time.sleep) -> Iterator[Session]:
    """Return an endless iterator that gives the session of a folder whenever recordings arrive.

    A recording that cannot be analysed is omitted, with a warning.

    Args:
        folder: Folder of the recordings.
        wait: Waits for seconds.

    Raises:
        AnalysisError: It is not a folder.
    """
    folder = Path(folder)
    if not folder.is_dir():
        fault = "this is not a folder" if folder.exists() else "there is no such folder"
        raise AnalysisError(f"{folder}: {fault}; give the folder of the recordings")
    return _sessions(folder, wait)


def _sessions(folder: Path, wait: Callable[[float], Any]) -> Iterator[Session]:
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
        wait(0.5)
