"""The analysis of a session, and the comparison of two."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sautereau.analysis.session.conditions import SessionAnalysis
from sautereau.analysis.session.difference import Pair
from sautereau.analysis.summary.session import (
    SIGNS,
    analysis_lines,
    analysis_summary,
    pair_lines,
    pair_summary,
)
from sautereau.analysis.summary.text import counted
from sautereau.entrance.shown import Shown, shown

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class Comparison(Shown):
    """Presses by condition, compared with the model and with another set."""

    found: SessionAnalysis
    pairs: tuple[Pair, ...] = ()
    """Conditions of this set and of the other; empty without another set."""

    def __repr__(self) -> str:
        conditions = counted(len(self.found.conditions), "condition")
        return f"<Comparison of {counted(len(self.found.presses), 'press')}, {conditions}>"

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def lines(self, features: bool = True) -> list[str]:
        """Return the comparison as text, with or without the features."""
        lines = analysis_lines(self.found, features)
        return [*lines, *(line for pair in self.pairs for line in pair_lines(pair))]

    @property
    def document(self) -> dict[str, Any]:
        """The comparison as JSON; SI units."""
        against = {"against": [pair_summary(pair) for pair in self.pairs]} if self.pairs else {}
        return analysis_summary(self.found) | against

    @property
    def errors(self) -> "pd.DataFrame":
        """Model errors, (model - measured) / measured, with 95 % intervals."""
        rows = []
        for number, condition in enumerate(self.found.conditions, 1):
            for name in SIGNS if condition.comparison else ():
                error = getattr(condition.comparison, name)
                rows.append((number, name, error.value, error.low, error.high))
        return _frame(rows, ("value", "low", "high"))

    @property
    def features(self) -> "pd.DataFrame":
        """Features with mean, 95 % interval, standard deviation, drift per press and the model."""
        rows = [
            (number, one.name, one.measured.value, one.measured.low, one.measured.high, one.std,
             one.drift and one.drift.value, one.predicted, one.presses)
            for number, condition in enumerate(self.found.conditions, 1)
            for one in condition.features
        ]  # fmt: skip
        names = ("mean", "low", "high", "std", "drift", "predicted", "presses")
        frame = _frame(rows, names)
        of_first = {one.name: one.unit for c in self.found.conditions for one in c.features}
        frame.attrs = {"units": of_first}
        return frame

    @property
    def differences(self) -> "pd.DataFrame":
        """Features of this set minus those of the other, with 95 % intervals (Welch)."""
        rows = [
            (number, one.name, one.first.measured.value, one.second.measured.value, one.value,
             one.low, one.high, one.significant)
            for number, pair in enumerate(self.pairs, 1)
            for one in pair.differences
        ]  # fmt: skip
        names = ("first", "second", "difference", "low", "high", "significant")
        return _frame(rows, names)

    @property
    def conditions(self) -> "pd.DataFrame":
        """The conditions: number of presses, and the values that vary between them."""
        import pandas as pd

        rows = [(len(c.counted), self.found.label(c)) for c in self.found.conditions]
        index = pd.RangeIndex(1, len(rows) + 1, name="condition")
        return pd.DataFrame(rows, index, columns=["presses", "values"])

    def to_frame(self) -> "pd.DataFrame":
        """Return the differences from the other set; without one, the features."""
        return self.differences if self.pairs else self.features

    def plot(self, condition: int | None = None) -> "Figure":
        """Return a figure of the first presses of each condition, or of one, and of the model."""
        from sautereau.analysis.figures.comparison import session_figure

        return shown(session_figure(self.found, self.pairs, condition))


def _frame(rows: list[Any], names: tuple[str, ...]) -> "pd.DataFrame":
    import pandas as pd

    frame = pd.DataFrame(rows, columns=["condition", "name", *names])
    return frame.set_index(["condition", "name"])
