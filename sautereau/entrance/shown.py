"""How objects are shown: a short text, a table in notebooks, a figure."""

from abc import ABC, abstractmethod
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


class Shown(ABC):
    """An object with a table."""

    @abstractmethod
    def to_frame(self) -> "pd.DataFrame":
        """Return the object as a table in SI units; `attrs["units"]` has the units."""

    def _repr_html_(self) -> str:
        return f"<p>{escape(repr(self))}</p>{self.to_frame()._repr_html_()}"  # pyright: ignore


def shown(figure: "Figure") -> "Figure":
    """Return a figure that notebooks show without pyplot."""

    def png() -> bytes:
        buffer = BytesIO()
        figure.savefig(buffer, format="png", dpi=100)
        return buffer.getvalue()

    figure._repr_png_ = png  # pyright: ignore[reportAttributeAccessIssue]
    return figure
