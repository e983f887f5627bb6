"""Cost of the parts of a scene; a disabled part costs nothing."""

import time

from benchmarks.figures import Figure
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig
from sautereau.sim_backend.physics.drive import drive_of
from sautereau.sim_backend.physics.world import new_world
from sautereau.sim_backend.scene import Scene, load_scene

RUNS = 9
FREE = {"plectrum": "none", "string": "none", "friction": False, "felt": False}
FREE |= {"tongue": False, "damper": False}
STRING = {"plectrum": "elastica", "string": "spring"}
PARTS = {
    "string": STRING,
    "modal string": STRING | {"string": "modal"},
    "friction": {"friction": True},
    "felt": {"felt": True},
    "string, tongue and damper": STRING | {"tongue": True, "damper": True},
}
"""Added one at a time to a free key under an ideal finger."""


def run() -> list[Figure]:
    """Return the time per controller sample with each part, beside that of the free key."""
    rig, ideal = load_rig(), load_scene("ideal")
    free = ideal.model_copy(update=FREE)
    least = _sample(rig, free)
    figures = []
    for name, parts in PARTS.items():
        spent = _sample(rig, free.model_copy(update=parts))
        what = f"ideal finger with {name}: a controller sample"
        figures.append(Figure(what, spent * 1e6, "us", "free key", least * 1e6))
    return figures


def _sample(rig: Rig, scene: Scene) -> float:
    """Return the smallest mean time [s] per controller sample of a press."""
    drive = drive_of(rig, scene)
    references = [drive.reference(i) for i in range(drive.samples)]
    times = []
    for _ in range(RUNS):
        world = new_world(rig, scene, drive.start)
        start = time.perf_counter()
        for reference in references:
            world.advance(reference, True)
        times.append(time.perf_counter() - start)
    return min(times) / drive.samples
