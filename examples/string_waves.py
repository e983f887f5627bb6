"""The released string: two kinks that separate at the plectrum and return once per period.

python -m examples.string_waves [picture.png]
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sautereau.analysis.model.modal_pluck import ModalPluck, modal_pluck
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig

PLACES, INSTANTS, PERIODS = 201, 400, 2.0


@dataclass(frozen=True)
class Waves:
    time: NDArray[np.float64]
    """s, from release, shape (INSTANTS,)."""
    place: NDArray[np.float64]
    """m, from the nut, shape (PLACES,)."""
    lift: NDArray[np.float64]
    """m, shape (PLACES, INSTANTS)."""
    pluck: ModalPluck

    @property
    def period(self) -> float:
        """s, after half a period, at which the shape is closest to that at release."""
        first = self.lift[:, 0]
        apart = np.linalg.norm(self.lift - first[:, None], axis=0)
        later = len(self.time) // 4 + int(np.argmin(apart[len(self.time) // 4 : -10]))
        return float(self.time[later])


def study(rig: Rig) -> Waves:
    """Pluck the string and follow it for two periods."""
    pluck = modal_pluck(rig)
    time = np.linspace(0, PERIODS / rig.string.frequency, INSTANTS)
    place = np.linspace(0, rig.string.length, PLACES)
    lift = np.stack([pluck.free.motion(time, x)[0][:, 1] for x in place])
    return Waves(time, place, lift, pluck)


def plot(path: str | Path, waves: Waves) -> None:
    """Write the plot of the lift over time and position to a file."""
    figure = Figure(figsize=(8, 4.2), layout="constrained")
    axes = figure.subplots()
    most = float(np.abs(waves.lift).max()) * 1e3
    drawn = axes.pcolormesh(
        waves.time * 1e3, waves.place * 1e3, waves.lift * 1e3,
        cmap="RdBu_r", vmin=-most, vmax=most, rasterized=True,
    )  # fmt: skip
    plucked = waves.pluck.string.string.plucking_point * 1e3
    axes.axhline(plucked, color="#333333", lw=0.8, ls="--")
    axes.annotate("plectrum", (0, plucked), (4, 3), textcoords="offset points", fontsize=9)
    axes.set(xlabel="time after release (ms)", ylabel="position from the nut (mm)")
    figure.colorbar(drawn, label="lift of the string (mm)")
    figure.savefig(path, dpi=110)


def main() -> None:
    waves = study(load_rig())
    print(f"period of the string: {waves.period * 1e3:.3f} ms, {1 / waves.period:.1f} Hz")
    if len(sys.argv) > 1:
        plot(sys.argv[1], waves)


if __name__ == "__main__":
    main()
