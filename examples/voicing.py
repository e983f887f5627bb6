"""Voicing: from a photograph of a plectrum to what to carve from it.

The micrograph is drawn by `benchmarks.micrographs`, 6 um a pixel, tilted, noisy and unevenly lit.
`sautereau outline` finds the plectrum in it; `sautereau voice` proposes what to take from its
underside, so that the force drops by a quarter less.

python -m examples.voicing [outline.png [voicing.png]]
"""

import math
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.micrographs import Camera, carved, draw
from sautereau.analysis.model.predict import predict
from sautereau.analysis.outline.carve import Knife
from sautereau.analysis.results.outlined import Outlined, outline
from sautereau.analysis.results.prediction import quantities
from sautereau.analysis.results.voiced import Voiced, voice
from sautereau.rig.instrument import Outline
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig

CAMERA = Camera(pixel=6e-3, tilt=math.radians(4), light=(0.3, -0.2, 0.2), noise=0.03)
SOFTER = 0.75  # Requested force drop over the present one


def photographed() -> Outlined:
    """Return the outline in a micrograph; the scale is known to 0.1 %."""
    drawn = draw(carved(np.random.default_rng(6)), CAMERA)
    with tempfile.TemporaryDirectory() as folder:
        photo = drawn.save(Path(folder) / "plectrum.png")
        return outline(photo, pixels_per_mm=f"{1 / CAMERA.pixel} +/- {1e-3 / CAMERA.pixel}")


def rig_of(found: Outlined) -> Rig:
    """Return the paper's rig with the photographed plectrum, without its ensemble."""
    rig, edges = load_rig(), found.found.edges
    named = {name: tuple(getattr(edges, name).tolist()) for name in ("x", "top", "bottom")}
    plectrum = rig.plectrum.outlined(Outline.model_construct(**named))
    return rig.model_copy(update={"plectrum": plectrum.replaced({"contact": "surface"})})


def study() -> Voiced:
    """Return what to carve for `SOFTER`."""
    rig = rig_of(photographed())
    (present,) = quantities(rig, predict(rig, "fe"), ("force_drop",))
    return voice(rig, [f"force_drop {SOFTER * present} N"], knife=Knife(stroke=1.5e-3))


def main() -> None:
    found = photographed()
    print(found)
    if len(sys.argv) > 1:
        found.plot().savefig(sys.argv[1], dpi=100)
    carved_for = study()
    print(carved_for)
    if len(sys.argv) > 2:
        carved_for.plot().savefig(sys.argv[2], dpi=100)


if __name__ == "__main__":
    main()
