"""A proposal how to carve a plectrum, so that its key's press has requested values."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.choirs import ChoirPluck, choirs, string_names, with_plectrum
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.profile import profile_of
from sautereau.analysis.model.predict import Prediction, predict
from sautereau.analysis.outline.carve import Carving, Knife, carve, carving
from sautereau.analysis.outline.measure import Edges
from sautereau.analysis.results.prediction import OF_OUTLINE, Predicted, of_outline
from sautereau.analysis.results.prediction import quantities as quantities_of_press
from sautereau.analysis.results.result import Result, drawing, frame_of, shown
from sautereau.analysis.text import table
from sautereau.rig.csv_files import read_columns
from sautereau.rig.disk import write_durably
from sautereau.rig.faults import fault_list
from sautereau.rig.instrument import Choir, OutlineMember, String
from sautereau.rig.outline import outline_text
from sautereau.rig.quantities import QUANTITIES
from sautereau.rig.schema import Rig
from sautereau.rig.units import parse_quantity

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

OF_KEY = ("force_drop", "work")  # What a key shares with the one that it is to be like
SENSITIVE = ("release_force", "force_drop", "work", "release_angle")  # Shown for 0.01 mm
SHAVING = 1e-5  # m, for which sensitivities are given
PERIODS, MODES = 2, 60  # Of the bridge force that is drawn


@dataclass(frozen=True, repr=False)
class Voiced(Result):
    """Where and how much to take from a plectrum's underside, and what that changes."""

    before: Rig
    after: Rig
    """With the carved plectrum, and its ensemble if the photograph has one."""
    cut: Carving
    depths: Floats
    """m, of the cuts, shape (cuts,)."""
    targets: dict[str, float]
    """SI, by quantity."""
    string: int
    """Number of the string whose plectrum is cut."""
    curve: Floats | None
    """Requested key deflection since contact [m] and finger force [N], shape (n, 2)."""
    presses: tuple[Prediction, Prediction]
    """Before and after the cut."""
    sensitivities: Floats
    """Relative change of each of `SENSITIVE` by `SHAVING` at each cut, shape (4, cuts)."""
    intervals: Predicted | None
    """After the cut; None without an ensemble."""

    def __repr__(self) -> str:
        return f"<Voiced {self.before.name}: {self.deepest * 1e3:.3g} mm off at most>"

    @property
    def deepest(self) -> float:
        """Largest depth [m]."""
        return float((self.cut.shapes @ self.depths).max())

    @property
    def values(self) -> Floats:
        """`OF_OUTLINE` before and after, SI, shape (2, quantities)."""
        both = zip((self.before, self.after), self.presses, strict=True)
        return np.array([quantities_of_press(*own, OF_OUTLINE, self.string) for own in both])

    def _choir(self, rig: Rig) -> Choir:
        return choirs(rig)[self.string - 1]

    @property
    def warnings(self) -> list[str]:
        """Targets that the cut does not reach."""
        after: dict[str, float] = dict(zip(OF_OUTLINE, self.values[1].tolist(), strict=True))
        found = []
        for name, target in self.targets.items():
            if abs(after[name] / target - 1) > 0.01:  # Not reached
                scale, unit = QUANTITIES[name].displayed
                found.append(
                    f"{QUANTITIES[name].label}: {after[name] * scale:.4g} {unit} after the cut,"
                    f" {target * scale:.4g} {unit} requested: out of reach with --least and --most,"
                    " or against another target"
                )
        return found

    @property
    def stations(self) -> Floats:
        """x, thickness before, depth and thickness after [m], shape (9, 4)."""
        x = np.linspace(0.0, self.cut.places[-1], 9)
        depth = np.interp(x, self.cut.places, self.cut.shapes @ self.depths)
        plectrum = self._choir(self.before).plectrum
        profile, length = profile_of(plectrum), plectrum.length
        top, bottom = profile.edges(x / length)
        thick = (top - bottom) * length
        return np.column_stack([x, thick, depth, thick - depth])

    @property
    def places(self) -> Floats:
        """m, where each cut is deepest, from the clamp, shape (cuts,)."""
        return self.cut.places[np.argmax(self.cut.shapes, axis=0)]

    @property
    def document(self) -> dict[str, Any]:
        """The cut, and the press before and after it; SI."""
        names = ("x", "thickness", "depth", "thickness_after")
        before, after = (dict(zip(OF_OUTLINE, row, strict=True)) for row in self.values.tolist())
        return {
            "string": self.string,
            "targets": self.targets,
            "before": before,
            "after": after,
            "cut": [dict(zip(names, row, strict=True)) for row in self.stations.tolist()],
            "sensitivities": [
                {"x": x, "depth": SHAVING, **dict(zip(SENSITIVE, row, strict=True))}
                for x, row in zip(self.places.tolist(), self.sensitivities.T.tolist(), strict=True)
            ],
            "intervals": self.intervals.document if self.intervals else None,
            "warnings": self.warnings,
        }

    def lines(self) -> list[str]:
        """Return the cut, the press before and after it, and the sensitivities as text."""
        end = self.cut.places[-1]
        rows: list[tuple[str, ...]] = [("from the tip", "thickness", "take off", "remaining", "")]
        for x, *sizes in self.stations.tolist():
            rows.append((f"{(end - x) * 1e3:.2f}", *(f"{v * 1e3:.3f}" for v in sizes), "mm"))
        values: list[tuple[str, ...]] = [("", "before", "after", "requested", "unit")]
        for name, before, after in zip(OF_OUTLINE, *self.values, strict=True):
            scale, unit = QUANTITIES[name].displayed
            target = f"{self.targets[name] * scale:.4g}" if name in self.targets else ""
            label = QUANTITIES[name].label
            values.append((label, f"{before * scale:.4g}", f"{after * scale:.4g}", target, unit))
        feel: list[tuple[str, ...]] = [
            ("from the tip", *(QUANTITIES[name].label for name in SENSITIVE), "")
        ]
        for x, row in zip(self.places, self.sensitivities.T, strict=True):
            feel.append((f"{(end - x) * 1e3:.2f} mm", *(f"{100 * v:+.2f}" for v in row), "%"))
        of = f", {string_names(self.before)[self.string - 1]}" * bool(self.before.more_choirs)
        return [
            f"rig {self.before.name}{of}: take from the underside, {self.deepest * 1e3:.3g} mm at"
            " the deepest:",
            *table(rows, left=(4,), indent=2),
            "the press, plectrum model fe:",
            *table(values, left=(0, 4), indent=2),
            *(self.intervals.lines() if self.intervals else ()),
            f"before the cut, {SHAVING * 1e3:g} mm off in one stroke changes:",
            *table(feel, left=(0, 5), indent=2),
            *(f"warning: {warning}" for warning in self.warnings),
        ]

    def to_frame(self) -> "pd.DataFrame":
        """Return the cut over the distance from the clamp [m]."""
        columns = ("x", "thickness", "depth", "thickness_after")
        return frame_of(self.stations.tolist(), columns, "x", dict.fromkeys(columns, "m"))

    def write(self, path: Path) -> None:
        """Write the carved outline, and its ensemble, as a rig file names it."""
        own = self._choir(self.after).plectrum
        contours = [
            Edges(*map(np.array, (o.x, o.top, o.bottom))).contour
            for o in (own.outline, *(e.outline for e in own.ensemble))
            if o
        ]
        write_durably(path, outline_text(contours))

    def plot(self) -> "Figure":
        """Return outline, force, initial string and bridge force, before and after the cut."""
        from sautereau.analysis.figures.palette import BEFORE, GRID, ORANGE, PREDICTED

        figure = drawing(12, 8)
        axes = figure.subplot_mosaic("AA;BC;DC")
        styles = ((BEFORE, "-", "before"), (PREDICTED, (0, (5, 1.5)), "after"))
        fine = self.cut.places
        for rig, press, (colour, dashes, name) in zip(
            (self.before, self.after), self.presses, styles, strict=True
        ):
            choir = self._choir(rig)
            profile, length = profile_of(choir.plectrum), choir.plectrum.length
            top, bottom = (edge * length * 1e3 for edge in profile.edges(fine / length))
            ring = np.r_[fine, fine[::-1]] * 1e3, np.r_[top, bottom[::-1]]
            axes["A"].plot(*ring, color=colour, ls=dashes, label=name)
            deflection, force = press.from_contact(5e-3, self.string)
            axes["B"].plot(deflection * 1e3, force, color=colour, ls=dashes, label=name)
            time, shape, bridge = _string(choir.string, press.choirs[self.string - 1])
            axes["D"].plot(*shape, color=colour, ls=dashes, label=name)
            axes["C"].plot(time * 1e3, bridge, color=colour, ls=dashes, label=name)
            if name == "before":
                cut = self.cut.shapes @ self.depths * 1e3
                axes["A"].fill_between(
                    fine * 1e3, bottom, bottom + cut, color=ORANGE, hatch="//", label="take off"
                )
        if self.curve is not None:
            axes["B"].plot(*(self.curve * [1e3, 1]).T, ".", color="black", label="requested")
        axes["A"].set(
            aspect="equal", xlabel="from the clamp (mm)", title="plectrum from the side (mm)"
        )
        axes["B"].set(xlabel="key deflection since contact (mm)", ylabel="finger force (N)")
        axes["D"].set(xlabel="along the string (mm)", ylabel="string at release (mm)")
        axes["C"].set(xlabel="time after release (ms)", ylabel="force on the bridge (N)")
        for own in axes.values():
            own.grid(color=GRID)
            own.legend(frameon=False, fontsize=9)
        return shown(figure)


