"""Say on a picture whether a stand-in made what it shows."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def how_made(simulated: bool) -> str:
    """Return how a press was made, as a picture's title says it."""
    return "SIMULATED, made on the stand-in" if simulated else "measured"


def stamp(figure: "Figure", simulated: bool, size: float = 90) -> None:
    """Write *simulated* across a figure of simulated presses; leave one of measured ones.

    Args:
        figure: To write on.
        simulated: Whether a stand-in made any of its presses.
        size: pt, of the letters.
    """
    if simulated:
        figure.text(
            0.5, 0.5, "simulated", fontsize=size, color="#00000014", rotation=25,
            ha="center", va="center",
        )  # fmt: skip
