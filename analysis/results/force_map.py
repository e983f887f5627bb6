"""The finger force over the key's travel and speed, pressed and returning: a haptic key's table.

A haptic key is to push back with the force that the finger needs at a constant speed; the inertia
of its own key and jack, which is in the document, it adds itself. Pressed, the plectra pluck their
strings. Returning, each tongue turns against its bristle until its plectrum is below the string.
Friction changes its sign between the two. The damper's felt carries a part of its jack below its
lift.
"""

from dataclasses import dataclass
from io import BytesIO, StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.choirs import choirs, hold, key_of, level_name
from sautereau.analysis.model.key import finger_force
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.predict import string_force_of
from sautereau.analysis.results.result import Result, drawing, frame_of, shown
from sautereau.rig.disk import write_durably
from sautereau.rig.errors import require
from sautereau.rig.instrument import Choir
from sautereau.rig.schema import Rig
from sautereau.rig.units import GRAVITY
from sautereau.trajectory.key import angle_of_rise, rise_of_angle, rise_slope
from sautereau.trajectory.motion import Motion

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

POINTS = 1001  # Of the travel
SPEEDS = tuple(np.linspace(0.0, 0.5, 11).tolist())  # m/s, of the pressing point
UNITS = {"travel": "m", "speed": "m/s", "pressed": "N", "returning": "N"}
MEANING = {
    "travel": "path of the pressing point from rest, downwards",
    "speed": "of the pressing point; 0 is the limit of a slow motion",
    "pressed": "force of the finger while the key goes down, shape (speeds, travels)",
    "returning": "force of the finger while the key comes back, shape (speeds, travels)",
}


@dataclass(frozen=True, repr=False)
class ForceMap(Result):
    """The finger force of a key, by branch."""

    rig: Rig
    level: str
    travel: Floats
    """m, of the pressing point from rest, shape (n,)."""
    speed: Floats
    """m/s, of the pressing point, shape (m,)."""
    pressed: Floats
    """N, while the key goes down, shape (m, n)."""
    returning: Floats
    """N, while the key comes back, shape (m, n); negative where the key would leave the finger."""

    def __repr__(self) -> str:
        return f"<ForceMap of rig {self.rig.name}: {len(self.speed)} speeds>"

    @property
    def document(self) -> dict[str, Any]:
        """What the map is of; SI units."""
        return {
            "rig": self.rig.name,
            "level": self.level,
            "points": len(self.travel),
            "speeds": self.speed.tolist(),
            "units": UNITS,
            "peak_force": float(self.pressed.max()),
            "inertia_at_finger": inertia_at_finger(self.rig),
            "inertia_unit": "kg",
        }

    def lines(self) -> list[str]:
        """Return the extent of the map as text."""
        return [
            f"finger force of rig {self.rig.name}, plectrum model {self.level}:"
            f" {len(self.speed)} speeds up to {self.speed[-1]:.4g} m/s, travel up to"
            f" {self.travel[-1] * 1e3:.4g} mm; largest {self.pressed.max():.4g} N; add the inertia"
            f" of {inertia_at_finger(self.rig) * 1e3:.4g} g at the finger"
        ]

    def to_frame(self) -> "pd.DataFrame":
        """Return both forces over speed and travel."""
        speed, travel = np.meshgrid(self.speed, self.travel, indexing="ij")
        parts = (speed, travel, self.pressed, self.returning)
        rows = np.column_stack([part.ravel() for part in parts]).tolist()
        columns = ("speed", "travel", "pressed", "returning")
        return frame_of(rows, columns, ["speed", "travel"], UNITS)

    def write(self, path: Path) -> None:
        """Write the map as CSV, or as HDF5 with a data set for each of its arrays.

        Raises:
            MissingExtraError: h5py is not installed.
            OSError: The file exists already, or cannot be written.
        """
        if path.suffix.lower() == ".csv":
            text = StringIO()
            head = ",".join(f"{n} [{UNITS[n]}]" for n in ("speed", "travel", *list(UNITS)[2:]))
            values = self.to_frame().reset_index().to_numpy()
            np.savetxt(text, values, "%.7g", ",", header=head, comments="")
            write_durably(path, text.getvalue())
            return
        require("hdf5", "export to HDF5", "h5py")
        import h5py

        held = BytesIO()
        with h5py.File(held, "w") as file:
            file.attrs.update({n: v for n, v in self.document.items() if not isinstance(v, dict)})
            for name, unit in UNITS.items():
                file[name] = getattr(self, name)
                file[name].attrs.update(unit=unit, description=MEANING[name])
        write_durably(path, held.getvalue())

    def plot(self) -> "Figure":
        """Return a figure of both branches at the least and the largest speed."""
        from sautereau.analysis.figures.palette import BEFORE, GRID, PREDICTED

        figure = drawing(9, 5)
        axes = figure.subplots()
        branches = (self.pressed, "pressed", BEFORE), (self.returning, "returning", PREDICTED)
        for force, name, colour in branches:
            for k, dashes in ((0, "-"), (-1, ":")):
                label = f"{name}, {self.speed[k]:.3g} m/s"
                axes.plot(self.travel * 1e3, force[k], color=colour, ls=dashes, label=label)
        axes.set(xlabel="travel at the finger (mm)", ylabel="finger force (N)")
        axes.grid(color=GRID)
        axes.legend(frameon=False)
        return shown(figure)