def _string(string: String, press: ChoirPluck) -> tuple[Floats, tuple[Floats, Floats], Floats]:
    """Return time [s], the string's shape at release [mm], and its force on the bridge [N]."""
    from sautereau.analysis.model.string.string import FreeString, ModalState, ModalString

    released = press.released_string
    modal = ModalString(string, MODES)
    # A point force holds the string; it moves likewise, along the triangle of that shape.
    static = modal.shape * string.static_stiffness / (modal.mass * modal.omega**2)
    static = static * np.sinc(modal.order / (MODES + 1))  # without the ripple of a series cut off
    speeds = np.nan_to_num([released.velocity_x, released.velocity_z], posinf=0.0, neginf=0.0)
    q, v = (np.outer(own, static) for own in ([released.x, released.z], speeds))
    time = np.linspace(0.0, PERIODS / string.frequency, 1200)
    bridge = FreeString(modal, ModalState(q, v)).bridge_force(time)[:, 1]
    along = np.array([0.0, string.plucking_point, string.length]) * 1e3
    return time, (along, np.array([0.0, released.z, 0.0]) * 1e3), bridge


def voice(
    rig: Rig,
    targets: Sequence[str] = (),
    *,
    string: int = 1,
    like: Rig | None = None,
    curve: Path | None = None,
    knife: Knife | None = None,
    intervals: bool = True,
) -> Voiced:
    """Return where to carve the plectrum of a rig's string.

    Args:
        string: Number of the string.
        targets: Quantities of `OF_OUTLINE` with values: "force_drop 0.45 N".
        like: Another key, whose force drop and work on the same string are requested.
        curve: CSV file of a requested force: deflection [mm] since contact, force [N].
        knife: What can be cut.
        intervals: Whether to predict the intervals that a photograph's ensemble leaves.

    Raises:
        AnalysisError: The rig has no such string, no target or a faulty one is given, one lies
            above the present value, or nothing can be cut.
        ModelError: The plectrum has no pluck before it is cut.
        RigError: The curve's file is faulty.
    """
    for own in (rig, *([like] if like else [])):
        if not 1 <= string <= (count := 1 + len(own.more_choirs)):
            raise AnalysisError(f"voice: string {string}: rig {own.name} has {count}; correct it")
    plectrum = choirs(rig)[string - 1].plectrum
    cut = carving(plectrum, knife or Knife())
    at_first = predict(rig, "fe")
    present = dict(
        zip(OF_OUTLINE, quantities_of_press(rig, at_first, OF_OUTLINE, string), strict=True)
    )
    wanted = _targets(targets, present)
    if like is not None:
        of_like = quantities_of_press(like, predict(like), OF_KEY, string)
        wanted |= dict(zip(OF_KEY, map(float, of_like), strict=True))
    points = None if curve is None else _curve(curve)
    if not wanted and points is None:
        raise AnalysisError('voice: nothing is requested; give --target "force_drop 0.45 N"')
    if len(wanted) == 1 and points is None:
        _check_below(wanted, present)
    force_unit = 1.0 if points is None else float(points[:, 1].max()) * len(points) ** 0.5

    def observe(own: Rig, press: Prediction) -> Floats:
        values = np.log(quantities_of_press(own, press, OF_OUTLINE, string))
        if points is None:
            return values
        deflection, force = press.from_contact(0.0, string)
        return np.r_[values, np.interp(points[:, 0], deflection, force) / force_unit]

    aim = np.log([wanted.get(name, np.nan) for name in OF_OUTLINE])
    if points is not None:
        aim = np.r_[aim, points[:, 1] / force_unit]
    depths, rates = carve(rig, cut, observe, aim, string)
    rates = rates[[OF_OUTLINE.index(name) for name in SENSITIVE]]
    carved = cut.applied(plectrum, depths)
    others = [cut.applied(own, depths).outline for own in plectrum.ensemble]
    if others and carved.outline:
        kept = [{n: getattr(o, n) for n in ("x", "top", "bottom")} for o in others]
        ensemble = tuple(OutlineMember.model_construct(**own) for own in kept)
        carved = carved.outlined(carved.outline.model_copy(update={"ensemble": ensemble}))
    after = with_plectrum(rig, string, carved)
    return Voiced(
        rig,
        after,
        cut,
        depths,
        wanted,
        string,
        points,
        (at_first, predict(after, "fe")),
        SHAVING * rates / cut.shapes.max(axis=0),
        of_outline(after, "fe", string) if intervals else None,
    )


