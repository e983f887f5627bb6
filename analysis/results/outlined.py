"""The outline that a photograph shows: its sizes, the overlay to look at, and the rig's file."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.outline.measure import Given, Known, Measured, Ruler, measure
from sautereau.analysis.outline.picture import read_photo, silhouette
from sautereau.analysis.results.result import Result, drawing, frame_of, shown
from sautereau.analysis.text import table
from sautereau.rig.disk import write_durably
from sautereau.rig.faults import fault_list
from sautereau.rig.outline import outline_text
from sautereau.rig.units import parse_quantity

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_STD = re.compile(r"(.+?)\s*(?:\+-|\+/-|±)\s*(.+)")
_RULER = re.compile(r"\s*([^,\s]+),([^,\s]+)\s+([^,\s]+),([^,\s]+)\s+(.+)")


@dataclass(frozen=True, repr=False)
class Outlined(Result):
    """An outline from a photograph, with its ensemble."""

    photo: Path
    found: Measured

    def __repr__(self) -> str:
        return f"<Outlined from {self.photo.name}: {self.found.edges.x[-1] * 1e3:.4g} mm long>"

    @property
    def document(self) -> dict[str, Any]:
        """Sizes, with standard uncertainties from the ensemble, and how they were found; SI."""
        found = self.found
        return {
            "photo": str(self.photo),
            "members": len(found.ensemble),
            **{name: value for name, (value, _) in self._sizes.items()},
            **{f"{name}_std": std for name, (_, std) in self._sizes.items()},
            "pixel": found.scale.value,
            "pixel_std": found.scale.std,
            "clamp": found.clamp.tolist(),
            "clamp_std": found.clamp_std,
            "clamp_found": found.face_found,
            "tilt": found.tilt.value,
            "tilt_std": found.tilt.std,
            "tip": "left" if found.tip_left else "right",
            "upper": "down" if found.upside_down else "up",
            "blur": found.seen.blur,
            "contrast": found.seen.contrast,
            "warnings": list(found.warnings),
        }

    @property
    def _sizes(self) -> dict[str, tuple[float, float]]:
        """Value and standard uncertainty of the sizes [m]."""

        def sizes(own: Any) -> tuple[float, float, float]:
            depth = own.top - own.bottom
            return own.x[-1], depth[0], float(np.interp(0.95 * own.x[-1], own.x, depth))

        stds = np.std([sizes(own) for own in self.found.ensemble], axis=0, ddof=1)
        names = ("length", "thickness", "tip_thickness")
        values = zip(map(float, sizes(self.found.edges)), map(float, stds), strict=True)
        return dict(zip(names, values, strict=True))

    def lines(self) -> list[str]:
        """Return the sizes as text, and how they were found."""
        found, (column, row) = self.found, self.found.clamp
        rows = [("", "value", "std", "unit")]
        for name, (value, std) in self._sizes.items():
            label = {
                "thickness": "thickness at the clamp",
                "tip_thickness": "at 95 % of the length",
            }
            rows.append((label.get(name, name), f"{value * 1e3:.4f}", f"{std * 1e3:.4f}", "mm"))
        tilt = f"{math.degrees(found.tilt.value):.2f}"
        rows.append(("tilt", tilt, f"{math.degrees(found.tilt.std):.2f}", "deg"))
        pixel = f"{found.scale.value * 1e6:.4f}", f"{found.scale.std * 1e6:.4f}"
        rows.append(("a pixel", *pixel, "µm"))
        clamp = "at the jack's face" if found.face_found else "as given"
        return [
            f"{self.photo.name}: the outline and {len(found.ensemble)} more that the photograph"
            " allows:",
            *table(rows, left=(0, 3), indent=2),
            f"clamp {clamp}, column {column:.1f}, row {row:.1f}; the tip points"
            f" {'left' if found.tip_left else 'right'}, the string's side"
            f" {'down' if found.upside_down else 'up'}; edges blurred by"
            f" {found.seen.blur:.1f} pixels",
            *(f"warning: {warning}" for warning in found.warnings),
        ]

    def to_frame(self) -> "pd.DataFrame":
        """Return both edges with the standard deviations of the ensemble [m]."""
        edges = self.found.edges
        columns = ("x", "top", "bottom", "top_std", "bottom_std")
        stds = [np.std([getattr(m, n) for m in self.found.ensemble], axis=0) for n in columns[1:3]]
        rows = np.column_stack([edges.x, edges.top, edges.bottom, *stds]).tolist()
        return frame_of(rows, columns, "x", dict.fromkeys(columns, "m"))

    def write(self, path: Path) -> None:
        """Write the outline and its ensemble, as a rig file's `plectrum.outline` names it."""
        members = (self.found.edges, *self.found.ensemble)
        write_durably(path, outline_text([own.contour for own in members]))

    def plot(self) -> "Figure":
        """Return the photograph with contour, clamp and mesh, complete and near clamp and tip."""
        figure = drawing(12, 9)
        axes = figure.subplot_mosaic("AA;BC")
        for own in axes.values():
            self._draw(own)
        found, edges = self.found, self.found.edges
        reach = 0.9 * edges.thickness / found.scale.value
        for name, place, what in (("B", 0.0, "clamp"), ("C", edges.x[-1], "tip")):
            x, y = found.to_pixels(np.array([[place, 0.0]]))[0]
            axes[name].set(xlim=(x - reach, x + reach), ylim=(y + reach, y - reach), title=what)
        axes["A"].set_title(f"{self.photo.name}: contour, clamp and mesh")
        axes["A"].legend(loc="lower right", fontsize=9)
        return shown(figure)

    def _draw(self, axes: "Axes") -> None:
        from matplotlib.collections import LineCollection

        from sautereau.analysis.figures.palette import ORANGE, SKY, VERMILLION
        from sautereau.analysis.model.plectrum.fe.mesh import plectrum_grid
        from sautereau.analysis.model.plectrum.profile import Profile

        found, edges = self.found, self.found.edges
        length = edges.x[-1]
        axes.imshow(found.seen.image, cmap="gray", interpolation="nearest")
        grid = plectrum_grid(Profile(edges.x / length, edges.top / length, edges.bottom / length))
        nodes = found.to_pixels(grid.nodes * length).reshape(-1, grid.height, 2)[::2, ::2]
        nodes = nodes[grid.x <= 1]  # without the part past the tip, which completes the load
        lines = [*nodes, *nodes.transpose(1, 0, 2)]
        axes.add_collection(LineCollection(lines, colors=SKY, lw=0.6, label="mesh"))
        ring = np.vstack([found.seen.contour, found.seen.contour[:1]])
        axes.plot(*ring.T, color=ORANGE, lw=1.2, label="contour")
        reach = 1.5 * edges.thickness
        clamp = found.to_pixels(np.array([[0.0, -reach], [0.0, reach]]))
        axes.plot(*clamp.T, color=VERMILLION, lw=1.5, ls="--", label="clamp")
        rows, columns = found.seen.image.shape
        axes.set(xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))
        axes.set(xlabel="column (pixels)", ylabel="row (pixels)")


