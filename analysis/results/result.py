"""What all results offer: text, JSON, a table and a figure."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Any

from sautereau.analysis.figures.palette import literal

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


class Result(Shown):
    """What a computation has found."""

    @property
    @abstractmethod
    def document(self) -> dict[str, Any]:
        """The result as JSON; SI units."""

    @abstractmethod
    def lines(self) -> list[str]:
        """Return the result as text."""

    @abstractmethod
    def plot(self) -> "Figure":
        """Return the result as a figure."""

    def __str__(self) -> str:
        return "\n".join(self.lines())


def json_of(found: Any, *omitted: str) -> Any:
    """Return a part of a result as JSON: a dataclass by its fields, except some.

    The ends of a 95 % interval, `low` and `high`, become one value, which is None without them.
    """
    document = plain(found)
    if "low" in document:
        ends = [document.pop("low"), document.pop("high")]
        document["ci95"] = None if None in ends else ends
    return {name: value for name, value in document.items() if name not in omitted}


def plain(found: Any) -> Any:
    """Return dataclasses as dictionaries, and their arrays and tuples as lists."""
    if is_dataclass(found):
        return {own.name: plain(getattr(found, own.name)) for own in fields(found)}
    if isinstance(found, tuple | list):
        return [plain(own) for own in found]
    return found.tolist() if hasattr(found, "tolist") else found  # an array


def named(found: Iterable[Any]) -> dict[str, Any]:
    """Return parts of a result as JSON by their names."""
    return {own.name: json_of(own, "name") for own in found}


def part_of(found: object, *names: str) -> dict[str, Any]:
    """Return some attributes of a result by their names."""
    return {name: getattr(found, name) for name in names}


def frame_of(
    rows: Iterable[Sequence[Any]],
    columns: Sequence[str],
    index: str | list[str],
    units: Mapping[str, str] | None = None,
) -> "pd.DataFrame":
    """Return rows as a table.

    Args:
        columns: Names of the values of a row.
        index: Those of its index.
        units: SI units of the values, for `attrs`.
    """
    import pandas as pd

    frame = pd.DataFrame(list(rows), columns=list(columns)).set_index(index)
    if units is not None:
        frame.attrs = {"units": dict(units)}
    return frame


def drawing(width: float, height: float) -> "Figure":
    """Return an empty figure of a size in inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def shown(figure: "Figure") -> "Figure":
    """Return a figure that notebooks show without pyplot."""

    def png() -> bytes:
        buffer = BytesIO()
        figure.savefig(buffer, format="png", dpi=100)
        return buffer.getvalue()

    literal(figure)
    figure._repr_png_ = png  # pyright: ignore[reportAttributeAccessIssue]
    return figure
