"""The bench of some presses."""

from dataclasses import dataclass

from sautereau.rig.schema import Rig


@dataclass(frozen=True)
class Bench:
    """The bench of some presses, real or simulated."""

    rig: Rig
    """The rig, with the addresses in use."""
    scene: str = ""
    """The stand-in's scene as text; empty on the hardware."""
    seed: int | None = None
    """Seed of the stand-in's random numbers."""
