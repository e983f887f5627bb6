"""Reading the paper's Table 1: what its numbers give in SI units, for docs/table-1.md."""

from pathlib import Path

from examples.paper_numbers import first_mode
from sautereau.rig.schema import Rig

TEXT = Path(__file__).with_suffix(".md.in").read_text(encoding="utf-8")


def page(rig: Rig, day: str) -> str:
    """Return the page, with the day on which it was written."""
    plectrum, string = rig.plectrum, rig.string
    ei = plectrum.bending_stiffness
    return TEXT.format(
        day=day,
        modulus=plectrum.youngs_modulus / 1e9,
        width=plectrum.width * 1e3,
        thickness=plectrum.thickness * 1e3,
        ei=ei,
        tip_stiffness=3 * ei / plectrum.length**3,
        string=string,
        length=string.length * 1e3,
        density=string.linear_density * 1e3,
        wire=string.diameter * 1e3,
        element=string.linear_density * plectrum.width * 1e3,
        b=string.plucking_point / string.length,
        overlap=plectrum.overlap * 1e3,
        first_share=first_mode(rig),
    )
