"""The session of a folder while its recordings arrive."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from sautereau.analysis.errors import AnalysisError
from sautereau.entrance.found import recordings_in
from sautereau.entrance.press_file import PressFile
from sautereau.entrance.session import Session
from sautereau.rig.errors import SautereauError

PERIOD = 0.5  # s, between two looks into a watched folder


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
        wait(PERIOD)
