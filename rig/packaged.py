"""Files that are part of sautereau: TOML files by path or name, and tables beside modules."""

import csv
import difflib
from importlib import resources
from pathlib import Path

from sautereau.rig.disk import read_text, why_unreadable


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


def table_beside(module: str | Path) -> list[list[str]]:
    """Return the rows below the head of ``NAME.csv``, for the `__file__` ``NAME.py``."""
    with Path(module).with_suffix(".csv").open(encoding="utf-8", newline="") as file:
        return list(csv.reader(file))[1:]
