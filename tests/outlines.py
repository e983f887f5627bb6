"""Outlines of plectra for tests."""

import numpy as np

from sautereau.rig.instrument import Outline


def outline_from(thickness, length):
    """Return the symmetric outline of a thickness [m] at places [m] from the clamp."""
    x = np.linspace(0.0, length, 101)
    half = np.array([thickness(place) / 2 for place in x])
    edges = {"x": x, "top": half, "bottom": -half}
    # The model accepts quantities as text with a unit.
    return Outline.model_validate(
        {name: [f"{value!r} m" for value in each.tolist()] for name, each in edges.items()}
    )
