"""Make every plot of the handbook, each by its example.

python -m examples.gallery FOLDER [NAME ...]
"""

import sys
from collections.abc import Callable
from pathlib import Path

from examples import (
    bench,
    clamping,
    fast_keys,
    learning,
    levels,
    plectra,
    pluck,
    session,
    string_waves,
    voicing,
)
from sautereau.rig.load import load_rig


def pictures() -> dict[str, Callable[[Path], None]]:
    """Return the functions that draw the plots, by the name of the file."""
    rig = load_rig()
    return {
        "session.png": lambda path: session.study(picture=path),
        "levels.png": lambda path: levels.plot(path, rig),
        "outline.png": lambda path: voicing.photographed().plot().savefig(path, dpi=100),
        "voicing.png": lambda path: voicing.study().plot().savefig(path, dpi=100),
        "fast_keys.png": lambda path: fast_keys.plot(path, fast_keys.study(rig)),
        "string_waves.png": lambda path: string_waves.plot(path, string_waves.study(rig)),
        "clamping.png": lambda path: clamping.plot(path, rig, clamping.study(rig)),
        "learning.png": lambda path: learning.plot(path, learning.study()),
        "effects.png": lambda path: plectra.study().plot().savefig(path, dpi=100),
        "bench.png": lambda path: bench.plot(path, rig),
        "pluck.gif": lambda path: pluck.plot(path, pluck.study()),
    }


def main() -> None:
    folder, *names = sys.argv[1:]
    draws = pictures()
    for name in names or draws:
        path = Path(folder) / name
        draws[name](path)
        print(path)


if __name__ == "__main__":
    main()
