"""Sizes of the installation and of what each extra adds, as the table of docs/installation.md.

`python docs/sizes.py` adds up the files of the packages that are installed here.
"""

import sys
from importlib import metadata

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

PROJECT = "sautereau"


def needed(name: str, extras: frozenset[str]) -> dict[str, metadata.Distribution]:
    """Return a package and everything that it needs with these extras, by name.

    Raises:
        PackageNotFoundError: One of them is not installed.
    """
    found = {canonicalize_name(name): metadata.distribution(name)}
    waiting, seen = [(name, extras)], set()
    while waiting:
        name, extras = waiting.pop()
        if (name, extras) in seen:
            continue
        seen.add((name, extras))
        for text in metadata.requires(name) or ():
            one = Requirement(text)
            if one.marker is None or any(one.marker.evaluate({"extra": e}) for e in extras | {""}):
                found[canonicalize_name(one.name)] = metadata.distribution(one.name)
                waiting.append((one.name, frozenset(one.extras)))
    return found


def size(packages: dict[str, metadata.Distribution]) -> float:
    """Return the size of the files of packages in MB, without compiled bytecode."""
    files = [f.locate() for package in packages.values() for f in package.files or ()]
    return sum(f.stat().st_size for f in files if f.suffix != ".pyc" and f.is_file()) / 1e6


def main() -> None:
    base = needed(PROJECT, frozenset())
    sys.stdout.write(f"without extras: {size(base):.0f} MB\n")
    for extra in metadata.metadata(PROJECT).get_all("Provides-Extra") or ():
        try:
            more = needed(PROJECT, frozenset({extra}))
            added = {name: more[name] for name in more.keys() - base.keys()}
            sys.stdout.write(f"{extra}: {size(added):.1f} MB\n")
        except metadata.PackageNotFoundError as error:
            sys.stdout.write(f"{extra}: {error.name} is not installed\n")


if __name__ == "__main__":
    main()
