"""Files that are part of sautereau: TOML files by name, tables beside modules, and the code."""

import csv
import difflib
import hashlib
import os
from collections.abc import Iterator
from functools import cache
from importlib import resources
from importlib.metadata import version
from pathlib import Path

from sautereau.rig.disk import read_text, why_unreadable
from sautereau.rig.errors import SautereauError

COMPUTING = ("rig", "trajectory", "daq", "analysis")  # Packages that compute results
SOURCES = (".py", ".toml", ".csv", ".proto", ".xml", ".json")
"""File extensions of their code and of the data that it reads, apart from the report's page."""


def named_text(
    name: str | Path, package: str, what: str, error_type: type[Exception]
) -> tuple[str, str, Path]:
    """Read a TOML file.

    Args:
        name: Path of a file, or name of a packaged one.

    Returns:
        The text, the name of the file for messages, and its folder.
    """
    path = Path(name)
    try:
        if path.suffix == ".toml" or path.is_file():
            return read_text(path), str(path), path.parent
    except (OSError, ValueError) as error:  # not UTF-8, or an impossible file name
        raise error_type(
            f"{what} file {path}: cannot be read: {why_unreadable(error)}; give the path"
            " of a UTF-8 text file"
        ) from error
    packaged = resources.files(package).joinpath(f"{name}.toml")
    if not packaged.is_file():
        known = packaged_names(package)
        close = difflib.get_close_matches(str(name), known, n=1)
        meant = f"did you mean {close[0]!r}? If not, " if close else ""
        raise error_type(
            f"{what} {str(name)!r} is neither a file nor a packaged {what} ({', '.join(known)});"
            f" {meant}give the path of a .toml file"
        )
    return packaged.read_text(encoding="utf-8"), f"packaged {what} {name}", Path()


def packaged_names(package: str) -> list[str]:
    """Return the names of the TOML files in a package."""
    files = resources.files(package).iterdir()
    return sorted(file.name[:-5] for file in files if file.name.endswith(".toml"))


def table_beside(module: str) -> list[list[str]]:
    """Return the rows below the head of ``NAME.csv``, for the `__file__` ``NAME.py``."""
    with Path(module).with_suffix(".csv").open(encoding="utf-8", newline="") as file:
        return list(csv.reader(file))[1:]


@cache
def made_by() -> str:
    """Return the version of sautereau and a hash of the code that computes results.

    Two results with the same text were computed by the same code of the packages `COMPUTING`.

    Raises:
        SautereauError: A file of the code cannot be read.
    """
    return f"{version('sautereau')} (code {code_hash(Path(__file__).parents[1])})"


def code_hash(root: Path) -> str:
    """Return 12 hexadecimal digits of the SHA-256 of all `SOURCES` in `COMPUTING`.

    Line ends count as those of Unix, which a checkout on Windows may have changed.

    Args:
        root: Folder with the packages; the installed one and that of the repository are alike.

    Raises:
        SautereauError: A package or a file cannot be read.
    """
    digest = hashlib.sha256()
    try:
        for name in sorted(name for package in COMPUTING for name in _sources(root, package)):
            content = Path(root, name).read_bytes().replace(b"\r\n", b"\n")
            digest.update(b"%s\0%d\0%s" % (name.encode(), len(content), content))
    except OSError as error:
        raise SautereauError(
            f"code of sautereau: {error.filename}: cannot be read: {why_unreadable(error)}; results"
            " state a hash of it: make it readable, or install sautereau again"
        ) from error
    return digest.hexdigest()[:12]


def _sources(root: Path, folder: str) -> Iterator[str]:
    """Yield the names of the `SOURCES` in a folder and its subfolders, separated by /."""
    with os.scandir(root / folder) as entries:
        for entry in entries:
            if entry.is_dir():
                yield from _sources(root, f"{folder}/{entry.name}")
            elif entry.name.endswith(SOURCES):
                yield f"{folder}/{entry.name}"
