"""What is said about a result: warnings that it may be wrong, and remarks."""

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Remark:
    """A text about a press."""

    text: str
    plucks: tuple[int, ...] = ()
    """Indices of the plucks that it is about; empty for the complete press."""
    doubt: bool = True
    """Whether a result may be wrong, or is very uncertain: a warning. Otherwise the text is for
    information."""


def divided(said: Iterable[Remark]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the texts of the warnings, and those of the other remarks."""
    said = list(said)
    return tuple(r.text for r in said if r.doubt), tuple(r.text for r in said if not r.doubt)
