"""A session on the stand-in, compared with the model, like `make press`.

Driver and acquisition are those of the hardware, with the addresses of the stand-in.

python -m examples.session [picture.png]
"""

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from sautereau.analysis.figures.comparison import comparison_figure
from sautereau.analysis.loading.press import Press, load_press
from sautereau.analysis.model.predict import Prediction, predict
from sautereau.analysis.phases import Phases, find_phases
from sautereau.analysis.session.compare import Comparison, compare, predict_each
from sautereau.rig.load import load_rig
from sautereau.robot.drivers.registry import motion_controller
from sautereau.robot.experiment.session import run_session
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.press import plan_press


@dataclass(frozen=True)
class Session:
    presses: list[Press]
    phases: list[Phases]
    prediction: Prediction
    comparison: Comparison
    true_contacts: list[float]
    """Contact in the simulation, s after the trigger."""


def study(n: int = 3, scene: str = "paper", seed: int = 1) -> Session:
    """Make n presses on the stand-in, and compare them with the model."""
    rig = load_rig()
    with tempfile.TemporaryDirectory() as out, StandIn(rig, load_scene(scene), seed) as served:
        bench = served.rig
        paths = run_session(bench, plan_press(bench), motion_controller(bench), Path(out), n)
        presses = [load_press(path) for path in paths]
        contacts = [truth.contacts[0] for truth in served.truth()]
    phases = [find_phases(press) for press in presses]
    prediction = predict(rig)
    return Session(
        presses, phases, prediction, compare(phases, predict_each(presses, phases, rig)), contacts
    )


def plot(path: str | Path, studied: Session) -> None:
    """Save a plot of force and deflection with phases and model to a file."""
    figure = comparison_figure(studied.presses, studied.phases, studied.prediction)
    figure.savefig(path, dpi=120)


def main() -> None:
    studied = study()
    for phases, truth in zip(studied.phases, studied.true_contacts, strict=True):
        (held,) = phases.plucks
        print(f"contact at {held.contact * 1e3:.3f} ms, true value {truth * 1e3:.3f} ms")
    error = studied.comparison.duration_error.value
    print(f"pluck duration, model error (model - measured) / measured: {error:+.2%}")
    if len(sys.argv) > 1:
        plot(sys.argv[1], studied)


if __name__ == "__main__":
    main()
