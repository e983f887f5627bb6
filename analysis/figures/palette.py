"""Colours of all plots by role, distinct for readers of any colour vision.

The hues are those of Okabe and Ito (Color Universal Design, 2008). Every pair of a group of
`GROUPS` differs by at least `LEAST_DIFFERENCE`, also as seen with deuteranopia, protanopia or
tritanopia; lines differ in their dashes as well, areas in their hatching, points in their markers.
"""

from typing import TYPE_CHECKING

from sautereau.analysis.text import visible
from sautereau.rig.disk import as_text

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

BLUE, VERMILLION, GREEN = "#0072b2", "#d55e00", "#009e73"
PURPLE, ORANGE, SKY, YELLOW = "#cc79a7", "#e69f00", "#56b4e9", "#f0e442"

MEASURED, PREDICTED, BEFORE, AGAINST = "#0b4f8a", VERMILLION, "#8c8c8c", GREEN
"""A measurement, the model, the model before a fit, and a measurement to compare with."""
CONTACT, RELEASE, OTHER = GREEN, VERMILLION, "#4d4d4d"  # Boundaries of phases, and others
PHASES = {
    "free": ("#ffffff", ""),
    "string held": ("#fbdcc0", "//"),
    "string released": ("#cfe3f5", "."),
}  # Colour and hatching of the phases by their names
SEVERAL = ("#f0b27a", "xx")  # Of a phase in which several strings are held
HATCH = "#00000018"
"""Colour of the hatching."""
DOUBTFUL = YELLOW  # Intervals with a quality flag
SERIES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)  # Things of one kind: presses, solvers
DASHES = ("-", (0, (5, 1.5)), (0, (1, 1.2)), (0, (6, 1.5, 1, 1.5)), (0, (9, 2)), (0, (3, 1, 1, 1)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")  # With `DASHES`: they differ in grey as well
LEVELS = (SKY, VERMILLION, GREEN, "#000000", PURPLE, YELLOW)  # Of decreasing width

ARM, PRESSED, WOOD, GRAIN, METAL = "#0b4f8a", VERMILLION, "#efe4cc", "#8a7a5c", "#555555"
FELT, LASER = "#7d9b76", "#b00020"  # Parts of the bench, which have different shapes
GRID = "#e6e6e6"

GROUPS = {
    "curves": (MEASURED, PREDICTED, BEFORE),
    "sets": (MEASURED, PREDICTED, AGAINST),
    "instants": (MEASURED, CONTACT, RELEASE, OTHER),
    "phases": tuple(colour for colour, _ in (*PHASES.values(), SEVERAL)),
    "series": SERIES,
    "levels": LEVELS,
    "bench": (ARM, PRESSED, METAL),
}  # Colours that stand for different things in one plot
LEAST_DIFFERENCE = 10.0  # In CAM02-UCS, of a group's colours; 1 is just noticeable side by side


def how_made(simulated: bool) -> str:
    """Return whether presses are simulated or measured, for a plot's title."""
    return "SIMULATED" if simulated else "measured"


def literal(figure: "FigureBase") -> None:
    """Draw all texts as they are: names of files and rigs are no formulas.

    They may also be no UTF-8, and have control characters, for which there is no glyph.
    """
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        if (said := text.get_text()) != (drawn := visible(as_text(said))) or "$" in said:
            text.set(text=drawn, parse_math=False)


def stamp(figure: "FigureBase", simulated: bool, size: float = 90) -> None:
    """Write *simulated* across a figure of simulated presses.

    Args:
        simulated: Whether any of its presses is simulated; if not, nothing is written.
        size: pt, of the letters.
    """
    if simulated:
        figure.text(
            0.5, 0.5, "simulated", fontsize=size, color="#00000014", rotation=25,
            ha="center", va="center",
        )  # fmt: skip
