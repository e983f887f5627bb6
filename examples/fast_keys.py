"""Up to which jack speed the held string is a spring.

The model treats the held string as a spring, which is accurate while the jack is slow. A string of
30 modes includes the waves that run to the nut and back while the plectrum lifts it.

python -m examples.fast_keys [picture.png]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from sautereau.analysis.figures.palette import GRID, MEASURED, OTHER
from sautereau.analysis.model.modal_pluck import modal_pluck
from sautereau.analysis.model.predict import rig_pluck
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig

SPEEDS = (0.02, 0.03, 0.05, 0.072, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7, 0.85, 1.0)
"""m/s, of the jack."""


def study(rig: Rig, speeds: tuple[float, ...] = SPEEDS) -> dict[float, float]:
    """Return the relative error of the spring string's pluck duration by jack speed."""
    height = rig_pluck(rig).release_height
    return {speed: height / speed / _held(rig, speed) - 1 for speed in speeds}


def _held(rig: Rig, speed: float) -> float:
    return modal_pluck(rig.replaced({"press.jack_speed": speed})).release


def plot(path: str | Path, studied: dict[float, float]) -> None:
    """Write the plot of the error over the jack speed to a file."""
    figure = Figure(figsize=(8, 4.2), layout="constrained")
    axes = figure.subplots()
    axes.axhline(0, color=OTHER, lw=0.8)
    axes.axvspan(0.02, 0.1, color=GRID, label="error below 0.3 %")
    axes.semilogx(list(studied), 100 * np.array(list(studied.values())), "o-", color=MEASURED)
    axes.set_xticks([0.02, 0.05, 0.1, 0.2, 0.5, 1.0], ["0.02", "0.05", "0.1", "0.2", "0.5", "1"])
    axes.minorticks_off()
    axes.set_xlabel("jack speed (m/s)")
    axes.legend(loc="lower left")
    axes.set_ylabel("error of the pluck duration,\n(spring - modes) / modes (%)")
    figure.savefig(path, dpi=110)


def main() -> None:
    studied = study(load_rig())
    for speed, error in studied.items():
        print(f"{speed:6.3f} m/s {error:+8.2%}")
    if len(sys.argv) > 1:
        plot(sys.argv[1], studied)


if __name__ == "__main__":
    main()
