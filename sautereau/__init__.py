"""Robot experiments on keyboard instruments, from the motor to the fitted model.

    import sautereau as st

    rig = st.Rig("my-rig.toml")
    with st.stand_in(rig, scene="paper", seed=1) as bench:
        session = bench.press(5, out="monday")
    print(session.compare())

Names are imported when they are first used. In the repository, the folders beside this one are its
subpackages: `rig/` is imported as `sautereau.rig`, and likewise trajectory, daq, analysis,
sim_backend and robot.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sautereau.analysis.results.comparison import Comparison as Comparison
    from sautereau.analysis.results.fit import Fit as Fit
    from sautereau.analysis.results.plan import Plan as Plan
    from sautereau.analysis.results.prediction import Prediction as Prediction
    from sautereau.analysis.results.rig import Rig as Rig
    from sautereau.analysis.results.sweep import Sweep as Sweep
    from sautereau.entrance.bench import Bench as Bench
    from sautereau.entrance.bench import bench as bench
    from sautereau.entrance.bench import stand_in as stand_in
    from sautereau.entrance.press_file import PressFile as PressFile
    from sautereau.entrance.session import Session as Session
    from sautereau.entrance.session import open as open
    from sautereau.entrance.session import watch as watch
    from sautereau.robot.experiment.design import design as design
    from sautereau.robot.experiment.steps import ask as ask
    from sautereau.robot.experiment.steps import press as press
    from sautereau.robot.experiment.steps import repeat_until as repeat_until
    from sautereau.robot.experiment.steps import scan as scan

    __version__: str

_NAMES = {
    "entrance.bench": ("Bench", "bench", "stand_in"),
    "analysis.results.comparison": ("Comparison",),
    "analysis.results.fit": ("Fit",),
    "analysis.results.plan": ("Plan",),
    "analysis.results.prediction": ("Prediction",),
    "analysis.results.rig": ("Rig",),
    "entrance.press_file": ("PressFile",),
    "entrance.session": ("Session", "open", "watch"),
    "analysis.results.sweep": ("Sweep",),
    "robot.experiment.design": ("design",),
    "robot.experiment.steps": ("ask", "press", "repeat_until", "scan"),
}
"""Names of the entrance by their modules."""


def __getattr__(name: str) -> object:
    for module, names in _NAMES.items():
        if name in names:
            found = globals()[name] = getattr(import_module(f"sautereau.{module}"), name)
            return found
    if name == "__version__":
        from importlib.metadata import version

        return version("sautereau")
    raise AttributeError(f"module 'sautereau' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(
        [*globals(), "__version__", *(name for names in _NAMES.values() for name in names)]
    )
