"""Recordings that paths, patterns and tables name; work on several, of which some may be faulty."""

from collections.abc import Callable, Sequence
from glob import glob
from pathlib import Path
from typing import TypeVar

from sautereau.analysis.errors import AnalysisError
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.durable import PART
from sautereau.daq.file.reading import read_session
from sautereau.rig.errors import SautereauError
from sautereau.rig.progress import tracked
from sautereau.robot.experiment.session import WARM_UPS
from sautereau.robot.experiment.session_folder import read_manifest


def recordings_of(what: str | Path, folder: str | Path | None) -> tuple[list[Path], list[str]]:
    """Return the recordings that a path names, and warnings; see `sautereau.open`.

    Raises:
        AnalysisError: There is no recording.
    """
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
        there = "it contains no recording" if path.is_dir() else "there is no such file or folder"
        raise AnalysisError(
            f"{what}: {f'there is no file {missing[0]}' if missing else there};"
            " give recordings (NAME.mcap), the folder of a session, or a campaign's table with"
            " the folder of its recordings"
        )
    return found, warnings


def recordings_in(folder: Path) -> tuple[list[Path], list[str]]:
    """Return the recordings of the session in a folder, and warnings about the others.

    Without a manifest, all recordings of the folder are of one session. Warm-up presses are
    omitted.
    """
    manifest = read_manifest(folder)
    found = sorted({*folder.glob("*.mcap")} - {*folder.glob(WARM_UPS)})
    warnings = [
        f"{path.name} is from an interrupted press; `sautereau recover` makes it readable"
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
        warnings.append(f"{len(found) - len(own)} recordings in the folder are from other sessions")
    return own, warnings


Item = TypeVar("Item")
Result = TypeVar("Result")


def each(
    items: Sequence[Item], work: Callable[[Item], Result]
) -> tuple[list[Result], list[tuple[Item, SautereauError]]]:
    """Do some work on every item; return the results, and the items without one with their errors.

    Raises:
        SautereauError: No item has a result: that of the first, with the others as notes.
    """
    results: list[Result] = []
    faults: list[tuple[Item, SautereauError]] = []
    for item in tracked(items):
        try:
            results.append(work(item))
        except SautereauError as error:
            faults.append((item, error))
    if faults and not results:
        raise _together(faults)
    return results, faults


def every(items: Sequence[Item], work: Callable[[Item], Result]) -> list[Result]:
    """Do some work on every item, and return the results.

    Raises:
        SautereauError: Of the first item without a result, with those of the others as notes.
    """
    results, faults = each(items, work)
    if faults:
        raise _together(faults)
    return results


def _together(faults: Sequence[tuple[object, SautereauError]]) -> SautereauError:
    first = faults[0][1]
    for _, error in faults[1:]:
        first.add_note(str(error))
    return first
