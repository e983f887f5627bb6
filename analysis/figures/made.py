"""Mark plots of simulated presses."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase


def how_made(simulated: bool) -> str:
    """Return whether presses are simulated or measured, for a plot's title."""
    return "SIMULATED" if simulated else "measured"


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