def outline(
    photo: str | Path,
    *,
    pixels_per_mm: str | None = None,
    ruler: str | None = None,
    length: str | None = None,
    thickness: str | None = None,
    clamp: str | None = None,
    tilt: str | None = None,
    upper: Literal["up", "down"] | None = None,
) -> Outlined:
    """Return the outline of the plectrum in a photograph of its side.

    Args:
        photo: Picture file with one plectrum.
        pixels_per_mm: Scale, with its standard uncertainty: "250 +/- 0.5".
        ruler: Two points in pixels and their distance: "100,900 1350,900 5 mm".
        length: From the clamp to the tip: "4.5 mm +/- 0.01 mm".
        thickness: At the clamp.
        clamp: Column and row of the centre of the clamp: "212,640". Default: the jack's face.
        tilt: Of the plectrum's axis, counterclockwise: "2 deg". Default: found.
        upper: Side of the picture to which the string's side points. Default: found.

    Raises:
        AnalysisError: An option is faulty, or the picture is refused; says why.
        MissingExtraError: scikit-image is not installed.
    """
    path = Path(photo)
    faults: list[str] = []
    texts = {"pixels-per-mm": pixels_per_mm, "length": length, "thickness": thickness, "tilt": tilt}
    units = {"length": "m", "thickness": "m", "tilt": "rad"}
    known = {name: _known(name, text, units.get(name, ""), faults) for name, text in texts.items()}
    per_mm = known["pixels-per-mm"]
    for name in ("pixels-per-mm", "length", "thickness"):
        if (own := known[name]) and own.value <= 0:
            faults.append(f"{name}: {own.value:g} is not above 0")
    given = Given(
        per_mm and Known(1e3 * per_mm.value, 1e3 * per_mm.std),
        _ruler(ruler, faults),
        known["length"],
        known["thickness"],
        _point(clamp, faults),
        known["tilt"],
        upper,
    )
    if faults:
        raise AnalysisError(fault_list("outline", faults))
    try:
        return Outlined(path, measure(silhouette(read_photo(path)), given))
    except AnalysisError as error:
        if str(error).startswith("photograph"):
            raise
        raise AnalysisError(f"photograph {path}: {error}") from error


def _known(name: str, text: str | None, unit: str, faults: list[str]) -> Known | None:
    if text is None:
        return None
    if not unit:  # of pixels per mm; to pint, px is 1/96 inch
        text = re.sub(r"\s*(?:px|pixels?|1)\s*/\s*mm\b", "", text)
    value, std = match.groups() if (match := _STD.fullmatch(text)) else (text, None)
    try:
        if not unit and (other := re.search(r"[^-+.\deE\s/±]+", text)):
            raise ValueError(f"{other[0]!r} is no number")
        if std is None:
            return Known(parse_quantity(value, unit))
        # The unit may stand once, at the end.
        unit_of = re.sub(r"^\s*[-+.\deE]+", "", std) if re.fullmatch(r"[-+.\deE\s]+", value) else ""
        return Known(parse_quantity(value + unit_of, unit), abs(parse_quantity(std, unit)))
    except ValueError as error:
        example = "4.5 mm +/- 0.01 mm" if unit else "250 +/- 0.5"
        faults.append(f'{name}: {error}; write it like "{example}"')
        return None


def _pixels(texts: Sequence[str]) -> list[float] | None:
    """Return finite numbers; None if one is none."""
    try:
        found = [*map(float, texts)]
    except ValueError:
        return None
    return found if math.isfinite(sum(found)) else None


def _point(text: str | None, faults: list[str]) -> tuple[float, float] | None:
    if text is None:
        return None
    found = _pixels(text.split(","))
    if found is None or len(found) != 2:
        faults.append(f"clamp: {text!r} is refused; give column and row in pixels: 212,640")
        return None
    return found[0], found[1]


def _ruler(text: str | None, faults: list[str]) -> Ruler | None:
    if text is None:
        return None
    match = _RULER.fullmatch(text)
    known = match and _known("ruler", match[5], "m", faults)
    ends = match and _pixels(match.groups()[:4])
    if ends is None:
        how = 'write two points and their distance: "100,900 1350,900 5 mm"'
        faults.append(f"ruler: {text!r} is refused; {how}")
        return None
    if known and known.value <= 0:
        faults.append("ruler: its length is not above 0 mm")
    return known and Ruler((ends[0], ends[1]), (ends[2], ends[3]), known)
