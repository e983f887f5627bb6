"""The bench drawn to scale, at rest and pressed: what `plan --bench` draws.

python -m examples.bench picture.png
"""

import sys
from pathlib import Path

from sautereau.analysis.figures.bench import bench_figure
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig
from sautereau.trajectory.press import plan_press


def plot(path: str | Path, rig: Rig) -> None:
    """Plot arm, key, jack and string into a file."""
    bench_figure(rig, plan_press(rig)).savefig(path, dpi=120)


if __name__ == "__main__":
    plot(sys.argv[1], load_rig())
