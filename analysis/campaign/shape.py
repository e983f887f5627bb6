"""A plectrum's shape as numbers, and which of them a campaign can distinguish.

The compliances are those of a beam with the section's own stiffness EI(x) = E W h(x)^3 / 12, for
small rotations: a force at s moves the section there by the integral of (s - x)^2 / EI(x) from the
clamp to s.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from sautereau.analysis.model.plectrum.profile import profile_of
from sautereau.rig.instrument import Plectrum
from sautereau.trajectory.motion import Floats

if TYPE_CHECKING:
    import pandas as pd

DESCRIPTORS = {
    "tip_thickness": "m",
    "taper": "1",
    "tip_compliance": "m/N",
    "contact_compliance": "m/N",
}  # What follows from the outline, or from the thicknesses without one, with units
PLECTRUM = {
    "length": "m",
    "width": "m",
    "thickness": "m",
    "overlap": "m",
    "youngs_modulus": "Pa",
    "bending_stiffness": "N m^2",
    "friction": "1",
    **DESCRIPTORS,
}  # Numbers of a plectrum, with their units
SHAPE = tuple(
    f"plectrum_{name}"
    for name in ("length", "width", "thickness", "tip_thickness", "overlap", "youngs_modulus")
)  # Columns of a plectrum's shape and material. Those that vary get an exponent
CONDITIONS = ("jack_speed", "string_stiffness")  # Change a plectrum's touch; get an exponent
LEAST_RANGE = 1e-6  # Range of a column's logarithm below which the column counts as constant


def numbers_of(plectrum: Plectrum) -> dict[str, float]:
    """Return the numbers of `PLECTRUM`, SI.

    Thickness and bending stiffness are those at the clamp. The tip's thickness is the mean over the
    last tenth of the length, and the taper is by how much less that is, over the length.

    Raises:
        ModelError: The outline is not as long as the plectrum.
    """
    profile, length = profile_of(plectrum), plectrum.length
    clamp = plectrum.clamp_thickness
    root = plectrum.modulus * plectrum.width * clamp**3 / 12

    def integral(function: Callable[[Floats, Floats], Floats], low: float, high: float) -> float:
        """Return that of a function of place and thickness, in lengths; exact for constant h."""
        inside = profile.x[(profile.x > low) & (profile.x < high)]
        nodes, weights = np.polynomial.legendre.leggauss(16)
        ends = np.concatenate([[low], inside, [high]])
        half = np.diff(ends)[:, None] / 2
        x = ends[:-1, None] + half * (1 + nodes)
        return float(np.sum(half * weights * function(x, np.subtract(*profile.edges(x)))))

    def compliance(s: float) -> float:
        bent = integral(lambda x, h: (s - x) ** 2 * (profile.clamp_thickness / h) ** 3, 0.0, s)
        return bent * length**3 / root

    # Over the last tenth, for the tip may be rounded.
    taper = integral(lambda _, h: profile.clamp_thickness - h, 0.9, 1.0) / 0.1
    values = {name: getattr(plectrum, name) for name in ("length", "width", "overlap", "friction")}
    return values | {
        "youngs_modulus": plectrum.modulus,
        "thickness": clamp,
        "bending_stiffness": root,
        "tip_thickness": clamp - taper * length,
        "taper": taper,
        "tip_compliance": compliance(1.0),
        "contact_compliance": compliance(1 - plectrum.overlap / length),
    }


def logs(presses: "pd.DataFrame", columns: tuple[str, ...]) -> dict[str, Floats]:
    """Return the logarithms of the columns that vary, each minus its mean.

    A tip that is in proportion to the thickness at the clamp is no column of its own.
    """
    found = {name: np.log(presses[name].to_numpy(float)) for name in columns if name in presses}
    ends = [found.get(f"plectrum_{name}", np.zeros(1)) for name in ("tip_thickness", "thickness")]
    if np.ptp(ends[0] - ends[1]) <= LEAST_RANGE:
        found.pop("plectrum_tip_thickness", None)
    return {name: v - v.mean() for name, v in found.items() if np.ptp(v) > LEAST_RANGE}


def not_identifiable(shape: dict[str, Floats], conditions: dict[str, Floats], plectra: int) -> str:
    """Return why exponents of the shape are not identifiable; empty if they are."""
    if not shape:
        return (
            "all plectra have the same shape, so its exponents are not identifiable; press plectra"
            " of other shapes"
        )
    if plectra < len(shape) + 2:
        return (
            f"{plectra} plectra that differ in {', '.join(shape)} are too few for exponents, which"
            f" need {len(shape) + 2}; press more plectra"
        )
    if collinear(shape | conditions):
        return (
            f"{', '.join(shape | conditions)} vary together, so their exponents are not"
            " identifiable; press plectra that differ in one of them alone"
        )
    return ""


def collinear(columns: dict[str, Floats]) -> bool:
    """Return whether columns are linearly dependent."""
    if not columns:
        return False
    matrix = np.column_stack(list(columns.values()))
    singular = np.linalg.svd(matrix / np.linalg.norm(matrix, axis=0), compute_uv=False)
    # Else they are collinear, and their exponents are not identifiable.
    return bool(singular[-1] <= 1e-3 * singular[0])
