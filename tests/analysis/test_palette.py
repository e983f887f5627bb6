"""The colours of the plots, as readers with colour deficiencies see them."""

import warnings
from io import BytesIO
from itertools import combinations

import numpy as np
import pytest
from matplotlib.figure import Figure

with warnings.catch_warnings():
    # Where the package was installed without its bytecode, Python compiles invalid escapes in it.
    warnings.simplefilter("ignore")
    from colorspacious import cspace_convert, deltaE

from sautereau.analysis.figures.palette import (
    DASHES,
    GROUPS,
    LEAST_DIFFERENCE,
    MARKERS,
    SERIES,
    literal,
)
from sautereau.analysis.report import figures

ALL = {**GROUPS, "report": (*figures.COLOURS, figures.MODEL)}


def seen(colour, deficiency):
    """Return sRGB from 0 to 1, by the simulation of Machado and others (2009)."""
    red_green_blue = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    if deficiency is None:
        return red_green_blue
    space = {"name": "sRGB1+CVD", "cvd_type": deficiency, "severity": 100}
    return np.clip(cspace_convert(red_green_blue, space, "sRGB1"), 0, 1)


@pytest.mark.parametrize("deficiency", [None, "deuteranomaly", "protanomaly", "tritanomaly"])
@pytest.mark.parametrize("group", ALL)
def test_colours_of_one_plot_differ(group, deficiency):
    colours = {colour: seen(colour, deficiency) for colour in ALL[group]}
    for one, other in combinations(colours, 2):
        found = deltaE(colours[one], colours[other], input_space="sRGB1")
        assert found >= LEAST_DIFFERENCE, (one, other)


def test_lines_and_points_differ_without_colour():
    assert len({str(dashes) for dashes in DASHES}) == len(DASHES) == len(SERIES)
    assert len(set(MARKERS)) == len(MARKERS) >= len(SERIES)


def test_names_in_a_plot_are_no_formulas_and_need_not_be_utf_8():
    figure = Figure()
    figure.suptitle("a$_$ \udcff.mcap")
    literal(figure)
    figure.savefig(BytesIO(), format="png")
    assert figure.get_suptitle() == "a$_$ \\xff.mcap"
