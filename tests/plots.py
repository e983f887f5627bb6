"""What figures show, for the tests of plots."""

from matplotlib.text import Text


def texts(figure):
    """Return every text on a figure, titles and legends too."""
    return [t.get_text() for t in figure.findobj(Text) if t.get_text()]
