"""What a scene costs by a fixed rule, so that a choice never depends on how fast a machine is."""

from sautereau.rig.schema import Rig
from sautereau.sim_backend.scene import Scene

STEP = {"rigid": 10e-6, "reduced": 1e-6}
"""s, of one step of an engine with one choir; measured on one machine, once."""
SAMPLE = {"rigid": 50e-6, "reduced": 25e-6}
"""s, of what comes with every controller sample."""
FINGER = {"push": 0.0, "ideal": 100e-6, "servo": 100e-6}
"""s, of the finger's reference in every controller sample."""
MODAL = 10e-6
"""s, of one step of a modal string and its plectrum."""


def cost(rig: Rig, scene: Scene, steps: int) -> float:
    """Return the time [s] for each simulated second.

    Args:
        rig: The bench as it is in the scene.
        scene: With its engine and string settled.
        steps: In a controller sample.
    """
    step = STEP[scene.engine]
    if scene.string == "modal":
        step += MODAL * (1 + len(rig.more_choirs))
    sample = steps * step + SAMPLE[scene.engine] + FINGER[scene.finger]
    return sample / rig.controller.sample_period
