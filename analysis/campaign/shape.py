"""Regressors of touch: the plectrum's shape and the conditions of the presses."""

from typing import TYPE_CHECKING

import numpy as np

from sautereau.trajectory.motion import Floats

if TYPE_CHECKING:
    import pandas as pd

SHAPE = (
    "plectrum_length",
    "plectrum_width",
    "plectrum_thickness",
    "plectrum_overlap",
    "plectrum_youngs_modulus",
)
"""Columns of a plectrum's shape and material. Those that vary get an exponent."""
CONDITIONS = ("jack_speed", "string_stiffness")
"""Columns that change the touch of a given plectrum. Those that vary are regressors."""
LEAST_RANGE = 1e-6  # Range of a column's logarithm below which the column counts as constant
LEAST_SINGULAR = 1e-3
"""Ratio of the smallest to the largest singular value of the normalised regressors below which they
are collinear. Their exponents are not identifiable then."""


def logs(presses: "pd.DataFrame", columns: tuple[str, ...]) -> dict[str, Floats]:
    """Return the logarithms of the columns that vary, each minus its mean."""
    found = {name: np.log(presses[name].to_numpy(float)) for name in columns}
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
    return bool(singular[-1] <= LEAST_SINGULAR * singular[0])
