"""The quantities that sautereau reports: one name, symbol, unit, label and definition for each.

Command line, JSON, DataFrames, plots, report and docs/glossary.md take them from here.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """One reported quantity."""

    name: str
    """Key in JSON and column of a table."""
    symbol: str
    """In formulas; empty where there is none."""
    unit: str
    """SI unit; `1` for a dimensionless number, empty for a text or a yes/no."""
    label: str
    """In tables, plots and the report, without the unit."""
    definition: str
    """One line."""

    def title(self, unit: str | None = None) -> str:
        """Return the label with a unit, for a column or an axis: `release force (N)`.

        Args:
            unit: Unit of the displayed values; None for the SI unit.
        """
        unit = self.unit if unit is None else unit
        return f"{self.label} ({unit})" if unit not in ("", "1") else self.label


def _table(*rows: tuple[str, str, str, str, str]) -> dict[str, Quantity]:
    return {row[0]: Quantity(*row) for row in rows}


QUANTITIES = _table(
    ("path", "", "", "recording", "Path of the recording."),
    ("simulated", "", "", "simulated", "Whether the stand-in made the recording."),
    ("plucks", "", "1", "plucks", "Number of plucks found in the press."),
    ("start", "t_0", "s", "start", "Time after the trigger at which a jack that always had its"
     " free speed would have left rest."),
    ("contact", "t_c", "s", "contact", "Time after the trigger at which the plectrum touches the"
     " string."),
    ("contact_std", "", "s", "standard uncertainty of contact", "Standard uncertainty of the time"
     " of contact."),
    ("release", "t_r", "s", "release", "Time after the trigger at which the string slips off the"
     " plectrum."),
    ("release_std", "", "s", "standard uncertainty of release", "Standard uncertainty of the time"
     " of release."),
    ("bottom", "t_b", "s", "full rise", "Time after the trigger at which the jack has reached its"
     " full rise."),
    ("bottomed", "", "s", "front felt", "Time after the trigger at which the key meets its front"
     " felt."),
    ("returned", "", "s", "return", "Time after the trigger at which the key is back at rest."),
    ("free_speed", "", "m/s", "jack speed, free", "Mean jack speed before contact."),
    ("held_speed", "", "m/s", "jack speed, string held", "Mean jack speed from contact to release"
     " of the first string."),
    ("released_speed", "", "m/s", "jack speed, string released", "Mean jack speed after the first"
     " release."),
    ("pluck_duration", "T_p", "s", "pluck duration", "Time from contact to release."),
    ("contact_rise", "", "m", "jack rise at contact", "Rise of the jack from rest to contact."),
    ("release_rise", "", "m", "jack rise at release", "Rise of the jack from rest to release."),
    ("held_deflection", "", "m", "key deflection, string held", "Key deflection at the laser from"
     " contact to release."),
    ("contact_force", "F_c", "N", "contact force", "Finger force at contact."),
    ("release_force", "F_r", "N", "release force", "Finger force just before release."),
    ("peak_force", "F_max", "N", "peak force", "Largest finger force of the whole press."),
    ("force_drop", "", "N", "force drop", "Fall of the finger force at release."),
    ("force_slope", "", "N/m", "force slope", "Slope of the finger force on the key deflection at"
     " the laser while the string is held."),
    ("held_work", "W_p", "J", "work, string held", "Work of the finger from contact to release."),
    ("press_work", "W", "J", "work of the press", "Work of the finger until full rise."),
    ("warnings", "", "1", "warnings", "Number of warnings about the press and its phases."),
    ("release_lift", "", "m", "string lift at release", "Displacement of the string at release."),
    ("release_angle", "", "rad", "plectrum angle at release", "Rotation of the plectrum where the"
     " string leaves it."),
    ("v_osc", "V_osc", "m/s", "initial string velocity Vosc", "Velocity of the string at the"
     " plucking point just after release."),
    ("residual", "", "N", "RMS force residual", "Root mean square of measured minus modelled"
     " finger force."),
)  # fmt: skip
"""By name; the first 26 are the columns of a press's features, in their order."""
