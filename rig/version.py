"""The version of sautereau and a hash of the code that computes its results."""

import hashlib
import os
from collections.abc import Iterator
from functools import cache
from importlib.metadata import version
from pathlib import Path

from sautereau.rig.disk import why_unreadable
from sautereau.rig.errors import SautereauError

COMPUTING = ("rig", "trajectory", "daq", "analysis")  # Packages that compute results
SOURCES = (".py", ".toml", ".csv", ".proto", ".xml", ".json")
"""File extensions of their code and of the data that it reads, apart from the report's page."""


@cache
def made_by() -> str:
    """Return the version of sautereau and a hash of the code that computes results.

    Two results with the same text were computed by the same code of the packages `COMPUTING`.

    Raises:
        SautereauError: A file of the code cannot be read.
    """
    return f"{version('sautereau')} (code {code_hash(Path(__file__).parents[1])})"


def code_hash(root: Path, packages: tuple[str, ...] = COMPUTING) -> str:
    """Return 12 hexadecimal digits of the SHA-256 of all `SOURCES` in some packages.

    Line ends count as those of Unix, which a checkout on Windows may have changed.

    Args:
        root: Folder with the packages; the installed one and that of the repository are alike.

    Raises:
        SautereauError: A package or a file cannot be read.
    """
    digest = hashlib.sha256()
    try:
        for name in sorted(name for package in packages for name in _sources(root, package)):
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
