"""One pluck by every level of the plectrum: the error of small rotations.

python -m examples.levels [picture.png]
"""

import sys
from pathlib import Path

from sautereau.analysis.figures.pluck import pluck_figure
from sautereau.analysis.model.plectrum.levels import LEVELS
from sautereau.analysis.model.predict import predict
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig


def study(rig: Rig) -> dict[str, float]:
    """Return the pluck duration [s] by level."""
    return {level: predict(rig, level).pluck_duration for level in LEVELS.names()}


def plot(path: str | Path, rig: Rig) -> None:
    """Write the plot of shape, path and force of every level to a file."""
    pluck_figure(rig, LEVELS.names()).savefig(path, dpi=90)


def main() -> None:
    rig = load_rig()
    held = study(rig)
    for level, duration in held.items():
        print(f"{level:9} {duration * 1e3:7.3f} ms {duration / held['elastica'] - 1:+8.2%}")
    if len(sys.argv) > 1:
        plot(sys.argv[1], rig)


if __name__ == "__main__":
    main()
