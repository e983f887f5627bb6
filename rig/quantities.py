"""The quantities that sautereau reports: one name, symbol, unit, label and definition for each.

Command line, JSON, DataFrames, plots, report and docs/glossary.md take them from here.
"""

import math
from dataclasses import dataclass

DISPLAYED = {
    "s": (1e3, "ms"),
    "m": (1e3, "mm"),
    "J": (1e6, "uJ"),
    "N/m": (1e-3, "N/mm"),
    "rad": (math.degrees(1), "deg"),
}
"""Factor and unit in which texts show a quantity, by its SI unit; others are shown in SI units."""


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
        return DISPLAYED.get(self.unit, (1.0, self.unit))

    def title(self, unit: str | None = None) -> str:
        """Return the label with a unit, for a column or an axis: `release force (N)`.

        Args:
            unit: Unit of the displayed values; None for the SI unit.
        """
        unit = self.unit if unit is None else unit
        return f"{self.label} ({unit})" if unit not in ("", "1") else self.label


def _table(*rows: tuple[str, str, str, str, str]) -> dict[str, Quantity]:
    return {row[0]: Quantity(*row) for row in rows}


SECTIONS = {
    "Samples of a press": _table(
        ("velocity", "v", "m/s", "key velocity", "Velocity of the key at the laser spot, positive"
         " downwards."),
        ("force", "F", "N", "finger force", "Force of the finger on the key."),
        ("angle", "a", "rad", "key angle", "Rotation of the key about the balance pin, from rest."),
        ("deflection", "", "m", "key deflection", "Path of the key at the laser spot, from rest:"
         " the integral of its velocity."),
        ("jack_rise", "r", "m", "jack rise", "Height of the jack above its rest."),
        ("jack_speed", "", "m/s", "jack speed", "Velocity of the jack, positive upwards."),
    ),
    "Phases and features of a press": _table(
        ("path", "", "", "recording", "Path of the recording."),
        ("simulated", "", "", "simulated", "Whether the stand-in made the recording."),
        ("plucks", "", "1", "plucks", "Number of plucks found in the press. In tables, the"
         " quantities of the second pluck end in `_2`, and so on."),
        ("start", "t_0", "s", "start", "Time after the trigger at which the jack leaves rest,"
         " extrapolated with its free speed."),
        ("contact", "t_c", "s", "contact", "Time after the trigger at which the plectrum touches"
         " the string; of a prediction, after the jack leaves rest."),
        ("contact_std", "", "s", "standard uncertainty of contact", "Standard uncertainty of the"
         " time of contact."),
        ("release", "t_r", "s", "release", "Time after the trigger at which the string slips off"
         " the plectrum; of a prediction, after the jack leaves rest."),
        ("release_std", "", "s", "standard uncertainty of release", "Standard uncertainty of the"
         " time of release."),
        ("bottom", "t_b", "s", "full rise", "Time after the trigger at which the jack has reached"
         " its full rise."),
        ("bottomed", "", "s", "front felt", "Time after the trigger at which the key reaches"
         " its front felt."),
        ("returned", "", "s", "return", "Time after the trigger at which the key is back at rest."),
        ("free_speed", "", "m/s", "jack speed, free", "Mean jack speed before contact."),
        ("held_speed", "", "m/s", "jack speed, string held", "Mean jack speed from contact to"
         " release of the first string."),
        ("released_speed", "", "m/s", "jack speed, string released", "Mean jack speed after the"
         " first release."),
        ("pluck_duration", "T_p", "s", "pluck duration", "Time from contact to release."),
        ("contact_rise", "", "m", "jack rise at contact", "Rise of the jack from rest to contact."),
        ("release_rise", "", "m", "jack rise at release", "Rise of the jack from rest to release."),
        ("held_deflection", "", "m", "key deflection, string held", "Key deflection at the laser"
         " from contact to release."),
        ("contact_force", "F_c", "N", "contact force", "Finger force at contact."),
        ("release_force", "F_r", "N", "release force", "Finger force just before release."),
        ("force_drop", "", "N", "force drop", "Fall of the load at release: the finger"
         " force minus the inertial force of key and jack."),
        ("force_slope", "", "N/m", "force slope", "Slope of the finger force on the key deflection"
         " at the laser while the string is held."),
        ("held_work", "W_p", "J", "work, string held", "Work of the finger from contact to"
         " release."),
        ("peak_force", "F_max", "N", "peak force", "Largest finger force of the complete press."),
        ("press_work", "W", "J", "work of the press", "Work of the finger until full rise."),
        ("warnings", "", "1", "warnings", "Number of warnings about the press and its phases."),
    ),
    "Predictions of the model": _table(
        ("plectrum_force", "", "N", "plectrum force at release", "Force between plectrum and string"
         " just before release."),
        ("release_lift", "z_r", "m", "string lift at release", "Displacement of the string at"
         " release."),
        ("release_angle", "", "rad", "plectrum angle at release", "Rotation of the plectrum where"
         " the string leaves it."),
        ("work", "", "J", "work on plectrum and string", "Work of the key against all plectra and"
         " strings until release."),
        ("v_osc", "V_osc", "m/s", "initial string velocity Vosc", "Velocity of the string at the"
         " plucking point just after release, all modes together."),
        ("v_osc_first_mode", "", "m/s", "initial string velocity, first mode only", "Velocity of"
         " the string's first mode at the plucking point just after release."),
    ),
    "Comparison with the model": _table(
        ("slope_error", "", "1", "force slope", "Model error of the force slope: (model - measured)"
         " / measured, mean of the presses."),
        ("magnitude_error", "", "1", "force rise, contact to release", "Model error of the rise of"
         " the finger force from contact to release: (model - measured) / measured, mean of the"
         " presses."),
        ("duration_error", "", "1", "pluck duration", "Model error of the pluck duration: (model -"
         " measured) / measured, mean of the presses."),
        ("measured", "", "", "measured", "Mean of a feature over the presses, in the feature's"
         " unit."),
        ("predicted", "", "", "model", "The same feature of the model, in the feature's unit."),
        ("ci95", "", "", "95 % interval", "Lower and upper end of the 95 % confidence interval, in"
         " the quantity's unit."),
    ),
    "Identification": _table(
        ("value", "", "", "value", "Fitted value of a parameter, in its SI unit."),
        ("std", "", "", "standard uncertainty", "Standard uncertainty of the value, in its unit."),
        ("residual", "", "N", "RMS force residual", "Root mean square of measured minus modelled"
         " finger force, with the fitted values."),
        ("residual_before", "", "N", "RMS force residual before the fit", "The same with the"
         " rig's own values."),
        ("rise_residual", "", "m", "RMS rise residual", "Root mean square of measured minus"
         " modelled rise of the jack at release."),
        ("force_offsets", "", "N", "force offset", "Fitted zero of the force, one for each press."),
        ("correlation", "", "1", "correlation", "Correlation coefficient of two fitted values."),
        ("identifiable", "", "", "identifiable", "Whether the recordings alone determine a"
         " parameter, without priors: to a 95 % interval of 5 % of its scale either way."),
    ),
    "Repeatability of a session (ISO 9283)": _table(
        ("path_repeatability", "RT_p", "m", "path repeatability RT", "Largest value over the cruise"
         " of the mean distance from the mean path plus three standard deviations of it."),
        ("path_accuracy", "AT_p", "m", "path accuracy AT", "Largest distance of the mean path from"
         " the planned path."),
        ("velocity_accuracy", "AV", "1", "path velocity accuracy AV", "Mean jack speed over the"
         " planned speed, minus 1."),
        ("velocity_repeatability", "RV", "1", "path velocity repeatability RV", "Three standard"
         " deviations of the presses' mean jack speeds, over the planned speed."),
        ("velocity_fluctuation", "FV", "1", "path velocity fluctuation FV", "Largest range of the"
         " jack speed within one press, over the planned speed."),
        ("rise_drift", "", "m", "drift of the jack rise", "Change of the mean jack rise from one"
         " press to the next."),
        ("speed_drift", "", "1", "drift of the jack speed", "Change of the mean jack speed from one"
         " press to the next, over the planned speed."),
        ("rms_speed_error", "", "1", "RMS speed error", "Root mean square of the jack's speed error"
         " over the cruise, over the planned speed, for every press of `learn`."),
    ),
    "Touch of plectra": _table(
        ("tip_stiffness", "3EI/L^3", "N/m", "tip stiffness", "Bending stiffness of a uniform"
         " plectrum at its tip."),
        ("felt.presses", "", "1", "presses", "Number of presses in which the quantity is above 0."),
        ("felt.omitted", "", "1", "omitted presses", "Number of presses with a pluck in which a"
         " quantity is missing or not above 0."),
        ("felt.press", "", "1", "within a session", "Relative standard deviation of presses"
         " within one session."),
        ("felt.session", "", "1", "between sessions", "Relative standard deviation of the"
         " sessions of one plectrum."),
        ("felt.plectrum", "", "1", "between plectra", "Relative standard deviation of plectra."),
        ("felt.unexplained", "", "1", "between plectra, beyond their shape", "Relative standard"
         " deviation of plectra that their shape does not explain."),
        ("felt.exponents", "", "1", "exponent", "Per cent by which a quantity increases with one"
         " per cent of a dimension of the plectrum."),
        ("judged.somers_d", "D", "1", "Somers' D", "Fraction of pairs of different judgements of"
         " touch that a quantity orders alike, minus the fraction that it orders oppositely."),
        ("judged.odds_ratio", "", "1", "odds ratio", "Factor by which the odds of a harder"
         " judgement increase with one standard deviation of a quantity."),
        ("judged.q_value", "q", "1", "false discovery rate", "Expected fraction of quantities"
         " without association among those with at most this value."),
    ),
    "Plan of a press": _table(
        ("cruise_speed", "", "m/s", "cruise speed", "Mean jack speed over the cruise, as the"
         " controller executes it."),
        ("cruise_error_max", "", "1", "largest speed error", "Largest departure from the planned"
         " jack speed over the cruise, relative to it."),
        ("tilt_max", "", "rad", "largest tilt", "Largest angle of link 2 against the normal of the"
         " key's surface."),
        ("slide_max", "", "m", "largest slide", "Largest path of the fingertip along the key."),
        ("duration", "", "s", "duration", "Duration of the complete motion."),
        ("segments", "", "1", "segments", "Number of segments that the controller is sent."),
    ),
}  # fmt: skip
"""Quantities by what reports them, and there by name."""
QUANTITIES = {name: each for table in SECTIONS.values() for name, each in table.items()}
"""All quantities by name."""
