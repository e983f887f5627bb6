"""The quantities that sautereau reports: one name, symbol, unit, label and definition for each.

They are in quantities.csv. Command line, JSON, DataFrames, plots, report and docs/glossary.md take
them from here.
"""

import math
from dataclasses import dataclass

from sautereau.rig.disk import table_beside

DISPLAYED = {
    "s": (1e3, "ms"),
    "m": (1e3, "mm"),
    "J": (1e6, "µJ"),
    "N/m": (1e-3, "N/mm"),
    "rad": (math.degrees(1), "deg"),
}
"""Factor and unit in which texts show a quantity, by its SI unit; others are shown in SI units."""
RELATIVE = {"held_speed_error"}  # Dimensionless features of a press that texts show in per cent


@dataclass(frozen=True)
class Quantity:
    """One reported quantity."""

    name: str
    """Key in JSON and column of a table."""
    symbol: str
    """Symbol in formulas; empty if it has none."""
    unit: str
    """SI unit; `1` for a dimensionless number, empty for a text or a yes/no."""
    label: str
    """Name in tables, plots and the report, without the unit."""
    definition: str
    """Definition, in one line."""

    @property
    def displayed(self) -> tuple[float, str]:
        """Factor from the SI unit to the unit that texts show, and that unit."""
        of_unit = DISPLAYED.get(self.unit, (1.0, self.unit))
        return (1e2, "%") if self.name in RELATIVE else of_unit

    @property
    def title(self) -> str:
        """The label with the displayed unit, for a column or an axis: `release force (N)`."""
        _, unit = self.displayed
        return f"{self.label} ({unit})" if unit not in ("", "1") else self.label


SECTIONS: dict[str, dict[str, Quantity]] = {}  # Quantities by what reports them, and there by name
for _section, *_row in table_beside(__file__):
    SECTIONS.setdefault(_section, {})[_row[0]] = Quantity(*_row)
QUANTITIES = {name: each for table in SECTIONS.values() for name, each in table.items()}
"""All quantities by name."""