def _targets(texts: Sequence[str], present: dict[str, float]) -> dict[str, float]:
    found: dict[str, float] = {}
    faults = []
    for text in texts:
        name, _, value = text.strip().partition(" ")
        if name not in present:
            faults.append(f"{text!r}: its name is none of {', '.join(present)}")
            continue
        try:
            found[name] = parse_quantity(value, QUANTITIES[name].unit)
            if found[name] <= 0:
                raise ValueError(f"{value!r} is not above 0")
        except ValueError as error:
            faults.append(f'{name}: {error}; write it like "force_drop 0.45 N"')
    if faults:
        raise AnalysisError(fault_list("target", faults))
    return found


def _check_below(wanted: dict[str, float], present: dict[str, float]) -> None:
    """Refuse a target that more material would be needed for."""
    ((name, target),) = wanted.items()
    if name not in ("release_angle", "pluck_duration") and target > present[name]:
        scale, unit = QUANTITIES[name].displayed
        raise AnalysisError(
            f"target: {name}: {target * scale:.4g} {unit} is above the present"
            f" {present[name] * scale:.4g} {unit}, and material can only be taken away; give a"
            " thicker plectrum, or more overlap"
        )


def _curve(path: Path) -> Floats:
    columns = {"deflection": "m", "force": "N"}

    def read(name: str, text: str) -> float:
        return parse_quantity(text, columns[name])

    found = read_columns(path, "curve file", columns, "deflection [mm], force [N]", read)
    points = np.column_stack([found["deflection"], found["force"]])
    if len(points) < 2 or not points[:, 1].max() > 0:
        raise AnalysisError(
            f"curve file {path}: {len(points)} rows with forces above 0; give at least 2"
        )
    return points
