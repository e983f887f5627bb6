"""Iterative learning control of a compliant servo, from its own recordings.

The planned jack speed is 0.072 m/s. In the first press the string slows the jack; each later press
is planned with a correction from the recording before.

python -m examples.learning [picture.png]
"""

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from sautereau.analysis.figures.palette import DASHES, OTHER, SERIES
from sautereau.analysis.loading.press import Press, load_press
from sautereau.rig.load import load_rig
from sautereau.robot.controller import motion_controller
from sautereau.robot.experiment.learning import IterativeLearning
from sautereau.robot.experiment.session import make_presses
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.timing import press_law


@dataclass(frozen=True)
class Learning:
    errors: list[float]
    """Dimensionless, RMS error of the jack's speed in the cruise, press by press."""
    first: Press
    best: Press


def study(n: int = 4, seed: int = 1) -> Learning:
    """Simulate learning over at most n presses."""
    rig = load_rig()
    learning = IterativeLearning(rig, None, n)
    with tempfile.TemporaryDirectory() as out, StandIn(rig, load_scene("paper"), seed) as served:
        paths = make_presses(
            motion_controller(served.rig),
            Path(out),
            learning.presses_on(served.rig),
            on_press=learning.update,
        )
        best = min(range(len(paths)), key=learning.errors.__getitem__)
        return Learning(learning.errors, load_press(paths[0]), load_press(paths[best]))


def plot(path: str | Path, studied: Learning) -> None:
    """Plot the jack's speed before and after learning into a file."""
    figure = Figure(figsize=(8, 4.2), layout="constrained")
    axes = figure.subplots()
    law = press_law(studied.first.rig.press)
    start, end = law.cruise_start - 0.01, law.cruise_end + 0.01
    for press, label, colour, dashes in (
        (studied.first, f"first press: {100 * studied.errors[0]:.2g} % RMS", SERIES[1], DASHES[1]),
        (studied.best, f"best press: {100 * min(studied.errors):.2g} % RMS", SERIES[0], DASHES[0]),
    ):
        speed = press.data["jack_speed"].loc[start:end].rolling(51, center=True).mean()
        axes.plot(speed.index * 1e3, speed * 1e3, color=colour, ls=dashes, label=label, lw=1.2)
    planned = studied.first.rig.press.jack_speed * 1e3
    axes.axhline(planned, color=OTHER, ls=":", lw=1, label="planned")
    axes.set(ylim=(0.7 * planned, 1.15 * planned), xlabel="time after the trigger (ms)")
    axes.set_ylabel("jack speed (mm/s), 1 ms moving average")
    axes.set_title("simulated on the stand-in", fontsize=10)
    axes.legend(loc="lower right", frameon=False)
    figure.savefig(path, dpi=110)


def main() -> None:
    studied = study()
    for number, error in enumerate(studied.errors, 1):
        print(f"press {number}: {error:.2%}")
    if len(sys.argv) > 1:
        plot(sys.argv[1], studied)


if __name__ == "__main__":
    main()
