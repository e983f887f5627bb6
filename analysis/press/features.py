"""The numbers of one press: a flat row for tables of many presses, all in SI units.

Work and travel are counted from contact on, where the paper aligns its presses.
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import trapezoid

from sautereau.analysis.phases import HeldString, Phases
from sautereau.analysis.press.load import Press
from sautereau.trajectory.motion import Floats

UNITS = {
    "path": "",
    "simulated": "",
    "plucks": "1",
    "start": "s",
    "bottom": "s",
    "bottomed": "s",
    "returned": "s",
    "free_speed": "m/s",
    "held_speed": "m/s",
    "released_speed": "m/s",
    "contact": "s",
    "contact_std": "s",
    "release": "s",
    "release_std": "s",
    "pluck_duration": "s",
    "contact_rise": "m",
    "release_rise": "m",
    "held_deflection": "m",
    "contact_force": "N",
    "release_force": "N",
    "force_drop": "N",
    "force_slope": "N/m",
    "held_work": "J",
    "press_work": "J",
    "warnings": "1",
}
"""Unit of each column; those of a later pluck have its number behind, `contact_2`."""

Value = float | int | str | bool | None


@dataclass(frozen=True)
class PluckFeatures:
    """Of one pluck; times in s from the trigger."""

    contact: float | None = None
    contact_std: float | None = None
    """s, standard uncertainty."""
    release: float | None = None
    release_std: float | None = None
    """s, standard uncertainty."""
    pluck_duration: float | None = None
    """s, for which the string is held."""
    contact_rise: float | None = None
    """m, of the jack at contact."""
    release_rise: float | None = None
    """m, of the jack at release."""
    held_deflection: float | None = None
    """m, of the key under the laser, from contact to release."""
    contact_force: float | None = None
    """N, of the finger at contact."""
    release_force: float | None = None
    """N, of the finger just before release."""
    force_drop: float | None = None
    """N, by which it falls at release."""
    force_slope: float | None = None
    """N/m, of the finger's force on the deflection under the laser while the string is held."""
    held_work: float | None = None
    """J, of the finger from contact to release."""


@dataclass(frozen=True)
class Features:
    """Of one press; times in s from the trigger."""

    path: str
    simulated: bool
    """Whether a stand-in made it."""
    start: float
    """s, when a jack always as fast as in the free phase would have left its rest."""
    bottom: float
    """s, when the jack has come to its full rise."""
    bottomed: float | None
    """s, when the key meets its felt."""
    returned: float | None
    """s, when the key is back."""
    free_speed: float
    """m/s, of the jack before contact."""
    held_speed: float | None
    """m/s, of the jack while the first string is held."""
    released_speed: float | None
    """m/s, of the jack after the first release."""
    press_work: float
    """J, of the finger until the jack has come to its full rise."""
    warnings: int
    """Number of what is doubtful about the press and its phases."""
    plucks: tuple[PluckFeatures, ...]

    def row(self) -> dict[str, Value]:
        """Return the columns of `UNITS`; the first pluck's have no number behind.

        Without a pluck they are None.
        """
        row: dict[str, Value] = {
            "path": self.path,
            "simulated": self.simulated,
            "plucks": len(self.plucks),
            "start": self.start,
            "bottom": self.bottom,
            "bottomed": self.bottomed,
            "returned": self.returned,
            "free_speed": self.free_speed,
            "held_speed": self.held_speed,
            "released_speed": self.released_speed,
        }
        for number, pluck in enumerate(self.plucks or (PluckFeatures(),), 1):
            suffix = f"_{number}" if number > 1 else ""
            row |= {name + suffix: value for name, value in vars(pluck).items()}
        return row | {"press_work": self.press_work, "warnings": self.warnings}


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
            pluck_duration=held.duration,
            contact_rise=float(rise[0]),
            release_rise=float(rise[1]),
            held_deflection=float(deflection[1] - deflection[0]),
            contact_force=held.contact_force,
            release_force=held.release_force,
            force_drop=held.force_drop,
            force_slope=held.slope,
            held_work=self.work(*ends),
        )

    def _at(self, instants: tuple[float, float], signal: Floats) -> Floats:
        return np.interp(instants, self.time, signal)