def inertia_at_finger(rig: Rig) -> float:
    """Return the mass [kg] that the finger moves at rest: key and jacks, (I + m r'^2) / a_p^2."""
    still = np.zeros(1)
    jacks = sum(
        float(own.jack.mass * rise_slope(key_of(rig, own), still)[0] ** 2) for own in choirs(rig)
    )
    return (rig.key.inertia + jacks) / rig.key.press_arm**2


def force_map(
    rig: Rig, level: str = "auto", speeds: tuple[float, ...] = SPEEDS, points: int = POINTS
) -> ForceMap:
    """Return the finger force over the travel to the end of the press, at constant speeds.

    Args:
        speeds: m/s, of the pressing point, at least 0 and increasing.
        points: Number of travels.

    Raises:
        AnalysisError: The speeds do not increase from 0 or above, or there are no two points.
        ModelError: The level has no pluck for the rig.
    """
    speed = np.array(speeds, float)
    if points < 2 or not (len(speed) and speed[0] >= 0 and np.all(np.diff(speed) > 0)):
        raise AnalysisError(
            f"force map: {points} points and speeds of {list(speeds)} m/s; give two points or more,"
            " and speeds that increase from 0 or above"
        )
    angle = np.linspace(0.0, float(angle_of_rise(rig.key, rig.press.jack_rise)), points)
    rise = rise_of_angle(rig.key, angle)
    felts = np.array([_felt(rig, own, angle) for own in choirs(rig)])
    plucks = np.array([string_force_of(rig, own, rise, angle) for own in hold(rig, level)])
    tongues = np.array([_tongue(rig, own, angle) for own in choirs(rig)])
    # Friction has a side at the least speed, too.
    rates = np.maximum(speed, np.finfo(float).tiny ** 0.5) / rig.key.press_arm
    still = np.zeros(points)

    def force(loads: Floats, side: float) -> Floats:
        moving = (Motion(angle, np.full(points, side * rate), still) for rate in rates)
        return np.array([finger_force(rig, motion, loads + felts) for motion in moving])

    travel = rig.key.press_arm * angle
    named = level_name(rig, level)
    return ForceMap(rig, named, travel, speed, force(plucks, 1.0), force(tongues, -1.0))


def _felt(rig: Rig, choir: Choir, angle: Floats) -> Floats:
    """Return the force [N] of the damper's felt on the jack, downwards: it lifts the jack."""
    damper = choir.jack.damper
    if damper is None:
        return np.zeros(len(angle))
    rise = rise_of_angle(key_of(rig, choir), angle)
    # Its felt can carry no more than the jack.
    carried = damper.stiffness * np.clip(damper.lift - rise, 0, None)
    return -np.minimum(carried, choir.jack.mass * GRAVITY)


def _tongue(rig: Rig, choir: Choir, angle: Floats) -> Floats:
    """Return the force [N] of the string on the jack, downwards, that turns the tongue back."""
    tongue, plectrum = choir.jack.tongue, choir.plectrum
    if tongue is None:
        return np.zeros(len(angle))
    lever = plectrum.length - plectrum.overlap
    below = choir.jack.string_clearance - rise_of_angle(key_of(rig, choir), angle)
    passing = (below >= 0) & (below <= lever * plectrum.overlap / tongue.pivot)
    turned = tongue.bristle_moment + tongue.bristle_stiffness * below / lever
    return np.where(passing, -turned / lever, 0.0)
