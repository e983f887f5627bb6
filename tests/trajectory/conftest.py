"""Rigs to plan on, and derivatives that know no closed form."""

import numpy as np
import pytest

from rig.load import load_rig, with_values

# Coefficients of the central difference of eighth order, for offsets 1 to 4.
FIRST = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
SECOND = (8 / 5, -1 / 5, 8 / 315, -1 / 560)


@pytest.fixture(scope="session")
def paper():
    return load_rig("paper")


@pytest.fixture(scope="session")
def derivatives():
    """Return a function that gives f' and f'' by central differences of eighth order."""

    def of(function, x, step):
        ahead = [function(x + k * step) for k in range(1, 5)]
        behind = [function(x - k * step) for k in range(1, 5)]
        first = sum(c * (a - b) for c, a, b in zip(FIRST, ahead, behind, strict=True))
        here = function(x)
        second = sum(
            c * (a - here + (b - here)) for c, a, b in zip(SECOND, ahead, behind, strict=True)
        )
        return first / step, second / step**2

    return of


@pytest.fixture(scope="session")
def bench(paper):
    """Return a function that changes values of the paper's rig, lengths and angles in SI."""

    def change(**values):
        return with_values(paper, {key.replace("__", "."): v for key, v in values.items()})

    return change


@pytest.fixture(scope="session")
def close():
    """Return a function that asserts that arrays agree, relative to the largest value."""

    def agree(actual, expected, tolerance):
        scale = np.abs(expected).max()
        assert np.abs(actual - expected).max() <= tolerance * max(scale, 1e-300)

    return agree
