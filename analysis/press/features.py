"""The numbers of one press: a flat row for tables of many presses, all in SI units.

Work and travel are counted from contact on, where the paper aligns its presses.
"""

from dataclasses import dataclass, fields

import numpy as np
from scipy.integrate import trapezoid

from sautereau.analysis.phases import HeldString, Phases
from sautereau.analysis.press.load import Press
from sautereau.rig.quantities import QUANTITIES
from sautereau.trajectory.motion import Floats

Value = float | int | str | bool | None


@dataclass(frozen=True)
class PluckFeatures:
    """Of one pluck, SI, as `sautereau.rig.quantities` defines them; times after the trigger."""

    contact: float | None = None
    """s."""
    contact_std: float | None = None
    """s, standard uncertainty."""
    release: float | None = None
    """s."""
    release_std: float | None = None
    """s, standard uncertainty."""
    pluck_duration: float | None = None
    """s, from contact to release."""
    contact_rise: float | None = None
    """m, of the jack at contact."""
    release_rise: float | None = None
    """m, of the jack at release."""
    held_deflection: float | None = None
    """m, of the key at the laser, from contact to release."""
    contact_force: float | None = None
    """N, of the finger at contact."""
    release_force: float | None = None
    """N, of the finger just before release."""
    force_drop: float | None = None
    """N, fall of the finger force at release."""
    force_slope: float | None = None
    """N/m, finger force on key deflection at the laser, from contact to release."""
    held_work: float | None = None
    """J, of the finger from contact to release."""


@dataclass(frozen=True)
class Features:
    """Of one press, SI, as `sautereau.rig.quantities` defines them; times after the trigger."""

    path: str
    simulated: bool
    """Whether the stand-in made the recording."""
    start: float
    """s, at which a jack that always had its free speed would have left rest."""
    bottom: float
    """s, at which the jack has reached its full rise."""
    bottomed: float | None
    """s, at which the key meets its front felt."""
    returned: float | None
    """s, at which the key is back at rest."""
    free_speed: float
    """m/s, mean of the jack before contact."""
    held_speed: float | None
    """m/s, mean of the jack from contact to release of the first string."""
    released_speed: float | None
    """m/s, mean of the jack after the first release."""
    peak_force: float | None
    """N, largest finger force of the complete press."""
    press_work: float
    """J, of the finger until full rise."""
    warnings: int
    """Number of warnings about the press and its phases."""
    plucks: tuple[PluckFeatures, ...]

    def row(self) -> dict[str, Value]:
        """Return the columns of `UNITS`; those of the second pluck end in `_2`, and so on.

        Without a pluck they are None.
        """
        row: dict[str, Value] = {name: getattr(self, name) for name in _BEFORE_PLUCKS}
        row["plucks"] = len(self.plucks)  # in the place of the plucks themselves
        for number, pluck in enumerate(self.plucks or (PluckFeatures(),), 1):
            ending = f"_{number}" if number > 1 else ""
            row |= {name + ending: value for name, value in vars(pluck).items()}
        return row | {name: getattr(self, name) for name in _AFTER_PLUCKS}


_BEFORE_PLUCKS = (
    "path",
    "simulated",
    "plucks",
    "start",
    "bottom",
    "bottomed",
    "returned",
    "free_speed",
    "held_speed",
    "released_speed",
)
_AFTER_PLUCKS = ("peak_force", "press_work", "warnings")
UNITS = {
    name: QUANTITIES[name].unit
    for name in (*_BEFORE_PLUCKS, *(f.name for f in fields(PluckFeatures)), *_AFTER_PLUCKS)
}
"""Unit of each column, in the order of the columns; those of later plucks have these units too."""


def split_column(column: str) -> tuple[str, int]:
    """Return the quantity of a column and the number of its pluck, from 1: `release_2` is 2.

    Args:
        column: Of `Features.row`, or any other, of which there is one only.
    """
    name, _, number = column.rpartition("_")
    return (name, int(number)) if name in UNITS and number.isdecimal() else (column, 1)


def features(press: Press, phases: Phases) -> Features:
    """Return the features of a press.

    Args:
        press: The recording.
        phases: Of `sautereau.analysis.phases.find_phases`.
    """
    signals = _Signals(press)
    return Features(
        path=str(press.path),
        simulated=press.simulated,
        start=phases.start,
        bottom=phases.bottom,
        bottomed=phases.bottomed,
        returned=phases.returned,
        free_speed=phases.free_speed,
        held_speed=phases.held_speed,
        released_speed=phases.released_speed,
        peak_force=phases.peak_force,
        press_work=signals.work(-np.inf, phases.bottom),
        warnings=len(press.warnings) + len(phases.warnings),
        plucks=tuple(signals.of(held) for held in phases.plucks),
    )


class _Signals:
    """The signals of a press that features are taken from."""

    def __init__(self, press: Press):
        self.time = press.data.index.to_numpy()
        self.rise, self.deflection, self.angle, self.force = press.columns(
            "jack_rise", "deflection", "angle", "force"
        )
        self.press_arm = press.rig.key.press_arm

    def work(self, start: float, stop: float) -> float:
        """Return the finger's work [J] between two instants [s]: the integral of F a_p da."""
        inside = slice(*np.searchsorted(self.time, (start, stop)))
        return float(trapezoid(self.force[inside], self.press_arm * self.angle[inside]))

    def of(self, held: HeldString) -> PluckFeatures:
        ends = (held.contact, held.release)
        rise, deflection = (self._at(ends, signal) for signal in (self.rise, self.deflection))
        return PluckFeatures(
            contact=held.contact,
            contact_std=held.contact_std,
            release=held.release,
            release_std=held.release_std,
            pluck_duration=held.pluck_duration,
            contact_rise=float(rise[0]),
            release_rise=float(rise[1]),
            held_deflection=float(deflection[1] - deflection[0]),
            contact_force=held.contact_force,
            release_force=held.release_force,
            force_drop=held.force_drop,
            force_slope=held.force_slope,
            held_work=self.work(*ends),
        )

    def _at(self, instants: tuple[float, float], signal: Floats) -> Floats:
        return np.interp(instants, self.time, signal)
